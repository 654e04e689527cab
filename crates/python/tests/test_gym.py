"""Environments of Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import viscera as vi
import viscera.gym as vig
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

NAMES = sorted(vig.TASKS)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.filterwarnings("ignore:.*not rendering.*:UserWarning")
def test_environments_are_as_gymnasium_wants_them(name: str) -> None:
    environment = gymnasium.make(f"viscera/{name}-v0", render_mode="rgb_array")
    check_env(environment.unwrapped, skip_render_check=False)
    environment.reset(seed=1)
    picture: Any = environment.render()
    assert picture.shape == (480, 640, 3)


@pytest.mark.parametrize("name", NAMES)
def test_a_vector_of_worlds_is_as_many_environments(name: str) -> None:
    many: Any = gymnasium.make_vec(f"viscera/{name}-v0", num_envs=3, threads=2)
    seeds = [3, 5, 7]
    seen, _ = many.reset(seed=seeds)
    actions = np.random.default_rng(0).uniform(-1, 1, (6, *many.action_space.shape))
    kept = [seen]
    for action in actions:
        observation, _, _, _, _ = many.step(action.astype(np.float32))
        kept.append(observation)
    assert many.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.SAME_STEP
    for number, seed in enumerate(seeds):
        task = vig.TASKS[name](1, 1, vig.MAX_FORCE)
        task.reset(np.ones(1, dtype=bool), [seed])
        one = [task.observe()]
        for action in actions:
            task.step(action[number : number + 1].astype(np.float32).astype(np.float64))
            one.append(task.observe())
        for alone, together in zip(one, kept, strict=True):
            for key in alone:
                assert np.array_equal(alone[key][0], together[key][number]), (name, key)


def retract(observation: dict[str, Any]) -> NDArray[Any]:
    """Leads the grip to where the end is missing."""
    way: NDArray[Any] = np.clip(300.0 * (observation["goal"] - observation["end"]), -1.0, 1.0)
    return way


def test_a_scripted_hand_brings_tissue_to_its_goal() -> None:
    many = gymnasium.make_vec("viscera/TissueRetraction-v0", num_envs=4)
    observation, _ = many.reset(seed=1)
    won = np.zeros(4, dtype=bool)
    for _ in range(100):
        observation, reward, ended, cut, info = many.step(retract(observation))
        won |= ended & (reward > 0.0)
        if "_final_obs" in info:
            assert np.array_equal(info["_final_obs"], ended | cut)
            last = info["final_obs"]
            far = np.linalg.norm(last["end"] - last["goal"], axis=1)
            assert np.all(far[ended & (reward > 0.0)] < 1e-3)
    assert won.all()


def test_the_lump_feels_stiffer() -> None:
    task = vig.Palpation(4, None, 10.0)
    task.reset(np.ones(4, dtype=bool), [0, 1, 2, 3])
    task.lump[:] = [0, 1, 2, 3]
    young = np.where(np.arange(4) == task.lump[:, None], 50e3, 5e3)
    task.worlds.update(
        {f"body.tissue.region.{number}.young": young[:, number] for number in range(4)}
    )
    felt = np.zeros((4, 4))
    for place, at in enumerate(task.PLACES):
        # Above the place, down, and up again.
        task.probe[:] = [*at, 0.027]
        for height in np.linspace(0.027, 0.022, 40):
            task.probe[:, 2] = height
            task.worlds.move_tool("probe", task.probe)
            task.worlds.step()
        felt[:, place] = -task.force()[:, 2]
        for _ in range(10):
            task.probe[:, 2] += 5e-4
            task.worlds.move_tool("probe", task.probe)
            task.worlds.step()
    assert np.array_equal(felt.argmax(axis=1), task.lump)


def test_jaws_grasp_and_lift() -> None:
    task = vig.GraspAndPull(2, None, 10.0)
    task.reset(np.ones(2, dtype=bool), [0, 1])
    won = np.zeros(2, dtype=bool)
    for step in range(150):
        # Over the end, shut, up.
        action = np.zeros((2, 4))
        if step < 22:
            action[:, 0] = -0.5
        elif step < 40:
            action[:, 3] = 1.0
        else:
            action[:, 2] = 0.5
            action[:, 3] = 1.0
        _, ended, _ = task.step(action)
        won |= ended & task.has_succeeded()
        if won.all():
            break
    assert won.all(), task.observe()


def test_too_much_force_ends_an_episode() -> None:
    environment = gymnasium.make("viscera/TissueRetraction-v0", max_force=0.2)
    environment.reset(seed=0)
    for _ in range(60):
        _, reward, ended, _, info = environment.step(np.array([1.0, 0.0, 1.0], dtype=np.float32))
        if ended:
            break
    assert ended
    assert reward == -10.0
    assert info["force"] > 0.2
    # It begins anew.
    observation, info = environment.reset(seed=0)
    # But for the rounding of positions, times 100 N/m.
    assert info["force"] < 1e-6
    assert np.array_equal(observation["grip"], np.zeros(3))


def test_an_episode_is_cut_off_after_so_many_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vig.Palpation, "max_steps", 3)
    many: Any = vig.TissueVectorEnv("Palpation", num_envs=2, threads=1)
    many.reset(seed=0)
    still = np.zeros((2, 3), dtype=np.float32)
    cuts = []
    for _ in range(7):
        _, _, ended, cut, _ = many.step(still)
        assert not ended.any()
        cuts.append(bool(cut.all()))
    assert cuts == [False, False, True, False, False, True, False]


def test_tasks_are_scenes() -> None:
    for task in vig.TASKS.values():
        assert vi.Scene.parse(task.scene).bodies

"""Exact states of rest, and their derivatives."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viscera as vi
from conftest import BALL, BLOCK

GRIP = """
[[motion]]
name = "grip"
body = "block"
half_space = { point = [0, 0, "15 mm"], normal = [0, 0, 1] }
keys = [{ time = "0.4 s", translation = ["2 mm", 0, "3 mm"] }]
"""

YOUNG, POISSON = "body.block.material.young", "body.block.material.poisson"

# Small enough that no part of the ball begins or ends to touch.
STEP = 3e-5


def drawn(**settings: Any) -> vi.Scene:
    """A block whose top is drawn up and aside."""
    settings = {"solver.threads": 1, **settings}
    return vi.Scene.parse(BLOCK + GRIP, name="drawn.toml", settings=settings)


def test_a_simulation_comes_to_rest_there() -> None:
    # By methods that share no line with Newton's: in single precision, to what it has.
    for method in ("quasi_newton", "xpbd", "explicit"):
        scene = drawn(
            **{"solver.method": method, "solver.elements": "plain", "time.duration": "2 s"}
        )
        sim = vi.Simulation(scene, precision="f64")
        sim.advance(scene.frame_count)
        state = vi.rest(scene)
        away = np.abs(sim["block"].positions - state.positions("block")[0]).max()
        moved = np.abs(state.positions("block")[0] - sim["block"].rest).max()
        assert away < 1e-4 * moved, method
        assert sim.force("grip") == pytest.approx(state.force("grip")[0], rel=2e-3, abs=1e-3)


def test_forces_of_displacements_are_proportional_to_stiffness() -> None:
    scene = drawn(**{"world.gravity": 0.0})
    state = vi.rest(scene, [0.1, 0.4], unknown=[YOUNG])
    assert state.times == pytest.approx([0.1, 0.4])
    for name in ("grip", "table"):
        force = state.force(name)
        assert np.linalg.norm(force, axis=1).min() > 0.1
        np.testing.assert_allclose(
            state.force_along(YOUNG, name) * 10e3, force, rtol=1e-10, atol=1e-10
        )
    assert np.abs(state.positions_along(YOUNG, "block")).max() * 10e3 < 1e-12


def test_derivatives_are_what_differences_say() -> None:
    # From the side, where tissue is free.
    ball: dict[str, Any] = {
        "tool.ball.position": [-9e-3, 15e-3, 8e-3],
        "tool.ball.keys": [{"time": "0.2 s", "translation": ["5 mm", 0, 0]}],
        "tool.ball.friction": 0.0,
    }
    scene = vi.Scene.parse(BLOCK + GRIP + BALL, settings=ball)
    state = vi.rest(scene, unknown=[YOUNG, POISSON])
    assert np.linalg.norm(state.force("ball")) > 0.01
    for key, value in ((YOUNG, 10e3), (POISSON, 0.43)):
        scene[key] = value
        state = vi.rest(scene, unknown=[key])
        ends = []
        for times in (-2, -1, 1, 2):
            there = scene.copy()
            there[key] = value * (1 + STEP * times)
            ends.append(vi.rest(there, near=state))

        def slope(of: Any, ends: list[vi.Rest] = ends, value: float = value) -> Any:
            a, b, c, d = (of(end) for end in ends)
            return (a - 8 * b + 8 * c - d) / (12 * STEP * value)

        places = slope(lambda end: end.positions("block"))
        exact = state.positions_along(key, "block")
        assert np.linalg.norm(places - exact) < 1e-6 * np.linalg.norm(places)
        for name in ("grip", "table", "ball"):
            force = slope(lambda end, name=name: end.force(name))
            exact = state.force_along(key, name)
            assert np.linalg.norm(force - exact) < 1e-6 * np.linalg.norm(force), name


def test_a_gradient_is_pulled_back() -> None:
    state = vi.rest(drawn(), [0.2, 0.4], unknown=[YOUNG, POISSON])
    by_positions = np.random.default_rng(1).normal(size=state.positions("block").shape)
    pulled = state.pull_back({"block": by_positions})
    for key in (YOUNG, POISSON):
        terms = by_positions * state.positions_along(key, "block")
        assert pulled[key] == pytest.approx(terms.sum(), abs=1e-12 * np.abs(terms).sum())


def test_the_end_of_the_scene_is_the_time_where_none_is_given() -> None:
    state = vi.rest(drawn())
    assert state.times == pytest.approx([0.5])
    assert state.unknown == []
    assert state.minimum == [True]
    assert "Block" in repr(state)
    # A search that begins at the solution ends there.
    again = vi.rest(drawn(), near=state)
    assert np.abs(again.positions("block") - state.positions("block")).max() < 1e-12


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"times": []}, vi.SceneError, "one time"),
        ({"times": [0.2, 0.1]}, vi.SceneError, "after the one before"),
        ({"times": [-1.0]}, vi.SceneError, "0 s or later"),
        ({"times": [np.nan]}, vi.SceneError, "NaN"),
        ({"times": 0.3}, vi.SceneError, "a list"),
        ({"times": [1e9]}, vi.SceneError, r"ends at 0.5\d* s, .* set time.duration"),
        ({"unknown": ["solver.substeps"]}, vi.UnknownKeyError, "no derivative"),
        ({"unknown": ["body.blok.material.young"]}, vi.UnknownKeyError, "blok"),
        ({"unknown": ["fixing.table.stiffness"]}, vi.SceneError, "no number"),
        ({"memory": "1 kB"}, vi.SimulationError, r"75 unknowns need .* memory=\""),
        ({"memory": "much"}, vi.SceneError, "memory"),
    ],
)
def test_what_cannot_be_is_told(
    arguments: dict[str, Any], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        vi.rest(drawn(), **arguments)


def test_what_rest_does_not_determine_is_told() -> None:
    late = drawn(**{"motion.grip.start": "0.1 s"})
    with pytest.raises(vi.SceneError, match=r"drawn.toml: motion `grip` takes hold"):
        vi.rest(late)
    loose = vi.Scene.parse(BLOCK.split("[[fixing]]", maxsplit=1)[0])
    with pytest.raises(vi.SimulationError, match="not held"):
        vi.rest(loose)


def test_a_whole_turn_is_followed() -> None:
    # Its pins end where they began.
    state = vi.rest(vi.Scene.builtin("twist", settings={"body.bar.cells_across": 2}), [1.5, 3.0])
    assert np.linalg.norm(state.force("chuck"), axis=1).max() > 1.0


def test_names_and_shapes_are_checked() -> None:
    state = vi.rest(drawn(), unknown=[YOUNG])
    with pytest.raises(vi.UnknownKeyError, match="there are: block"):
        state.positions("liver")
    with pytest.raises(vi.UnknownKeyError, match="there are: table, grip"):
        state.force("ball")
    with pytest.raises(vi.UnknownKeyError, match="poisson"):
        state.positions_along(POISSON, "block")
    with pytest.raises(vi.SceneError, match="shape"):
        state.pull_back({"block": np.zeros((2, 3))})


def test_a_ball_that_comes_at_once_presses_as_it_does_slowly() -> None:
    ball: dict[str, Any] = {
        "tool.ball.friction": 0.0,
        "tool.ball.keys": [{"time": "0.4 s", "translation": [0, 0, "-7 mm"]}],
    }
    scene = vi.Scene.parse(BLOCK + BALL, settings=ball)
    at_once = vi.rest(scene, [0.5]).force("ball")[-1]
    slowly = vi.rest(scene, np.linspace(0.02, 0.5, 25)).force("ball")[-1]
    assert at_once == pytest.approx(slowly, abs=1e-8)
    assert at_once[2] < -0.5


def test_friction_that_is_left_out_is_said() -> None:
    with pytest.warns(
        UserWarning, match=r"tool `ball` has friction 0.3.*set tool.ball.friction = 0"
    ):
        vi.rest(vi.Scene.parse(BLOCK + BALL))


def test_the_stiffness_of_a_region_is_an_unknown() -> None:
    scene = vi.Scene.builtin("palpation", settings={"tool.probe.friction": 0.0})
    keys = [f"body.tissue.{part}.young" for part in ("material", "region.0")]
    # Nothing weighs anything there: all forces are proportional to both together.
    state = vi.rest(scene, [0.3], unknown=keys)
    force, shares = state.force("probe"), [state.force_along(key, "probe") for key in keys]
    young = [8e3, 80e3]
    assert vi.Simulation(scene)["tissue"].material["young"] == young[0]
    whole = sum(e * share for e, share in zip(young, shares, strict=True))
    np.testing.assert_allclose(whole, force, rtol=1e-9, atol=1e-9)


def test_another_near_is_told() -> None:
    state = vi.rest(drawn(), [0.2])
    with pytest.raises(vi.SceneError, match="other times"):
        vi.rest(drawn(), [0.3], near=state)


def test_ctrl_c_ends_a_solve(tmp_path: Path) -> None:
    code = """
import viscera as vi
scene = vi.Scene.builtin("stretch", settings={"body.bar.cells_across": 6})
print("begins", flush=True)
try:
    vi.rest(scene)
except KeyboardInterrupt:
    print("ended")
"""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as running:
        assert running.stdout is not None
        assert running.stdout.readline() == "begins\n"
        time.sleep(2.0)
        running.send_signal(signal.SIGINT)
        begun = time.monotonic()
        assert running.stdout.read() == "ended\n"
        assert running.wait() == 0
    # A Newton step, not all of them: whole it takes a minute.
    assert time.monotonic() - begun < 30.0

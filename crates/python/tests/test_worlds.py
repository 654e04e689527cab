"""Many worlds: each has the bits that it has alone, and what is asked of one reaches no other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import viscera as vi
from conftest import GRASPER, PROBE

YOUNG = "body.block.material.young"


def alone(scene: vi.Scene, young: float, way: float) -> str:
    """The state of a simulation of its own after three frames."""
    scene = scene.copy()
    scene["output.force_error"] = False
    simulation = vi.Simulation(scene)
    simulation.change({YOUNG: young})
    ball = simulation.tool("ball")
    for _ in range(3):
        pose = ball.pose
        pose[2, 3] -= way
        ball.pose = pose
        simulation.advance()
    return simulation.digest()


@pytest.mark.parametrize(("count", "threads"), [(1, 1), (7, 2), (9, 3)])
def test_a_world_has_the_bits_that_it_has_alone(
    pressed: vi.Scene, count: int, threads: int
) -> None:
    young = np.linspace(5e3, 12e3, 9)[::-1][:count]
    ways = np.linspace(1e-4, 1e-3, 9)[:count]
    worlds = vi.Worlds(pressed, count, threads=threads)
    worlds.set(YOUNG, young)
    for _ in range(3):
        targets = worlds.tool_position("ball")
        targets[:, 2] -= ways
        worlds.move_tool("ball", targets)
        worlds.step()
    for number in range(count):
        expected = alone(pressed, float(young[number]), float(ways[number]))
        assert worlds.digest(number) == expected


def test_arrays_of_all_worlds(pressed: vi.Scene) -> None:
    worlds = vi.Worlds(pressed, 5)
    positions = worlds.positions["block"]
    simulation = vi.Simulation(pressed)
    assert positions.shape == (5, len(simulation["block"]), 3)
    assert len(worlds) == 5
    with pytest.raises(ValueError, match="read-only"):
        positions[0] = 0.0
    worlds.step(frames=15)
    frame = simulation.advance(15)
    for number in range(5):
        assert np.array_equal(positions[number], simulation["block"].positions)
    assert np.array_equal(worlds.force("ball"), [frame.force("ball")] * 5)
    assert np.array_equal(worlds.wrench("ball"), [simulation.tool("ball").wrench] * 5)
    assert worlds.force("ball")[0, 2] < -0.01
    assert worlds.frame.tolist() == [15] * 5
    assert worlds.status.tolist() == [0] * 5
    assert worlds.picture(3).startswith(b"\x89PNG")


def test_poses_turn_tools(pressed: vi.Scene) -> None:
    worlds = vi.Worlds(pressed, 2)
    simulation = vi.Simulation(pressed)
    turned = simulation.tool("ball").pose
    turned[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    turned[0, 3] += 1e-3
    for _ in range(2):
        worlds.move_tool("ball", [turned, turned])
        worlds.step()
        simulation.tool("ball").pose = turned
        simulation.advance()
    assert np.array_equal(worlds.tool_position("ball"), [turned[:3, 3]] * 2)
    assert np.array_equal(worlds.positions["block"][1], simulation["block"].positions)


def test_chosen_worlds_go_back(pressed: vi.Scene) -> None:
    worlds = vi.Worlds(pressed, 4, threads=2)
    rest = worlds.positions["block"].copy()
    worlds.step(6)
    sixth = [worlds.digest(number) for number in range(4)]
    worlds.reset(mask=[False, True, False, True])
    assert worlds.frame.tolist() == [6, 0, 6, 0]
    assert np.array_equal(worlds.positions["block"][1], rest[1])
    assert not np.array_equal(worlds.positions["block"][0], rest[0])
    assert np.all(worlds.force("ball")[[1, 3]] == 0.0)
    worlds.step(6)
    assert [worlds.digest(number) for number in (1, 3)] == [sixth[1], sixth[3]]
    worlds.set(YOUNG, "7 kPa", mask=np.array([True, False, False, False]))
    worlds.reset()
    worlds.step(6)
    now = [worlds.digest(number) for number in range(4)]
    assert now[1:] == sixth[1:]
    assert now[0] != sixth[0]


def test_holds_and_tools_that_are_taken(block: vi.Scene) -> None:
    worlds = vi.Worlds(block, 3)
    hold = worlds.take_hold("block", point=[0.03, 0.03, 0.015], stiffness="50 N/m")
    ways = np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, 2e-3], [0.0, 0.0, 4e-3]])
    worlds.lead(hold, ways)
    worlds.step(60)
    pulls = worlds.hold_force(hold)[:, 2]
    assert np.all(np.diff(pulls) > 0.0)
    name = worlds.take_tool(GRASPER)
    worlds.step()
    worlds.open_jaws(name, [0.1, 0.2, 0.3])
    worlds.lock_jaws(name, locked=True)
    worlds.step()
    assert worlds.take_tool(PROBE) == "probe"
    assert np.isfinite(worlds.wrench(name)).all()
    worlds.reset(mask=[True, False, False])
    assert np.isnan(worlds.wrench(name)).all(axis=1).tolist() == [True, False, False]
    worlds.reset()
    with pytest.raises(vi.SimulationError, match="let go"):
        worlds.hold_force(hold)
    with pytest.raises(vi.UnknownKeyError, match="there are: none"):
        worlds.wrench(name)


def test_a_world_that_fails_leaves_the_others(block: vi.Scene) -> None:
    worlds = vi.Worlds(block, 4, threads=2)
    one = np.array([False, False, True, False])
    worlds.set("solver.method", "xpbd", mask=one)
    worlds.set("world.gravity", 1e38, mask=one)
    worlds.step(3)
    assert worlds.status.tolist() == [0, 0, 3, 0]
    assert "diverged" in str(worlds.failure(2))
    assert worlds.failure(1) is None
    alone_block = vi.Worlds(block, 1)
    alone_block.step(3)
    for number in (0, 1, 3):
        assert worlds.digest(number) == alone_block.digest(0)
    worlds.set("world.gravity", 9.81, mask=one)
    worlds.reset(mask=worlds.status != 0)
    worlds.step(3)
    assert worlds.status[2] in (0, 1)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda w: w.set(YOUNG, [1e3, 2e3]), "2 values for 3 worlds"),
        (lambda w: w.set(YOUNG, np.ones((3, 2))), "young"),
        (lambda w: w.set(YOUNG, [1e3, np.nan, 1e3]), "young"),
        (lambda w: w.set(YOUNG, "5 kg"), "a mass"),
        (lambda w: w.set("body.block.cells", [1, 1, 1]), "cannot change"),
        (lambda w: w.move_tool("ball", np.zeros((2, 3))), "shape"),
        (lambda w: w.move_tool("ball", np.full((3, 3), np.nan)), "NaN"),
        (lambda w: w.move_tool("ball", np.zeros((3, 4, 4))), "last row"),
        (lambda w: w.take_hold("block", point=[0, 0, 0], count=0), "one vertex"),
        (lambda w: w.move_tool("bal", np.zeros((3, 3))), "there are: ball"),
        (lambda w: w.open_jaws("ball", np.zeros(3)), "no jaws"),
        (lambda w: w.reset(mask=[True]), "3 truths"),
        (lambda w: w.reset(mask=[1, 0, 1]), "3 truths"),
        (lambda w: w.failure(3), "no world 3"),
        (lambda w: w.force("nothing"), "there are"),
        (lambda w: w.take_hold("blok", point=[0, 0, 0]), "there are: block"),
        (lambda w: w.lead(99, np.zeros((3, 3))), "no hold 99"),
    ],
)
def test_what_cannot_be_is_told(pressed: vi.Scene, wrong: Any, says: str) -> None:
    worlds = vi.Worlds(pressed, 3, threads=1)
    before = [worlds.digest(number) for number in range(3)]
    with pytest.raises(vi.Error) as told:
        wrong(worlds)
    assert says in str(told.value)
    assert [worlds.digest(number) for number in range(3)] == before


def test_worlds_that_cannot_be(block: vi.Scene) -> None:
    with pytest.raises(vi.SceneError, match="one world"):
        vi.Worlds(block, 0)
    with pytest.raises(vi.SceneError, match="threads"):
        vi.Worlds(block, 2, threads=0)
    with pytest.raises(vi.SimulationError, match="fewer worlds"):
        vi.Worlds(block, 10**9)
    block["solver.precision"] = "f64"
    with pytest.raises(vi.SceneError, match="single precision"):
        vi.Worlds(block, 2)

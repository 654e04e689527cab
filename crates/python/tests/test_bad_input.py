"""What a user may do wrong: each thing is an error that names it, and leaves the simulation as it was."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import viscera as vi
from conftest import BLOCK, GRASPER, PROBE


def test_names_that_nothing_has(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    with pytest.raises(vi.UnknownKeyError, match="there are: block"):
        simulation["blok"]
    with pytest.raises(vi.UnknownKeyError, match="there are: table"):
        simulation.force("tabel")
    with pytest.raises(vi.UnknownKeyError, match="there are: none"):
        simulation.tool("ball")


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        (np.eye(3), "shape"),
        (np.zeros((4, 4)), "last row"),
        (np.full((4, 4), np.nan), "NaN"),
        ([[1, 2], [3]], "none"),
        ("here", "none"),
        (np.diag([2.0, 1.0, 1.0, 1.0]), "rotation"),
        (np.diag([-1.0, 1.0, 1.0, 1.0]), "rotation"),
    ],
)
def test_poses_that_are_none(pressed: vi.Scene, pose: Any, says: str) -> None:
    simulation = vi.Simulation(pressed)
    ball = simulation.tool("ball")
    before = ball.pose
    with pytest.raises(vi.SceneError, match=says):
        ball.pose = pose
    assert np.array_equal(ball.pose, before)
    far = np.eye(4)
    far[0, 3] = 1e9
    with pytest.raises(vi.SceneError, match="rotation and a place"):
        ball.pose = far


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({}, "vertex= or point="),
        ({"vertex": 0, "point": [0, 0, 0]}, "vertex= or point="),
        ({"vertex": 10**6}, "there is no vertex 1000000"),
        ({"point": [0, 0]}, "shape"),
        ({"point": [0, 0, np.inf]}, "infinity"),
        ({"vertex": 0, "count": 0}, "one vertex"),
        ({"vertex": 0, "count": 10**6}, "wants the nearest"),
        ({"vertex": 0, "stiffness": "5 kPa"}, "stiffness"),
        ({"vertex": 0, "stiffness": -1.0}, "stiffness"),
        ({"vertex": 0, "stiffness": float("nan")}, "stiffness"),
    ],
)
def test_holds_that_hold_nothing(block: vi.Scene, given: dict[str, Any], says: str) -> None:
    simulation = vi.Simulation(block)
    with pytest.raises((vi.SceneError, vi.UnknownKeyError), match=says):
        simulation.take_hold("block", **given)
    with pytest.raises((OverflowError, TypeError)):
        simulation.take_hold("block", vertex=-1)
    with pytest.raises((OverflowError, TypeError)):
        simulation.advance(-1)


def test_tools_that_are_none(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    for text, says in [("", "tool"), (PROBE + GRASPER, "one"), ("[[tool]]\nname = 1\n", "name")]:
        with pytest.raises(vi.SceneError, match=says):
            simulation.take_tool(text)
    inside = PROBE.replace('"21 mm"', '"8 mm"')
    with pytest.raises(vi.SceneError):
        simulation.take_tool(inside)
    assert simulation.tools == []


def test_settings_of_a_simulation_that_cannot_be(block: vi.Scene) -> None:
    with pytest.raises(vi.SceneError, match="precision"):
        vi.Simulation(block, precision="f16")  # type: ignore[arg-type]
    with pytest.raises(vi.SceneError, match="threads"):
        vi.Simulation(block, threads=0)
    with pytest.raises(vi.SceneError, match="device"):
        vi.Simulation(block, device=5)  # type: ignore[arg-type]


def test_snapshots_of_something_else(block: vi.Scene, pressed: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    simulation.advance(2)
    good, digest = simulation.save(), simulation.digest()
    other = vi.Simulation(pressed)
    other.advance(1)
    finer = block.copy()
    finer["body.block.cells"] = [5, 4, 2]
    double = vi.Simulation(block, precision="f64")
    # Hands that held a body which the scene has not; and a digit of what they did.
    named = vi.Scene.parse(
        BLOCK.replace('"block"\nhalf', '"other"\nhalf').replace('name = "block"', 'name = "other"')
    )
    held = vi.Simulation(named)
    held.take_hold("other", vertex=0)
    by_hand = vi.Simulation(block)
    by_hand.take_hold("block", vertex=0, stiffness=20.0)
    damaged = by_hand.save().replace(b"20 N/m", b"21 N/m")
    assert damaged != by_hand.save()
    wrong = [
        b"",
        b"viscera",
        good[:8],
        good[:20],
        good[:-1],
        good[:100] + bytes([good[100] ^ 0x5A]) + good[101:],
        good[:8] + b"\xff" * 8 + good[16:],
        other.save(),
        vi.Simulation(finer).save(),
        double.save(),
        good[:28] + b"\xff\xff" + good[30:],
        held.save(),
        damaged,
    ]
    for snapshot in wrong:
        with pytest.raises(vi.SnapshotError):
            simulation.load(snapshot)
        assert simulation.digest() == digest
    simulation.load(good)


def test_simulations_are_not_pickled(block: vi.Scene) -> None:
    with pytest.raises(TypeError, match="save"):
        pickle.dumps(vi.Simulation(block))


def test_one_thread_at_a_time(block: vi.Scene) -> None:
    block["body.block.cells"] = [10, 10, 6]
    simulation = vi.Simulation(block)
    met: list[str] = []
    started = threading.Event()

    def work() -> None:
        started.set()
        simulation.advance(60)

    thread = threading.Thread(target=work)
    thread.start()
    started.wait()
    while thread.is_alive():
        try:
            simulation.advance(1)
        except vi.BusyError as busy:
            met.append(str(busy))
            break
        time.sleep(1e-3)
    thread.join()
    assert met
    assert "another thread" in met[0]
    simulation.advance(1)


def test_other_threads_of_python_go_on(block: vi.Scene) -> None:
    block["body.block.cells"] = [10, 10, 6]
    simulation = vi.Simulation(block)
    counted = 0
    done = threading.Event()

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(1e-4)

    thread = threading.Thread(target=count)
    thread.start()
    simulation.advance(30)
    done.set()
    thread.join()
    assert counted > 10


def test_simulations_of_their_own_run_at_once(block: vi.Scene) -> None:
    alone = vi.Simulation(block)
    alone.advance(10)
    all_of_them = [vi.Simulation(block) for _ in range(4)]
    threads = [threading.Thread(target=s.advance, args=(10,)) for s in all_of_them]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {s.digest() for s in all_of_them} == {alone.digest()}


@pytest.fixture
def interruptible() -> Iterator[None]:
    """The usual answer to Ctrl-C: a shell starts what it runs in the background with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_stops_a_long_call(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        simulation.advance(10**9)
    assert time.monotonic() - begun < 10.0
    timer.join()
    frame = simulation.frame
    assert 0 < frame < 10**9
    simulation.advance(1)
    assert simulation.frame == frame + 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_fork_in_the_middle_is_told(block: vi.Scene) -> None:
    simulation = vi.Simulation(block, threads=2)
    simulation.advance(2)
    view = simulation["block"].positions
    child = os.fork()
    if child == 0:
        code = 1
        try:
            with pytest.raises(vi.ForkedError, match="spawn"):
                simulation.advance(1)
            # What was seen stays to be seen, and one of the child's own works.
            assert np.isfinite(view).all()
            own = vi.Simulation(block, threads=2)
            own.advance(2)
            assert np.array_equal(own["block"].positions, view)
            code = 0
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    simulation.advance(1)


def test_tissue_that_is_crushed_is_counted() -> None:
    settings = {"world.gravity": 1e4, "body.block.material.young": 1e3}
    simulation = vi.Simulation(vi.Scene.parse(BLOCK, settings=settings))
    frame = simulation.advance(20)
    assert frame.inverted > 0
    assert np.isfinite(simulation["block"].positions).all()

"""Simulations: frames, forces, holds, tools, snapshots."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import viscera as vi
from conftest import BALL, BLOCK, GRASPER, PROBE


def bits(simulation: vi.Simulation) -> list[bytes]:
    """All positions."""
    return [np.array(simulation[name].positions).tobytes() for name in simulation.bodies]


@pytest.mark.parametrize("name", ["liver_retraction", "twist", "palpation"])
def test_the_program_gives_the_same_bits(name: str, tmp_path: Path) -> None:
    program = os.environ.get("VISCERA_PROGRAM")
    if program is None:
        pytest.skip("VISCERA_PROGRAM names no program to compare with")
    command = [program, "run", name, "--frames", "20", "--set", "output.picture=false"]
    state = tmp_path / "state"
    command += ["--out", str(tmp_path / "out"), "--save", str(state)]
    subprocess.run(command, check=True, capture_output=True)
    simulation = vi.Simulation(vi.Scene.builtin(name))
    frame = simulation.advance(20)
    # Behind length and checksum of what hands did, of which there is nothing, stands what the program saves.
    assert simulation.save()[20:] == state.read_bytes()
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    last = summary["frames"][-1]
    for patch in last["patches"]:
        assert simulation.force(patch["name"]).tolist() == patch["force"]
        assert frame.force(patch["name"]).tolist() == patch["force"]
    for tool in last["tools"]:
        wrench = simulation.tool(tool["name"]).wrench.tolist()
        assert wrench == tool["force"] + tool["torque"]
        assert simulation.force(tool["name"]).tolist() == [-f for f in tool["force"]]
    assert frame.energy["elastic"] == last["energy"]["elastic"]
    assert frame.residual == last["relative_residual"]
    simulation.write_vtu(tmp_path / "ours.vtu")
    assert (tmp_path / "ours.vtu").read_bytes() == (tmp_path / "out" / "final.vtu").read_bytes()


def test_the_same_bits_at_any_number_of_threads(pressed: vi.Scene) -> None:
    found = set()
    choices: list[int | Literal["auto"]] = [1, 2, 3, "auto"]
    for threads in choices:
        simulation = vi.Simulation(pressed, threads=threads)
        simulation.advance(8)
        found.add(simulation.digest())
    assert len(found) == 1


def test_frames_say_where_they_are(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    assert (simulation.frame, simulation.time) == (0, 0.0)
    frame = simulation.advance(3)
    assert (frame.number, simulation.frame) == (3, 3)
    assert frame.time == simulation.time == 3 * simulation.frame_time
    assert frame.inverted == 0
    assert frame.energy["elastic"] > 0.0
    # What holds it carries it.
    simulation.advance(100)
    weight = simulation["block"].material["density"] * 0.03 * 0.03 * 0.015 * 9.81
    # Of what moves a ten-thousandth still, by the residual that the frame tells.
    assert simulation.force("table")[2] == pytest.approx(weight, rel=3e-4)
    assert "table" in repr(simulation.report)


def test_without_measures_positions_are_the_same(block: vi.Scene) -> None:
    one, other = vi.Simulation(block), vi.Simulation(block)
    one.advance(5)
    other.advance(5, measure=False)
    assert bits(one) == bits(other)
    assert one.digest() == other.digest()


def test_double_precision_gives_double_arrays(block: vi.Scene) -> None:
    simulation = vi.Simulation(block, precision="f64")
    simulation.advance()
    assert simulation["block"].positions.dtype == np.float64
    assert simulation["block"].velocities.dtype == np.float64


def test_a_hold_pulls_by_its_spring(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    corner = int(np.argmax(simulation["block"].rest @ [1.0, 1.0, 1.0]))
    with simulation.take_hold("block", vertex=corner, stiffness="50 N/m") as hold:
        hold.lead([0.0, 0.0, 5e-3])
        simulation.advance(60)
        place = simulation["block"].positions[corner]
        assert np.allclose(hold.place, place, atol=1e-9)
        # A spring: stiffness times its length.
        assert np.allclose(hold.force, 50.0 * (hold.target - hold.place), atol=1e-12)
        assert hold.force[2] > 0.01
    simulation.advance(1)
    with pytest.raises(vi.SimulationError, match="let go"):
        hold.force  # noqa: B018
    rigid = simulation.take_hold("block", point=[0.03, 0.03, 0.015], count=2)
    simulation.advance(1)
    assert np.allclose(rigid.place, rigid.target, atol=1e-7)


def test_tools_are_led_by_their_pose(pressed: vi.Scene) -> None:
    simulation = vi.Simulation(pressed)
    ball = simulation.tool("ball")
    pose = ball.pose
    assert np.allclose(pose[:3, 3], [0.015, 0.015, 0.022])
    for _ in range(6):
        pose[2, 3] -= 0.5e-3
        ball.pose = pose
        simulation.advance(1)
        assert np.array_equal(ball.pose, pose)
    assert ball.touches > 0
    assert ball.wrench[2] > 0.01
    assert simulation.force("ball")[2] == -ball.wrench[2]
    error = ball.wrench_error
    assert error is not None
    assert 0.0 <= error[0] < 1.0
    ball.put_away()
    simulation.advance(1)
    assert not ball.is_there


def test_tools_are_taken_and_jaws_are_moved(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    grasper = simulation.take_tool(GRASPER)
    assert simulation.tools == ["grasper"]
    simulation.advance(1)
    assert grasper.opening == pytest.approx(np.deg2rad(50.0))
    grasper.opening = 0.3
    simulation.advance(1)
    assert grasper.opening == 0.3
    grasper.locked = True
    assert grasper.locked
    probe = simulation.take_tool(PROBE)
    simulation.advance(1)
    assert probe.opening is None
    with pytest.raises(vi.SceneError, match="no jaws"):
        probe.opening = 0.2


def test_a_snapshot_goes_on_to_the_bit(pressed: vi.Scene) -> None:
    simulation = vi.Simulation(pressed)
    simulation.advance(4)
    hold = simulation.take_hold("block", vertex=0, stiffness=20.0)
    hold.lead([1e-3, 0.0, 2e-3])
    simulation.take_tool(GRASPER)
    simulation.change({"body.block.material.young": "9 kPa"})
    simulation.advance(3)
    snapshot = simulation.save()
    digest = simulation.digest()
    assert digest == vi.digest(snapshot)
    simulation.advance(4)
    after, later = bits(simulation), simulation.digest()
    # In the same simulation, and in another one.
    for other in [simulation, vi.Simulation(pressed)]:
        other.load(snapshot)
        assert other.digest() == digest
        assert other.frame == 7
        other.advance(4)
        assert bits(other) == after
        assert other.digest() == later
    with pytest.raises(vi.SimulationError, match="set back"):
        hold.lead([0, 0, 0])
    # A tool that was taken by hand is in a hand still.
    grasper = simulation.tool("grasper")
    grasper.opening = 0.2
    simulation.advance(1)
    assert grasper.opening == 0.2
    simulation.reset()
    assert (simulation.frame, simulation.tools) == (0, ["ball"])
    assert np.array_equal(simulation["block"].positions, simulation["block"].rest.astype("f4"))


def test_settings_change_while_it_runs(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    simulation.advance(2)
    simulation.change({"body.block.material.young": 4e3})
    assert simulation["block"].material["young"] == 4e3
    with pytest.raises(vi.UnknownKeyError):
        simulation.change({"body.block.cells": [1, 1, 1]})
    with pytest.raises(vi.SceneError):
        simulation.change({"body.block.material.young": "4 mm"})
    assert simulation["block"].material["young"] == 4e3


def test_pictures_and_meshes(pressed: vi.Scene, tmp_path: Path) -> None:
    simulation = vi.Simulation(pressed)
    simulation.advance(2)
    png = simulation.picture(320, 240)
    assert png.startswith(b"\x89PNG")
    assert int.from_bytes(png[16:20], "big") == 320
    assert simulation._repr_png_().startswith(b"\x89PNG")
    simulation.write_vtu(tmp_path / "new folder" / "a.vtu")
    assert (tmp_path / "new folder" / "a.vtu").stat().st_size > 1000
    with pytest.raises(vi.FileError):
        simulation.write_vtu(tmp_path)
    vertices, triangles = simulation["block"].surface()
    assert triangles.max() < len(vertices)
    with pytest.raises(vi.SimulationError):
        simulation.picture(0, 10)


def test_a_scene_that_changes_later_leaves_the_simulation(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    block["body.block.material.young"] = 1e3
    assert simulation["block"].material["young"] == 10e3


def test_texts_of_the_tests_are_scenes() -> None:
    vi.Simulation(vi.Scene.parse(BLOCK + BALL + GRASPER))

"""Sweeps: the same rows by every engine, resumed where they were stopped, failures as rows."""

from __future__ import annotations

import importlib
import json
import os
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
from viscera import sweep

YOUNG = "body.block.material.young"


def measure(simulation: vi.Simulation) -> dict[str, Any]:
    """What is to be known of a trial."""
    return {
        "lift": simulation.force("table")[2],
        "lowest": simulation["block"].positions[:, 2].min(),
        "force": simulation.force("ball"),
    }


def dies(simulation: vi.Simulation) -> dict[str, Any]:
    """Takes its process along where the tissue is soft."""
    if simulation["block"].material["young"] < 5e3:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"lift": simulation.force("table")[2]}


def trials() -> list[dict[str, Any]]:
    """Six of them."""
    return sweep.grid({YOUNG: np.geomspace(4e3, 12e3, 3), "solver.accuracy": ["draft", "fine"]})


def test_a_grid_has_all_combinations() -> None:
    assert sweep.grid({"a": [1, 2], "b": "xy"}) == [
        {"a": 1, "b": "x"},
        {"a": 1, "b": "y"},
        {"a": 2, "b": "x"},
        {"a": 2, "b": "y"},
    ]
    assert sweep.grid({}) == [{}]
    assert sweep.grid({"a": []}) == []


def test_rows_are_those_of_simulations_one_by_one(pressed: vi.Scene) -> None:
    told: list[tuple[int, int]] = []
    rows = sweep.run(
        pressed, trials(), measure, frames=15, workers=2, progress=lambda *how: told.append(how)
    )
    assert told == [(done, 6) for done in range(7)]
    assert len(rows) == 6
    assert not rows.failed
    for trial, row in zip(trials(), rows, strict=True):
        scene = pressed.copy()
        scene.update(trial)
        simulation = vi.Simulation(scene)
        simulation.advance(15)
        assert row["bits"] == simulation.digest()
        assert row[YOUNG] == trial[YOUNG]
        assert row["lift"] == simulation.force("table")[2]
        assert row["force"] == simulation.force("ball").tolist()
    assert len(set(rows.column("digest"))) == 6
    assert rows.column("lift").shape == (6,)
    with pytest.raises(KeyError, match="no row has `left`"):
        rows.column("left")


def test_processes_give_the_same_rows(pressed: vi.Scene) -> None:
    ours = sweep.run(pressed, trials(), measure, frames=3)
    theirs = sweep.run(pressed, trials(), measure, frames=3, on="processes", workers=2)
    assert list(ours) == list(theirs)


def test_failures_are_rows_with_their_reason(pressed: vi.Scene) -> None:
    def odd(simulation: vi.Simulation) -> dict[str, Any]:
        return {"x": 1.0 / (simulation["block"].material["young"] - 5e3)}

    given: list[dict[str, Any]] = [
        {YOUNG: 4e3},
        {YOUNG: 5e3},
        {YOUNG: "5 kg"},
        {"body.block.material.yung": 1.0},
    ]
    rows = sweep.run(pressed, given, odd, frames=1)
    assert rows[0]["error"] is None
    assert rows[1]["error"].startswith("ZeroDivisionError")
    assert "a mass where a pressure is needed" in rows[2]["error"]
    assert "did you mean `young`" in rows[3]["error"]
    assert len(rows.failed) == 3
    twice = sweep.run(pressed, [{YOUNG: 4e3}], lambda s: {"digest": 1}, frames=1)
    assert "which a row has already" in twice[0]["error"]


def test_a_process_that_dies_costs_its_own_trial_only(pressed: vi.Scene) -> None:
    rows = sweep.run(pressed, trials(), dies, frames=1, on="processes", workers=2)
    assert [row["error"] for row in rows] == ["its process died"] * 2 + [None] * 4


def test_a_sweep_goes_on_where_it_was(pressed: vi.Scene, tmp_path: Path) -> None:
    file = tmp_path / "new" / "rows.jsonl"
    count = 0

    def counted(simulation: vi.Simulation) -> dict[str, Any]:
        nonlocal count
        count += 1
        return measure(simulation)

    first = sweep.run(pressed, trials()[:4], counted, frames=2, resume=file, workers=1)
    assert count == 4
    # The last line was cut off, and something else was written.
    text = file.read_text()
    file.write_text("{}\nnonsense\n" + text[: len(text) - 40])
    rows = sweep.run(pressed, trials(), counted, frames=2, resume=file, workers=1)
    assert count == 4 + 3
    assert list(rows)[:4] == list(first)
    assert len(file.read_text().splitlines()) == 6
    # Other frames, other scenes, other functions are other trials.
    sweep.run(pressed, trials(), counted, frames=3, resume=file)
    assert count == 7 + 6
    pressed["world.gravity"] = 5.0
    sweep.run(pressed, trials(), counted, frames=2, resume=file)
    assert count == 13 + 6
    lines = len(file.read_text().splitlines())
    sweep.run(pressed, trials(), measure, frames=2, resume=file)
    assert len(file.read_text().splitlines()) == lines + 6


@pytest.mark.parametrize("engine", ["threads", "ray"])
def test_a_driver_that_is_killed_is_resumed(engine: str, tmp_path: Path) -> None:
    if engine == "ray":
        pytest.importorskip("ray", reason="Ray is not installed")
    file = tmp_path / "rows.jsonl"
    (tmp_path / "block.toml").write_text(BLOCK + BALL)
    program = tmp_path / "program.py"
    program.write_text(
        f"""
import pathlib
import numpy as np
import viscera as vi
from viscera import sweep
def measure(simulation):
    return {{"lift": float(simulation.force("table")[2])}}
trials = sweep.grid({{{YOUNG!r}: np.geomspace(4e3, 12e3, 3), "solver.accuracy": ["draft", "fine"]}})
scene = vi.Scene.load("block.toml")
rows = sweep.run(
    scene, trials, measure, frames=200, workers=1, resume="rows.jsonl", on={engine!r}
)
# Not printed: Ray prints between the lines of this program.
pathlib.Path("seen").write_text(str(len(rows)))
"""
    )
    environment = {**os.environ, "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
    environment.pop("PYTHONWARNINGS", None)
    command = [sys.executable, "-W", "ignore", str(program)]
    begun = subprocess.Popen(command, cwd=tmp_path, env=environment)
    while not file.exists() or not file.read_text().count("\n"):
        assert begun.poll() is None, "it ended too early to be killed"
        time.sleep(0.01)
    begun.kill()
    begun.wait()
    before = file.read_text().splitlines()
    assert 1 <= len(before) < 6
    subprocess.run(command, cwd=tmp_path, env=environment, check=True)
    assert (tmp_path / "seen").read_text() == "6"
    after = file.read_text().splitlines()
    assert len(after) == 6
    assert after[: len(before) - 1] == before[: len(before) - 1]
    serial = sweep.run(
        vi.Scene.load(tmp_path / "block.toml"), trials(), measure, frames=200, workers=1
    )
    bits = {row["bits"] for row in serial}
    assert {json.loads(line)["bits"] for line in after} == bits


def test_ray_loses_a_worker_and_no_row(tmp_path: Path) -> None:
    pytest.importorskip("ray", reason="Ray is not installed")
    # A process of its own: Ray's warnings are its own matter, and its threads end with it.
    (tmp_path / "block.toml").write_text(BLOCK + BALL)
    program = tmp_path / "program.py"
    program.write_text(
        """
import json, os, pathlib, signal, sys
import numpy as np
import viscera as vi
from viscera import sweep
killed = pathlib.Path("killed").absolute()
def measure(simulation):
    if simulation["block"].material["young"] > 9e3 and not killed.exists():
        killed.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"lift": float(simulation.force("table")[2])}
trials = sweep.grid({"body.block.material.young": np.geomspace(4e3, 12e3, 50),
                     "solver.accuracy": ["draft", "fine"], "world.gravity": [5.0, 9.81]})
rows = sweep.run(vi.Scene.load("block.toml"), trials, measure, frames=1, on="ray", workers=2)
assert killed.exists()
serial = sweep.run(vi.Scene.load("block.toml"), trials, measure, frames=1, workers=1)
seen = [len(rows), len(rows.failed), list(rows) == list(serial)]
# Not printed: Ray prints between the lines of this program.
pathlib.Path("seen.json").write_text(json.dumps(seen))
"""
    )
    environment = {**os.environ, "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
    environment.pop("PYTHONWARNINGS", None)
    command = [sys.executable, "-W", "ignore", str(program)]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "seen.json").read_text()) == [200, 0, True]


def test_tables(pressed: vi.Scene, tmp_path: Path) -> None:
    rows = sweep.run(pressed, [{YOUNG: 4e3}, {YOUNG: "5 kg"}], measure, frames=1)
    try:
        import pyarrow.parquet as parquet
    except ImportError:
        with pytest.raises(ImportError, match="sweep"):
            rows.to_parquet(tmp_path / "rows.parquet")
        pytest.skip("PyArrow is not installed")
    rows.to_parquet(tmp_path / "new" / "rows.parquet")
    table = parquet.read_table(tmp_path / "new" / "rows.parquet")
    assert table.num_rows == 2
    assert table["lift"].to_pylist() == [rows[0]["lift"], None]
    assert table[YOUNG].to_pylist() == ["4000.0", "5 kg"]


@pytest.mark.parametrize("wrong", [{"on": "cloud"}, {"frames": 0}, {"workers": 0}, {"frames": -1}])
def test_what_cannot_be(pressed: vi.Scene, wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        sweep.run(pressed, trials(), measure, **{"frames": 1, **wrong})


def test_what_is_not_installed_is_named(
    pressed: vi.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"viscera\[ray\]"):
        sweep.run(pressed, trials(), measure, frames=1, on="ray")
    rows = sweep.run(pressed, [{}], measure, frames=1)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ImportError, match=r"viscera\[sweep\]"):
        rows.to_parquet(tmp_path / "rows.parquet")
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(ImportError, match=r"viscera\[pyvista\]"):
        vi.to_pyvista(vi.Simulation(pressed))
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "viscera.gym", raising=False)
    with pytest.raises(ImportError, match=r"viscera\[gym\]"):
        importlib.import_module("viscera.gym")

"""Scenes: reading them, and setting their keys."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viscera as vi
from conftest import BLOCK

YOUNG = "body.block.material.young"


def young(scene: vi.Scene) -> float:
    """What the simulation has [Pa]."""
    return vi.Simulation(scene)["block"].material["young"]


def test_numbers_are_in_si_units_to_the_last_digit(block: vi.Scene) -> None:
    for number in [6500, 6500.0, np.float64(1e4 / 3), np.int64(7000), np.nextafter(9e3, 1e9)]:
        block[YOUNG] = number
        assert young(block) == float(number)
    block[YOUNG] = "6.5 kPa"
    assert young(block) == 6500.0
    assert block[YOUNG] == "6.5 kPa"
    block[YOUNG] = np.float32(6e3)
    assert young(block) == 6000.0


def test_lists_and_tables_take_numbers_too(block: vi.Scene) -> None:
    block["fixing.table.half_space"] = {"point": np.array([0.0, 0.0, 1e-9]), "normal": [0, 0, -1]}
    block["body.block.size"] = (0.03, 0.02, 0.015)
    rest = vi.Simulation(block)["block"].rest
    assert np.allclose(rest.max(axis=0), [0.03, 0.02, 0.015], atol=1e-15)


def test_what_was_not_written_is_the_default(block: vi.Scene) -> None:
    assert block["solver.method"] == "auto"
    assert block["solver.threads"] == 1
    assert block["body.block.cells"] == [4, 4, 2]
    assert block["fixing.table.stiffness"] is None


def test_settings_are_all_made_or_none(block: vi.Scene) -> None:
    before = block.settings
    with pytest.raises(vi.SceneError):
        block.update({YOUNG: 5e3, "solver.substeps": -1})
    assert block.settings == before
    block.update({YOUNG: 5e3, "solver.substeps": 3})
    assert young(block) == 5e3
    del block[YOUNG]
    assert young(block) == 10e3
    with pytest.raises(vi.UnknownKeyError, match="nothing was set"):
        del block[YOUNG]


@pytest.mark.parametrize(
    ("key", "value", "kind", "says"),
    [
        ("body.block.material.yung", 1.0, vi.UnknownKeyError, "did you mean `young`"),
        ("body.blok.material.young", 1.0, vi.UnknownKeyError, "it has: block"),
        ("", 1.0, vi.UnknownKeyError, "key"),
        (YOUNG, "5 kg", vi.SceneError, "a mass where a pressure is needed"),
        (YOUNG, "5", vi.SceneError, "unit"),
        (YOUNG, float("nan"), vi.SceneError, "young"),
        (YOUNG, float("inf"), vi.SceneError, "young"),
        (YOUNG, -1.0, vi.SceneError, "must be above 0"),
        (YOUNG, None, vi.SceneError, "NoneType"),
        (YOUNG, object(), vi.SceneError, "object"),
        (YOUNG, [1.0, 2.0], vi.SceneError, "young"),
        (YOUNG, {"a": 1}, vi.SceneError, "young"),
        (YOUNG, 'text"with\\quotes\n', vi.SceneError, "young"),
        ("solver.substeps", 2.5, vi.SceneError, "whole number"),
        ("solver.substeps", True, vi.SceneError, "substeps"),
        ("solver.method", "xpdb", vi.SceneError, "did you mean `xpbd`"),
    ],
)
def test_wrong_settings_name_the_key_and_change_nothing(
    block: vi.Scene, key: str, value: Any, kind: type[vi.Error], says: str
) -> None:
    before = block.settings
    with pytest.raises(kind) as told:
        block[key] = value
    assert says in str(told.value)
    assert "\n" not in str(told.value)
    assert block.settings == before


def test_errors_are_the_ones_that_python_has_as_well(block: vi.Scene) -> None:
    with pytest.raises(KeyError):
        block["nothing"]
    with pytest.raises(ValueError, match="young"):
        block[YOUNG] = "5 kg"
    with pytest.raises(KeyError):
        vi.Scene.builtin("livr")
    with pytest.raises(OSError, match="no such file"):
        vi.Scene.load("nowhere.toml")


def test_files_that_are_no_scenes(tmp_path: Path) -> None:
    for name, content, kind in [
        ("empty.toml", b"", vi.SceneError),
        ("cut.toml", BLOCK.encode()[:100], vi.SceneError),
        ("bytes.toml", b"\xff\xfe\x00", vi.SceneError),
    ]:
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(kind, match=name):
            vi.Scene.load(path)
    with pytest.raises(vi.FileError, match="is a folder"):
        vi.Scene.load(tmp_path)


def test_mesh_files_come_along_to_another_process(tmp_path: Path) -> None:
    text = """
[[body]]
name = "one"
mesh = "one.msh"
unit = "1 m"
material = { young = "5 kPa", poisson = 0.4 }
"""
    points = ["0 0 0", "0.05 0 0", "0 0.05 0", "0 0 0.05"]
    nodes = "".join(f"{i} {point}\n" for i, point in enumerate(points, 1))
    (tmp_path / "one.msh").write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n{nodes}$EndNodes\n"
        "$Elements\n1\n1 4 2 0 0 1 2 3 4\n$EndElements\n"
    )
    (tmp_path / "scene.toml").write_text(text)
    scene = vi.Scene.load(tmp_path / "scene.toml")
    sent = pickle.dumps(scene)
    (tmp_path / "one.msh").unlink()
    with pytest.raises(vi.SceneError, match="data="):
        vi.Simulation(scene)
    received = pickle.loads(sent)
    assert len(vi.Simulation(received)["one"]) == 4


def test_copies_are_changed_on_their_own(block: vi.Scene) -> None:
    for other in [block.copy(), copy.copy(block), copy.deepcopy(block)]:
        other[YOUNG] = 4e3
        assert young(other) == 4e3
    assert young(block) == 10e3
    block[YOUNG] = 8e3
    assert young(pickle.loads(pickle.dumps(block))) == 8e3


def test_every_key_is_described() -> None:
    keys = {entry["key"]: entry for entry in vi.describe()}
    assert keys["body.material.young"]["unit"] == "Pa"
    assert keys["solver.iterations"]["unit"] == ""
    assert all(entry["doc"] and entry["takes"] for entry in keys.values())


def test_scenes_that_come_with_the_package() -> None:
    names = vi.built_in_scenes()
    assert "liver_retraction" in names
    for name in names:
        scene = vi.Scene.builtin(name)
        assert scene.bodies
        assert scene.frame_count > 0
        assert scene.title in repr(scene)

"""Scenes of meshes, surfaces and segmented scans."""

from __future__ import annotations

import gzip
import pickle
import struct
from pathlib import Path

import numpy as np
import pytest
import viscera as vi


def cube(path: Path, size: float) -> Path:
    """A closed surface, in the unit of the file."""
    corners = [[n & 1, n >> 1 & 1, n >> 2 & 1] for n in range(8)]
    sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    lines = [f"v {x * size} {y * size} {z * size}" for x, y, z in corners]
    lines += [f"f {a + 1} {b + 1} {c + 1} {d + 1}" for a, b, c, d in sides]
    path.write_text("\n".join(lines) + "\n")
    return path


def scan(path: Path) -> Path:
    """Two labels of 20 x 20 x 10 voxels of 2 mm, one on the other, in NIfTI."""
    labels = np.zeros((24, 24, 24), np.uint8)
    labels[2:22, 2:22, 2:12] = 1
    labels[2:22, 2:22, 12:22] = 5
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, 24, 24, 24, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 2, 8)
    struct.pack_into("<8f", header, 76, 1, 2, 2, 2, 1, 0, 0, 0)
    struct.pack_into("<f", header, 108, 352)
    struct.pack_into("<2h", header, 252, 0, 1)
    struct.pack_into("<12f", header, 280, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0)
    header[123] = 2
    header[344:348] = b"n+1\0"
    path.write_bytes(gzip.compress(bytes(header) + labels.tobytes(order="F")))
    return path


def test_a_surface_becomes_a_body_that_stays(tmp_path: Path) -> None:
    file = cube(tmp_path / "spleen.obj", 60.0)
    scene = vi.Scene.from_file(file, unit="1 mm", edge=0.015)
    assert scene.bodies == ["spleen"]
    assert scene["body.spleen.balanced"] is True
    simulation = vi.Simulation(scene)
    before = simulation["spleen"].positions.copy()
    assert np.allclose(before.max(axis=0) - before.min(axis=0), 0.06, atol=2e-3)
    simulation.advance(30)
    assert np.abs(simulation["spleen"].positions - before).max() < 1e-4

    # Finer, by a number of tetrahedra.
    def vertices(graded: bool) -> int:
        fine = vi.Scene.from_file(file, unit="1 mm", edge=0.004, graded=graded)
        return len(vi.Simulation(fine)["spleen"])

    assert vertices(True) < vertices(False)
    other = vi.Scene.from_file(file, unit=1e-3, count=4000, settings={"time.duration": "1 s"})
    assert other["time.duration"] == "1 s"
    assert len(vi.Simulation(other)["spleen"]) > len(simulation["spleen"])
    # Its meshes go with it.
    again = pickle.loads(pickle.dumps(scene))
    assert len(vi.Simulation(again)["spleen"]) == len(simulation["spleen"])


def test_what_was_made_can_be_written(tmp_path: Path) -> None:
    scene = vi.Scene.from_file(cube(tmp_path / "spleen.obj", 60.0), unit="1 mm", edge="20 mm")
    path = scene.write(tmp_path / "folder", "spleen")
    assert Path(path) == tmp_path / "folder" / "spleen.toml"
    read = vi.Simulation(vi.Scene.load(path))
    made = vi.Simulation(scene)
    assert np.array_equal(read["spleen"].positions, made["spleen"].positions)
    assert read.advance(3).time == made.advance(3).time
    assert read.digest() == made.digest()


def test_a_scan_becomes_organs(tmp_path: Path) -> None:
    file = scan(tmp_path / "two.nii.gz")
    found = vi.labels(file)
    assert [(entry["label"], entry["voxels"]) for entry in found] == [(1, 4000), (5, 4000)]
    assert all(abs(entry["volume"] - 4000 * 8e-9) < 1e-12 for entry in found)
    names = {1: "spleen", 5: "liver"}
    scene = vi.Scene.from_file(file, names=names, edge="8 mm")
    assert sorted(scene.bodies) == ["liver", "spleen"]
    simulation = vi.Simulation(scene)
    liver, tets = simulation["liver"].positions.astype(float), simulation["liver"].tets
    edges = liver[tets[:, 1:]] - liver[tets[:, :1]]
    volume = np.abs(np.linalg.det(edges)).sum() / 6
    assert abs(volume / (4000 * 8e-9) - 1) < 0.02
    assert vi.Scene.from_file(file, names=names, labels=["liver"], edge="8 mm").bodies == ["liver"]
    assert vi.Scene.from_file(file, names=names, labels=[1], edge="8 mm").bodies == ["spleen"]


def test_what_cannot_be_made_is_told_in_pythons_words(tmp_path: Path) -> None:
    surface, image = cube(tmp_path / "liver.obj", 60.0), scan(tmp_path / "two.nii.gz")
    with pytest.raises(vi.FileError, match="no such file"):
        vi.Scene.from_file(tmp_path / "absent.obj")
    with pytest.raises(vi.SceneError, match="edge: "):
        vi.Scene.from_file(surface, edge="8 kPa")
    with pytest.raises(vi.SceneError, match="unit: a length above zero"):
        vi.Scene.from_file(surface, unit=0.0)
    with pytest.raises(vi.SceneError, match="edge and count"):
        vi.Scene.from_file(surface, edge=0.01, count=100)
    with pytest.raises(vi.FileError, match="there is no label `heart`") as told:
        vi.Scene.from_file(image, labels=["heart"])
    assert "--" not in str(told.value)
    with pytest.raises(vi.FileError, match=r"labels") as told:
        vi.Scene.from_file(surface, labels=["liver"])
    assert "--" not in str(told.value)
    with pytest.raises(vi.FileError, match="is a mesh"):
        vi.labels(surface)
    with pytest.warns(UserWarning, match="unit"):
        vi.Scene.from_file(surface, unit="1 m", edge="10 m")

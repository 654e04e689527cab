"""Arrays: views of one place in memory, and what becomes of them."""

from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pytest
import viscera as vi
from numpy.typing import NDArray


def address(array: NDArray[Any]) -> int:
    """Where it is in memory."""
    return int(array.__array_interface__["data"][0])


def test_positions_stay_at_one_place_and_are_refreshed(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    view = simulation["block"].positions
    assert view.shape == (len(simulation["block"]), 3)
    assert view.dtype == np.float32
    before, place = view.copy(), address(view)
    simulation.advance(3)
    assert not np.array_equal(view, before)
    assert address(simulation["block"].positions) == place
    simulation.reset()
    assert np.array_equal(view, before)
    assert address(simulation["block"].positions) == place


def test_positions_cannot_be_written_to(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    view = simulation["block"].positions
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0


def test_other_libraries_share_the_memory(block: vi.Scene) -> None:
    view = vi.Simulation(block)["block"].positions
    shared = np.from_dlpack(view)
    assert address(shared) == address(view)
    assert not shared.flags.writeable


def test_a_view_outlives_its_simulation(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    simulation.advance(2)
    view = simulation["block"].positions
    kept = view.copy()
    body = simulation["block"]
    del simulation
    gc.collect()
    assert np.array_equal(view, kept)
    assert len(body) == len(view)
    del body
    gc.collect()
    assert np.array_equal(view, kept)


def test_a_view_is_kept_over_load(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    snapshot = simulation.save()
    view = simulation["block"].positions
    rest = view.copy()
    simulation.advance(2)
    simulation.load(snapshot)
    assert np.array_equal(view, rest)
    assert address(simulation["block"].positions) == address(view)


def test_indices_and_rest(block: vi.Scene) -> None:
    simulation = vi.Simulation(block)
    body = simulation["block"]
    assert body.tets.dtype == np.uint32
    assert body.tets.max() == len(body) - 1
    corners = body.rest[body.tets]
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.linalg.det(edges).sum() / 6.0
    assert volume == pytest.approx(0.03 * 0.03 * 0.015, rel=1e-12)
    simulation.advance(2)
    moved = body.positions - body.rest
    assert np.allclose(body.velocities[body.rest[:, 2] == 0.0], 0.0)
    assert np.abs(moved).max() > 0.0

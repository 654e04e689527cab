"""Meshes for PyVista."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._viscera import Simulation


def to_pyvista(simulation: Simulation) -> Any:
    """All bodies' tetrahedra as they are now, as a ``pyvista.UnstructuredGrid``.

    It has "displacement" [m] of each point and "body" of each tetrahedron; the extra ``viscera[pyvista]`` brings
    PyVista.
    """
    try:
        import pyvista  # type: ignore[import-not-found, unused-ignore]
    except ImportError as missing:
        raise ImportError("to_pyvista needs PyVista: pip install 'viscera[pyvista]'") from missing
    bodies = [simulation[name] for name in simulation.bodies]
    points = np.concatenate([body.positions for body in bodies])
    rest = np.concatenate([body.rest for body in bodies])
    firsts = np.cumsum([0] + [len(body) for body in bodies])
    tets = np.concatenate(
        [body.tets.astype(np.int64) + first for body, first in zip(bodies, firsts, strict=False)]
    )
    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: tets}, points)
    grid.point_data["displacement"] = points - rest
    grid.cell_data["body"] = np.repeat(np.arange(len(bodies)), [len(body.tets) for body in bodies])
    return grid

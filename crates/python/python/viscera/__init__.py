"""Real-time soft tissue for surgical applications.

>>> import viscera as vi
>>> sim = vi.Simulation(vi.Scene.builtin("twist"))
>>> frame = sim.advance(frames=2)
>>> sim["bar"].positions.shape[1]
3

Lengths are metres, masses kilograms, times seconds, forces newtons; +z is up.
"""

from __future__ import annotations

from ._errors import (
    BusyError,
    Error,
    FileError,
    ForkedError,
    InternalError,
    SceneError,
    SimulationError,
    SnapshotError,
    UnknownKeyError,
)
from ._fit import Fit, MisfitWarning, UndeterminedWarning, fit
from ._measurements import Measurements
from ._pyvista import to_pyvista
from ._viscera import (
    Body,
    Frame,
    Hold,
    Rest,
    Scene,
    Simulation,
    Tool,
    Worlds,
    built_in_scenes,
    describe,
    digest,
    labels,
    rest,
    version,
)

__version__ = version()

__all__ = [
    "Body",
    "BusyError",
    "Error",
    "FileError",
    "Fit",
    "ForkedError",
    "Frame",
    "Hold",
    "InternalError",
    "Measurements",
    "MisfitWarning",
    "Rest",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationError",
    "SnapshotError",
    "Tool",
    "UndeterminedWarning",
    "UnknownKeyError",
    "Worlds",
    "__version__",
    "built_in_scenes",
    "describe",
    "digest",
    "fit",
    "labels",
    "rest",
    "to_pyvista",
    "version",
]

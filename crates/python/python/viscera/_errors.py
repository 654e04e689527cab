"""Errors of the package."""

from __future__ import annotations


class Error(Exception):
    """Any error of viscera."""


class SceneError(Error, ValueError):
    """A scene, or something given for one, that cannot be: the message names the place and the next move."""


class UnknownKeyError(Error, KeyError):
    """A key or a name that nothing has; the message suggests the nearest."""

    # KeyError shows its message in quotes, as if it were a key.
    __str__ = Exception.__str__


class SimulationError(Error, RuntimeError):
    """A simulation that cannot be built, or cannot go on."""


class SnapshotError(Error, ValueError):
    """A snapshot that is damaged, or of another scene or version."""


class BusyError(Error, RuntimeError):
    """Another thread is at work on the simulation."""


class ForkedError(Error, RuntimeError):
    """The simulation was made in another process, of which this one is a fork."""


class FileError(Error, OSError):
    """A file that cannot be read or written."""


class InternalError(Error, RuntimeError):
    """A defect of viscera."""

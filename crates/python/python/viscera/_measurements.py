"""What was measured on real tissue, to be fitted."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._errors import FileError, SceneError, UnknownKeyError
from ._types import Floats, Path
from ._viscera import Rest, Simulation

# Times of two tables are the same where they differ by no more [s].
SAME_TIME = 1e-6

# Tissue that has moved so many times the body's size was not measured in metres.
FARTHEST = 10.0


def mapping(what: str, given: Any, example: str) -> Mapping[Any, Any]:
    """A dictionary, or an error that shows one."""
    if not isinstance(given, Mapping):
        raise SceneError(
            f"{what} is a dictionary such as {example}; this is a {type(given).__name__}"
        )
    return given


class Measurements:
    """Forces and places of markers, each at times at which tissue was at rest.

    ``times`` [s] are those of the scene's motions, shape (t,). ``force`` has by the name of a fixing, motion, force or
    tool what it did to the tissue [N], shape (t, 3), as :meth:`viscera.Simulation.force` says it. ``markers`` has by
    the name of a body where its markers were on the unloaded body [m], shape (k, 3), and where they were seen [m],
    shape (t, k, 3). NaN is what was not measured.
    """

    def __init__(
        self,
        times: ArrayLike,
        *,
        force: Mapping[str, ArrayLike] | None = None,
        markers: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    ) -> None:
        self.times: Floats = _array("times", times, (None,))
        count = len(self.times)
        ascending = np.all(np.diff(self.times) > 0)
        if count == 0 or not np.isfinite(self.times).all() or self.times[0] < 0 or not ascending:
            raise SceneError(
                "times are seconds from 0 s on, one at least, and each is after the one before"
            )
        forces = mapping("force", {} if force is None else force, '{"grip": forces}')
        self.force: dict[str, Floats] = {
            name: _array(f"the force of `{name}`", given, (count, 3))
            for name, given in forces.items()
        }
        self.markers: dict[str, tuple[Floats, Floats]] = {}
        pairs = mapping("markers", {} if markers is None else markers, '{"liver": (rest, seen)}')
        for name, pair in pairs.items():
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise SceneError(f"markers of `{name}` are a pair: unloaded, and as they were seen")
            rest, seen = pair
            places = _array(f"unloaded markers of `{name}`", rest, (None, 3))
            if not np.isfinite(places).all():
                raise SceneError(f"unloaded markers of `{name}` hold NaN or infinity")
            shape = (count, len(places), 3)
            self.markers[name] = (places, _array(f"markers of `{name}`", seen, shape))
        for what, all_of in (("force", self.force), ("marker", self._seen())):
            for name, numbers in all_of.items():
                if np.isinf(numbers).any():
                    raise SceneError(
                        f"a {what} of `{name}` is infinite; NaN is what was not measured"
                    )
        if not self.counts()[0]:
            raise SceneError("nothing was measured: all numbers are NaN, or there are none")

    def _seen(self) -> dict[str, Floats]:
        return {name: seen for name, (_, seen) in self.markers.items()}

    def counts(self) -> tuple[int, int]:
        """How many numbers were measured, and how many gaps there are."""
        numbers = [*self.force.values(), *self._seen().values()]
        known = sum(int(np.isfinite(array).sum()) for array in numbers)
        return known, sum(array.size for array in numbers) - known

    def __repr__(self) -> str:
        """What there is."""
        known, gaps = self.counts()
        names = ", ".join([*self.force, *(f"markers of {name}" for name in self.markers)])
        return (
            f"<viscera.Measurements {names}: {len(self.times)} times, {known} numbers, {gaps} gaps>"
        )

    @classmethod
    def csv(
        cls,
        path: Path,
        *,
        time: str = "t",
        force: Mapping[str, Sequence[str]] | None = None,
        markers: Mapping[str, Path] | None = None,
    ) -> Measurements:
        """Reads tables with a line of names above.

        The first has a column of times [s] and, by the name of what the force belongs to, three columns of it [N];
        empty fields are gaps. A table of markers has the columns ``t``, ``marker``, ``x``, ``y``, ``z`` [s, a name, m];
        lines with ``rest`` in place of a time say where markers are on the unloaded body.
        """
        forces_of = mapping("force", {} if force is None else force, '{"grip": ["fx", "fy", "fz"]}')
        files = mapping("markers", {} if markers is None else markers, '{"liver": "markers.csv"}')
        rows = _table(
            path, [time, *(column for columns in forces_of.values() for column in columns)]
        )
        _check_times(path, time, rows)
        times = np.array([_number(path, line, time, row[time]) for line, row in rows])
        forces: dict[str, ArrayLike] = {}
        for name, columns in forces_of.items():
            if len(columns) != 3:
                raise SceneError(
                    f"the force of `{name}` has three columns; these are {list(columns)}"
                )
            forces[name] = [
                [_number(path, line, column, row[column]) for column in columns]
                for line, row in rows
            ]
        seen = {name: _markers(file, times) for name, file in files.items()}
        return cls(times, force=forces, markers=seen)


def _array(what: str, given: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    try:
        array = np.array(given, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise SceneError(f"{what}: {problem}") from None
    fits = array.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if size is None else str(size) for size in shape)
        raise SceneError(f"{what}: give shape ({wanted}); this has {array.shape}")
    return array


def _table(path: Path, columns: Sequence[str]) -> list[tuple[int, dict[str, str]]]:
    """Lines of a table with their numbers."""
    try:
        with FilePath(path).open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            known = [name.strip() for name in reader.fieldnames or []]
            reader.fieldnames = known
            for column in columns:
                if column not in known:
                    raise UnknownKeyError(
                        f"{path}: there is no column `{column}`; there are: {', '.join(known)}"
                    )
            rows = [(reader.line_num, row) for row in reader]
    except OSError as problem:
        raise FileError(f"{path}: {problem.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as problem:
        raise SceneError(f"{path} is no table of comma-separated values: {problem}") from None
    for line, row in rows:
        short = any(row[column] is None for column in columns)
        if short or None in row:
            raise SceneError(f"{path}, line {line}: it has not as many fields as the line of names")
    return rows


def _number(path: Path, line: int, column: str, text: str) -> float:
    if not text.strip():
        return float("nan")
    try:
        return float(text)
    except ValueError:
        raise SceneError(f"{path}, line {line}: {column} is `{text}`, which is no number") from None


def _check_times(path: Path, column: str, rows: list[tuple[int, dict[str, str]]]) -> None:
    """Tells the first line whose time is not after the one before."""
    before = -1.0
    for line, row in rows:
        now = _number(path, line, column, row[column])
        if not before < now < np.inf:
            raise SceneError(
                f"{path}, line {line}: {column} is `{row[column]}`; times are seconds from 0 s on, "
                "each after the one before"
            )
        before = now


def _markers(path: Path, times: Floats) -> tuple[Floats, Floats]:
    rest: dict[str, list[float]] = {}
    later: list[tuple[int, str, str, list[float]]] = []
    for line, row in _table(path, ["t", "marker", "x", "y", "z"]):
        place = [_number(path, line, axis, row[axis]) for axis in "xyz"]
        time, marker = row["t"].strip(), row["marker"].strip()
        if time.lower() != "rest":
            later.append((line, time, marker, place))
        elif marker in rest:
            raise SceneError(
                f"{path}, line {line}: marker `{marker}` is unloaded for the second time"
            )
        else:
            rest[marker] = place
    names = list(rest)
    seen = np.full((len(times), len(names), 3), np.nan)
    known = set()
    for line, text, marker, place in later:
        seconds = _number(path, line, "t", text)
        if marker not in rest:
            raise SceneError(
                f"{path}, line {line}: no line with t = rest says where marker `{marker}` is unloaded"
            )
        at = np.flatnonzero(np.isclose(times, seconds, rtol=0.0, atol=SAME_TIME))
        if at.size == 0:
            raise SceneError(
                f"{path}, line {line}: at {text} s there is a marker, and no line of the other table"
            )
        key = int(at[0]), marker
        if key in known:
            raise SceneError(
                f"{path}, line {line}: marker `{marker}` is seen at {text} s for the second time"
            )
        known.add(key)
        seen[at[0], names.index(marker)] = place
    return np.array([rest[name] for name in names]).reshape(-1, 3), seen


class Anchors:
    """Markers in the tetrahedra of a body: they move with its vertices."""

    def __init__(self, simulation: Simulation, name: str, places: Floats) -> None:
        body = simulation[name]
        rest, tets = body.rest, body.tets.astype(np.int64)
        origins = rest[tets[:, 0]]
        inverses = np.linalg.inv(np.swapaxes(rest[tets[:, 1:]] - origins[:, None], 1, 2))
        self.size = longest = float(np.linalg.norm(np.ptp(rest, axis=0)))
        self.corners = np.empty((len(places), 4), dtype=np.int64)
        self.weights = np.empty((len(places), 4))
        for number, place in enumerate(places):
            three = np.einsum("tij,tj->ti", inverses, place - origins)
            four = np.concatenate([1.0 - three.sum(axis=1, keepdims=True), three], axis=1)
            best = int(np.argmax(four.min(axis=1)))
            self.corners[number], self.weights[number] = tets[best], four[best]
            # A marker on the skin may lie a little outside of a coarse mesh.
            inside = np.clip(four[best], 0.0, None)
            nearest = (inside / inside.sum()) @ rest[tets[best]]
            away = float(np.linalg.norm(place - nearest))
            if away > 0.05 * longest:
                raise SceneError(
                    f"marker {number} of `{name}` lies {1e3 * away:.1f} mm outside of the unloaded body; "
                    "markers are in the scene's frame, in metres"
                )

    def check(self, name: str, places: Floats, seen: Floats) -> None:
        """Tells what cannot be places of this body in metres."""
        away = np.linalg.norm(seen - places, axis=-1)
        if np.nanmax(away, initial=0.0) > FARTHEST * self.size:
            raise SceneError(
                f"a marker of `{name}` was seen {np.nanmax(away):.4g} m from where it is unloaded, and the body is "
                f"{self.size:.3g} m large; places are in metres, not millimetres"
            )

    def of(self, positions: Floats) -> Floats:
        """Markers from vertices, shape (..., k, 3)."""
        picked: Floats = positions[..., self.corners, :]
        moved: Floats = np.einsum("kc,...kcx->...kx", self.weights, picked)
        return moved


class Comparison:
    """Residuals of measurements, in standard deviations, and their derivatives."""

    def __init__(
        self,
        data: Measurements,
        anchors: Mapping[str, Anchors],
        sigma: Mapping[str, float],
        memory: str,
    ) -> None:
        self.data, self.anchors, self.sigma, self.memory = data, anchors, sigma, memory
        force = [f"force of {name}" for name in data.force]
        self.names = [*force, *(f"markers of {name}" for name in data.markers)]

    def _flat(self, forces: Any, places: Any) -> list[Floats]:
        of_forces = [forces(name) / self.sigma["force"] for name in self.data.force]
        of_markers = [
            self.anchors[name].of(places(name)) / self.sigma["markers"]
            for name in self.data.markers
        ]
        return [*of_forces, *of_markers]

    def _measured(self) -> list[Floats]:
        forces = [given / self.sigma["force"] for given in self.data.force.values()]
        seen = [places / self.sigma["markers"] for _, places in self.data.markers.values()]
        return [*forces, *seen]

    def residuals(self, rest: Rest) -> list[Floats]:
        """What the model says less what was measured, a part for each of the names; NaN where nothing was."""
        model = self._flat(rest.force, rest.positions)
        return [a - b for a, b in zip(model, self._measured(), strict=True)]

    def flat(self, parts: list[Floats]) -> Floats:
        """Those that were measured, one after another."""
        known = [np.isfinite(measured) for measured in self._measured()]
        return np.concatenate([part[which] for part, which in zip(parts, known, strict=True)])

    def slopes(self, rest: Rest, keys: Sequence[str]) -> Floats:
        """Derivatives by the numbers at keys, per SI unit, shape (measured, keys)."""
        columns = []
        for key in keys:

            def force(name: str, key: str = key) -> Floats:
                return rest.force_along(key, name)

            def places(name: str, key: str = key) -> Floats:
                return rest.positions_along(key, name)

            columns.append(self.flat(self._flat(force, places)))
        return np.stack(columns, axis=1)

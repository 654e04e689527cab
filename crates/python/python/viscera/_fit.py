"""Stiffness from measurements: the values that explain them best, and how far to trust these.

    minimise  sum_i ((model_i(p) - measured_i)/sigma_i)^2        Gauss-Newton within bounds; exact derivatives at rest
    covariance of the values: (J^T J)^-1, J = d(residuals)/dp at the best

What is fitted is the logarithm of a stiffness or a density, and Poisson's ratio as it is: their errors are nearest to
Gaussian (Aster, Borchers, Thurber, "Parameter Estimation and Inverse Problems", 3rd ed. 2018, chapter 9).
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._errors import SceneError, SimulationError, UnknownKeyError
from ._measurements import Anchors, Comparison, Measurements, mapping
from ._types import Floats
from ._viscera import Rest, Scene, Simulation, rest

# A step of the fitted numbers for finite differences: their error goes with its fourth power.
STEP = 1e-3


class UndeterminedWarning(UserWarning):
    """The data cannot tell some unknowns apart."""


class MisfitWarning(UserWarning):
    """The scene does not explain the data, with any values within the bounds."""


# A chi squared that is larger by chance once in a million times says that the model, sigma or a unit is wrong.
SURELY_NOT = 1e-6


def _is_log(key: str) -> bool:
    return not key.endswith(".poisson")


@dataclass(frozen=True)
class Fit:
    """The values that explain measurements best.

    ``value`` has them by key in SI units and ``std`` their standard deviations. ``covariance`` and ``correlation`` are
    of the fitted numbers, in the order of ``keys``: logarithms of stiffness and density, Poisson's ratio as it is.
    ``residual`` has, for each kind of measurement, what the model says less what was measured in standard deviations,
    NaN at gaps. ``undetermined`` names directions that the data say nothing about, ``at_bound`` the keys that ended at
    a bound.
    """

    keys: tuple[str, ...]
    value: dict[str, float]
    std: dict[str, float]
    covariance: Floats
    correlation: Floats
    residual: dict[str, Floats]
    jacobian: Floats
    undetermined: tuple[str, ...]
    at_bound: tuple[str, ...]
    evaluations: int
    seconds: float
    rest: Rest
    _scene: Scene
    _comparison: Comparison

    @property
    def degrees_of_freedom(self) -> int:
        """Numbers that were measured, less those that were fitted."""
        return len(self.jacobian) - len(self.keys)

    @property
    def chi_squared(self) -> float:
        """The sum of squared residuals: about ``degrees_of_freedom`` where model and sigma are right."""
        return float(sum(np.nansum(part**2) for part in self.residual.values()))

    def _fitted(self, values: Mapping[str, float]) -> Floats:
        try:
            given = np.array([float(values[key]) for key in self.keys])
        except KeyError as missing:
            raise UnknownKeyError(f"there is no value of {missing}") from None
        for key, value in zip(self.keys, given, strict=True):
            if _is_log(key) and not value > 0.0:
                raise SceneError(f"{key} is above zero; this is {value}")
        return _forth(self.keys, given)

    def distance(self, values: Mapping[str, float]) -> float:
        """How far values are from the best ones, in standard deviations of all unknowns together (Mahalanobis)."""
        away = self._fitted(values) - self._fitted(self.value)
        # The covariance is the inverse of this, where it has one.
        return float(np.linalg.norm(self.jacobian @ away))

    def contains(self, values: Mapping[str, float], confidence: float = 0.95) -> bool:
        """Whether values lie in the region of all unknowns together that holds the truth with this probability."""
        return self.distance(values) ** 2 <= _chi_squared_limit(confidence, len(self.keys))

    def interval(self, key: str, confidence: float = 0.95) -> tuple[float, float]:
        """The range of one value, whatever the others are, that holds the truth with this probability."""
        if key not in self.keys:
            raise UnknownKeyError(f"`{key}` was not fitted; there are: {', '.join(self.keys)}")
        at = self.keys.index(key)
        half = np.sqrt(_chi_squared_limit(confidence, 1) * self.covariance[at, at])
        middle = _forth((key,), np.array([self.value[key]]))
        low, high = _back((key, key), np.concatenate([middle - half, middle + half]))
        return float(low), float(high)

    def check_gradient(self) -> float:
        """The largest difference between exact derivatives and differences of fourth order, over the largest one."""
        here = _forth(self.keys, np.array([self.value[key] for key in self.keys]))
        columns = []
        for number in range(len(self.keys)):
            sums = np.zeros(len(self.jacobian))
            for times, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1)):
                there = here.copy()
                there[number] += times * STEP
                found = _rest_at(self._scene, self._comparison, self.keys, there, self.rest, False)
                sums += weight * self._comparison.flat(self._comparison.residuals(found))
            columns.append(sums / (12 * STEP))
        differences = np.stack(columns, axis=1)
        largest = np.abs(differences).max(axis=0)
        return float((np.abs(differences - self.jacobian) / largest).max())

    def plot(self, path: str | None = None) -> Any:
        """Draws residuals over time and, of the first two unknowns, their region; to a file where one is named.

        ``viscera[fit]`` brings Matplotlib, whose figure this returns.
        """
        return _plot(self, path)

    def __repr__(self) -> str:
        """Values with their deviations."""
        parts = [f"{key} = {self.value[key]:.6g} +- {self.std[key]:.2g}" for key in self.keys]
        chi = f"chi squared {self.chi_squared:.1f} of {self.degrees_of_freedom}"
        notes = [*self.undetermined, *(f"{key} at its bound" for key in self.at_bound)]
        return f"<viscera.Fit {'; '.join([*parts, chi, *notes])}>"


def _forth(keys: tuple[str, ...], values: Floats) -> Floats:
    logs = np.array([_is_log(key) for key in keys])
    fitted: Floats = np.where(logs, np.log(np.where(logs, values, 1.0)), values)
    return fitted


def _back(keys: tuple[str, ...], fitted: Floats) -> Floats:
    logs = np.array([_is_log(key) for key in keys])
    # What the data do not determine may be anything.
    with np.errstate(over="ignore"):
        values: Floats = np.where(logs, np.exp(np.where(logs, fitted, 0.0)), fitted)
    return values


def _chi_squared_limit(confidence: float, count: int) -> float:
    from scipy.stats import chi2

    if not 0.0 < confidence < 1.0:
        raise SceneError(f"a confidence lies between 0 and 1; this is {confidence}")
    return float(chi2.ppf(confidence, count))


def _rest_at(
    scene: Scene,
    comparison: Comparison,
    keys: tuple[str, ...],
    fitted: Floats,
    near: Rest | None,
    derivatives: bool,
) -> Rest:
    """The scene at these numbers."""
    changed = scene.copy()
    changed.update(dict(zip(keys, _back(keys, fitted).tolist(), strict=True)))
    unknown = list(keys) if derivatives else []
    times, memory = comparison.data.times, comparison.memory
    return rest(changed, times, unknown=unknown, near=near, memory=memory)


class _Problem:
    """Residuals and their derivatives at fitted numbers; those of the last point are kept."""

    def __init__(self, scene: Scene, comparison: Comparison, keys: tuple[str, ...]) -> None:
        self.scene, self.comparison, self.keys = scene, comparison, keys
        self.at: Floats | None = None
        self.rest: Rest | None = None
        self.evaluations = 0

    def at_point(self, fitted: Floats) -> Rest:
        if self.rest is None or self.at is None or not np.array_equal(self.at, fitted):
            self.rest = _rest_at(self.scene, self.comparison, self.keys, fitted, self.rest, True)
            self.at = fitted.copy()
            self.evaluations += 1
        return self.rest

    def residuals(self, fitted: Floats) -> Floats:
        return self.comparison.flat(self.comparison.residuals(self.at_point(fitted)))

    def slopes(self, fitted: Floats) -> Floats:
        by_values = self.comparison.slopes(self.at_point(fitted), self.keys)
        values = _back(self.keys, fitted)
        by_fitted = np.array(
            [value if _is_log(key) else 1.0 for key, value in zip(self.keys, values, strict=True)]
        )
        slopes: Floats = by_values * by_fitted
        return slopes


def fit(
    scene: Scene,
    data: Measurements,
    unknown: Mapping[str, tuple[float, float]],
    sigma: Mapping[str, float],
    *,
    start: Mapping[str, float] | None = None,
    memory: str = "8 GB",
) -> Fit:
    """Finds the values of unknowns at which a scene at rest explains measurements best.

    ``unknown`` has the least and the largest value in SI units by key: young, poisson and density of materials, the
    stiffness of fixings. ``sigma`` has the standard deviation of what was measured: "force" [N] and "markers" [m]. The
    search begins at ``start``, and in the middle of the bounds of what it does not name. ``memory`` is what states of
    rest may take. ``viscera[fit]`` brings SciPy, which does the search.
    """
    try:
        from scipy.optimize import least_squares
    except ImportError as missing:
        raise ImportError("fit needs SciPy: pip install 'viscera[fit]'") from missing
    begun = time.perf_counter()
    bounds = _bounds(scene, unknown)
    keys = tuple(unknown)
    comparison = _comparison(scene, data, sigma, memory)
    known, _ = data.counts()
    if known < len(keys):
        raise SceneError(f"{known} numbers were measured, fewer than the {len(keys)} unknowns")
    low, high = _forth(keys, bounds[:, 0]), _forth(keys, bounds[:, 1])
    first = (low + high) / 2
    for key, value in mapping("start", start or {}, '{"body.liver.material.young": 5e3}').items():
        if key not in keys:
            raise UnknownKeyError(
                f"start has `{key}`, which is not fitted; there are: {', '.join(keys)}"
            )
        at = keys.index(key)
        if not bounds[at, 0] < float(value) < bounds[at, 1]:
            raise SceneError(f"start has {value} for {key}, which is not within its bounds")
        first[at] = _forth((key,), np.array([float(value)]))[0]
    problem = _Problem(scene, comparison, keys)
    try:
        found = least_squares(
            problem.residuals,
            first,
            jac=problem.slopes,
            bounds=(low, high),
            x_scale=high - low,
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
    except SimulationError as why:
        raise SimulationError(f"{why}; or narrow the bounds of the unknowns") from why
    best = np.asarray(found.x, dtype=np.float64)
    return _result(problem, best, (low, high), begun)


def _result(problem: _Problem, best: Floats, bounds: tuple[Floats, Floats], begun: float) -> Fit:
    keys, (low, high) = problem.keys, bounds
    at_rest, jacobian = problem.at_point(best), problem.slopes(best)
    # In widths of the bounds: what the data leave wider than these they do not determine.
    _, strengths, directions = np.linalg.svd(jacobian * (high - low), full_matrices=False)
    loose = strengths < 1.0
    undetermined = tuple(_told(keys, direction) for direction in directions[loose])
    for told in undetermined:
        warnings.warn(
            f"the data do not determine the unknowns: along {told} of the ranges of the bounds (of logarithms where "
            "they are stiffness or density) they fit as well; measure something else too, or fix one of these",
            UndeterminedWarning,
            stacklevel=3,
        )
    # What the data say nothing about has a deviation of a million of these widths, not one that is no number.
    scaled = directions.T / np.maximum(strengths, 1e-6)
    covariance: Floats = np.outer(high - low, high - low) * (scaled @ scaled.T)
    deviations = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviations, deviations)
    values = _back(keys, best)
    by_fitted = [
        value if _is_log(key) else 1.0 for key, value in zip(keys, values.tolist(), strict=True)
    ]
    margin = 1e-6 * (high - low)
    near = (best - low < margin) | (high - best < margin)
    at_bound = tuple(key for key, is_near in zip(keys, near, strict=True) if is_near)
    parts = problem.comparison.residuals(at_rest)
    _warn_of_misfit(parts, len(jacobian) - len(keys), at_bound)
    return Fit(
        keys=keys,
        value=dict(zip(keys, values.tolist(), strict=True)),
        std=dict(zip(keys, (deviations * by_fitted).tolist(), strict=True)),
        covariance=covariance,
        correlation=correlation,
        residual=dict(zip(problem.comparison.names, parts, strict=True)),
        jacobian=jacobian,
        undetermined=undetermined,
        at_bound=at_bound,
        evaluations=problem.evaluations,
        seconds=time.perf_counter() - begun,
        rest=at_rest,
        _scene=problem.scene,
        _comparison=problem.comparison,
    )


def _warn_of_misfit(parts: list[Floats], freedom: int, at_bound: tuple[str, ...]) -> None:
    total = float(sum(np.nansum(part**2) for part in parts))
    if freedom > 0 and total > _chi_squared_limit(1.0 - SURELY_NOT, freedom):
        ends = f", and {', '.join(at_bound)} ended at a bound" if at_bound else ""
        warnings.warn(
            f"the scene does not explain the data: chi squared is {total:.3g} of {freedom}{ends}; look at units, signs "
            "and sigma, at what holds the tissue, and at Fit.plot",
            MisfitWarning,
            stacklevel=4,
        )
    elif at_bound:
        warnings.warn(
            f"{', '.join(at_bound)} ended at a bound: the best value lies beyond, and deviations are not those of what "
            "is cut off",
            MisfitWarning,
            stacklevel=4,
        )


def _told(keys: tuple[str, ...], direction: Floats) -> str:
    """A direction in words, in widths of the bounds."""
    turned = direction if direction[np.argmax(np.abs(direction))] > 0 else -direction
    return " ".join(
        f"{share:+.2f} of {key}"
        for key, share in zip(keys, turned, strict=True)
        if abs(share) > 0.05
    )


def _bounds(scene: Scene, unknown: Mapping[str, tuple[float, float]]) -> Floats:
    if not mapping("unknown", unknown, '{"body.liver.material.young": (1e3, 50e3)}'):
        raise SceneError("name one unknown at least, with its least and its largest value")
    rows = []
    for key, given in unknown.items():
        try:
            low, high = (float(bound) for bound in given)
        except (TypeError, ValueError):
            raise SceneError(
                f"{key}: give its least and its largest value, as two numbers in SI units"
            ) from None
        least = 0.0 if _is_log(key) else -1.0
        if not (least < low < high < np.inf):
            raise SceneError(
                f"{key}: bounds ascend from above {least:g}; these are {low} and {high}"
            )
        # The scene knows what a key takes, and says so at once.
        for bound in (low, high):
            scene.copy()[key] = bound
        rows.append((low, high))
    return np.array(rows)


def _comparison(
    scene: Scene, data: Measurements, sigma: Mapping[str, float], memory: str
) -> Comparison:
    given = mapping("sigma", sigma, '{"force": 0.02, "markers": 0.5e-3}')
    for what in given:
        if what not in ("force", "markers"):
            raise UnknownKeyError(f'sigma has "force" [N] and "markers" [m]; "{what}" is neither')
    needed = [what for what, known in (("force", data.force), ("markers", data.markers)) if known]
    deviations = {}
    for what in needed:
        try:
            deviations[what] = float(given[what])
        except (KeyError, TypeError, ValueError):
            deviations[what] = np.nan
        if not 0.0 < deviations[what] < np.inf:
            raise SceneError(
                f'sigma["{what}"] is the standard deviation of a measured number in SI units, above zero; '
                f"this is {given.get(what)!r}"
            )
    anchors = {}
    if data.markers:
        bodies = Simulation(scene, device="cpu")
        for name, (places, seen) in data.markers.items():
            anchors[name] = Anchors(bodies, name, places)
            anchors[name].check(name, places, seen)
    return Comparison(data, anchors, deviations, memory)


def _plot(found: Fit, path: str | None) -> Any:
    try:
        from matplotlib.figure import Figure
    except ImportError as missing:
        raise ImportError("plot needs Matplotlib: pip install 'viscera[fit]'") from missing
    pairs = len(found.keys) > 1 and not found.undetermined
    figure = Figure(figsize=(11 if pairs else 6, 4.2), layout="constrained")
    axes = figure.subplots(1, 2 if pairs else 1, squeeze=False)[0]
    left = axes[0]
    times = found.rest.times
    for name, part in found.residual.items():
        flat = part.reshape(len(times), -1)
        spread = np.repeat(times[:, None], flat.shape[1], axis=1)
        left.plot(spread.ravel(), flat.ravel(), ".", alpha=0.6, label=name)
    left.axhspan(-2, 2, color="0.5", alpha=0.15, label="95 % of what chance does")
    left.axhline(0, color="0.3", linewidth=0.8)
    left.set(
        xlabel="time [s]",
        ylabel="model less measurement [standard deviations]",
        title=f"chi squared {found.chi_squared:.1f} of {found.degrees_of_freedom}",
    )
    left.legend(fontsize="small")
    if pairs:
        _ellipse(found, axes[1])
    if path is not None:
        figure.savefig(path)
    return figure


# Of what can be fitted, by the last step of its key.
UNITS = {"young": "Pa", "density": "kg/m^3", "stiffness": "N/m"}


def _with_unit(key: str) -> str:
    unit = UNITS.get(key.rpartition(".")[2])
    return key if unit is None else f"{key} [{unit}]"


def _ellipse(found: Fit, axes: Any) -> None:
    """The region of the first two unknowns, whatever the others are."""
    keys = found.keys[:2]
    middle = np.array([found.value[key] for key in keys])
    root = np.linalg.cholesky(found.covariance[:2, :2])
    angles = np.linspace(0, 2 * np.pi, 200)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    for confidence, style in ((0.95, "-"), (0.5, "--")):
        radius = np.sqrt(_chi_squared_limit(confidence, 2))
        edge = _forth(keys, middle)[:, None] + radius * (root @ circle)
        edges = np.array([_back(keys, point) for point in edge.T])
        axes.plot(*edges.T, style, color="C3", label=f"{100 * confidence:.0f} %")
    axes.plot(*middle, "o", color="C3")
    across, up = (_with_unit(key) for key in keys)
    axes.set(xlabel=across, ylabel=up, title=f"correlation {found.correlation[0, 1]:+.2f}")
    axes.legend(fontsize="small")

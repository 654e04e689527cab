"""Stiffness from measurements."""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viscera as vi
from test_rest import POISSON, YOUNG, drawn

TIMES = [0.1, 0.2, 0.4]
BOUNDS = {YOUNG: (1e3, 50e3), POISSON: (0.3, 0.49)}
SIGMA = {"force": 0.02, "markers": 0.2e-3}
TRUTH = {YOUNG: 10e3, POISSON: 0.43}
DENSITY = "body.block.material.density"


@pytest.fixture(scope="module")
def truth() -> vi.Rest:
    """The block of the true values."""
    return vi.rest(drawn(**TRUTH), TIMES)


def measured(truth: vi.Rest, seed: int | None) -> vi.Measurements:
    """Forces and every seventh vertex, with noise of a seed."""
    force, seen = truth.force("grip"), truth.positions("block")[:, ::7]
    rest = vi.Simulation(drawn())["block"].rest[::7]
    if seed is not None:
        chance = np.random.default_rng(seed)
        force = force + chance.normal(0.0, SIGMA["force"], force.shape)
        seen = seen + chance.normal(0.0, SIGMA["markers"], seen.shape)
    return vi.Measurements(TIMES, force={"grip": force}, markers={"block": (rest, seen)})


def test_what_was_put_in_comes_out(truth: vi.Rest) -> None:
    found = vi.fit(drawn(), measured(truth, None), BOUNDS, SIGMA)
    for key, value in TRUTH.items():
        assert found.value[key] == pytest.approx(value, rel=1e-7)
        assert 0.0 < found.std[key] < 0.1 * value
    deviations = np.sqrt(np.diag(found.covariance))
    assert found.std[YOUNG] == pytest.approx(TRUTH[YOUNG] * deviations[0])
    assert found.std[POISSON] == pytest.approx(deviations[1])
    assert found.chi_squared < 1e-9
    assert found.degrees_of_freedom == 9 + 3 * 3 * len(truth.positions("block")[0, ::7]) - 2
    assert found.check_gradient() < 1e-6
    assert found.undetermined == found.at_bound == ()
    assert found.contains(TRUTH)
    assert not found.contains({**TRUTH, YOUNG: 12e3})
    assert found.correlation[0, 1] == found.correlation[1, 0] < 0.0


def test_the_truth_lies_in_the_region_as_often_as_it_says(truth: vi.Rest) -> None:
    count = int(os.environ.get("VISCERA_TWINS", "20"))
    found = [vi.fit(drawn(), measured(truth, seed), BOUNDS, SIGMA) for seed in range(count)]
    inside = sum(one.contains(TRUTH) for one in found)
    chance = pytest.importorskip("scipy.stats").binom(count, 0.95)
    print(f"{inside} of {count} inside")
    # Wrong by chance once in a thousand times.
    assert chance.ppf(0.0005) <= inside <= chance.ppf(0.9995)
    intervals = [one.interval(YOUNG) for one in found]
    holds = sum(low < TRUTH[YOUNG] < high for low, high in intervals)
    assert holds >= chance.ppf(0.0005)
    spread = np.std([np.log(one.value[YOUNG]) for one in found], ddof=1)
    assert spread == pytest.approx(np.sqrt(found[0].covariance[0, 0]), rel=0.6)
    mean = np.mean([one.chi_squared for one in found]) / found[0].degrees_of_freedom
    assert mean == pytest.approx(1.0, abs=0.15)


def test_the_region_of_the_linearised_problem_holds_what_it_says(truth: vi.Rest) -> None:
    found = vi.fit(drawn(), measured(truth, None), BOUNDS, SIGMA)
    noise = np.random.default_rng(3).normal(size=(3000, len(found.jacobian)))
    logs = noise @ np.linalg.pinv(found.jacobian).T
    fitted = [found.value[YOUNG] * np.exp(logs[:, 0]), found.value[POISSON] + logs[:, 1]]
    inside = [
        found.contains({YOUNG: young, POISSON: poisson})
        for young, poisson in zip(*fitted, strict=True)
    ]
    assert 0.94 <= np.mean(inside) <= 0.96


def test_a_simulation_that_came_to_rest_gives_its_stiffness() -> None:
    scene = drawn(**{**TRUTH, "solver.method": "quasi_newton", "time.duration": "2 s"})
    sim = vi.Simulation(scene, precision="f64")
    sim.advance(scene.frame_count)
    data = vi.Measurements([2.0], force={"grip": sim.force("grip")[None]})
    found = vi.fit(scene, data, {YOUNG: BOUNDS[YOUNG]}, SIGMA)
    assert found.value[YOUNG] == pytest.approx(TRUTH[YOUNG], rel=2e-3)


def test_gaps_are_left_out(truth: vi.Rest) -> None:
    whole = measured(truth, 5)
    (rest, seen), force = whole.markers["block"], whole.force["grip"].copy()
    holed = seen.copy()
    holed[1, 2] = np.nan
    force[0] = np.nan
    data = vi.Measurements(TIMES, force={"grip": force}, markers={"block": (rest, holed)})
    assert data.counts() == (whole.counts()[0] - 6, 6)
    assert "6 gaps" in repr(data)
    found = vi.fit(drawn(), data, BOUNDS, SIGMA)
    assert np.isnan(found.residual["force of grip"][0]).all()
    assert found.degrees_of_freedom == whole.counts()[0] - 6 - 2
    # As if the first time had never been.
    alone = vi.Measurements(TIMES, force={"grip": force})
    later = vi.Measurements(TIMES[1:], force={"grip": force[1:]})
    values = [vi.fit(drawn(), given, BOUNDS, SIGMA).value for given in (alone, later)]
    assert values[0] == pytest.approx(values[1], rel=1e-7)


def test_what_the_data_do_not_tell_is_said(truth: vi.Rest) -> None:
    # Nothing weighs anything: density does nothing, and places of a held body say nothing of its stiffness.
    scene = drawn(**{**TRUTH, "world.gravity": 0.0})
    state = vi.rest(scene, TIMES)
    data = vi.Measurements(TIMES, force={"grip": state.force("grip")})
    with pytest.warns(vi.UndeterminedWarning, match=r"along \+1.00 of body.block.material.density"):
        found = vi.fit(scene, data, {YOUNG: BOUNDS[YOUNG], DENSITY: (500.0, 2000.0)}, SIGMA)
    assert found.value[YOUNG] == pytest.approx(TRUTH[YOUNG], rel=1e-6)
    assert found.std[YOUNG] < 1e3 < 1e6 < found.std[DENSITY]
    assert "density" in found.undetermined[0]
    rest, seen = measured(truth, None).markers["block"]
    places = vi.Measurements(TIMES, markers={"block": (rest, state.positions("block")[:, ::7])})
    with pytest.warns(vi.UndeterminedWarning, match="young"):
        vi.fit(scene, places, {YOUNG: BOUNDS[YOUNG]}, SIGMA)
    assert seen.shape == (3, len(rest), 3)


def test_an_end_at_a_bound_is_said(truth: vi.Rest) -> None:
    with pytest.warns(
        vi.MisfitWarning, match=r"does not explain .* of \d+, and body.block.*at a bound"
    ):
        found = vi.fit(drawn(), measured(truth, 2), {YOUNG: (20e3, 50e3)}, SIGMA)
    assert found.at_bound == (YOUNG,)
    assert found.value[YOUNG] == pytest.approx(20e3, rel=1e-4)
    assert "at its bound" in repr(found)
    assert found.chi_squared > 10 * found.degrees_of_freedom


def test_tables_are_read(truth: vi.Rest, tmp_path: Path) -> None:
    data = measured(truth, 1)
    (rest, seen), force = data.markers["block"], data.force["grip"]
    table, markers = tmp_path / "pull.csv", tmp_path / "markers.csv"
    lines = [
        "t,fx,fy,fz",
        *(",".join(map(repr, map(float, [t, *f]))) for t, f in zip(TIMES, force, strict=True)),
    ]
    lines[1] = f"{TIMES[0]},,,"
    table.write_text("\n".join(lines) + "\n")
    rows = ["t,marker,x,y,z"]
    rows += [f"rest,m{i},{x!r},{y!r},{z!r}" for i, (x, y, z) in enumerate(rest.tolist())]
    for t, places in zip(TIMES, seen.tolist(), strict=True):
        rows += [f"{t},m{i},{x!r},{y!r},{z!r}" for i, (x, y, z) in enumerate(places)]
    markers.write_text("\n".join(rows[:-1]) + "\n")
    read = vi.Measurements.csv(
        table, force={"grip": ["fx", "fy", "fz"]}, markers={"block": markers}
    )
    np.testing.assert_array_equal(read.times, data.times)
    np.testing.assert_array_equal(read.force["grip"][1:], force[1:])
    np.testing.assert_array_equal(read.markers["block"][0], rest)
    np.testing.assert_array_equal(read.markers["block"][1][:2], seen[:2])
    assert read.counts()[1] == 6


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (None, vi.FileError, "pull.csv"),
        ("t,fx,fy\n0.1,1,2\n", vi.UnknownKeyError, "no column `fz`; there are: t, fx, fy"),
        ("t,fx,fy,fz\n0.1,1,two,3\n", vi.SceneError, "line 2: fy is `two`"),
        ("t,fx,fy,fz\n0.1,1\n", vi.SceneError, "line 2: it has not as many fields"),
        ("t,fx,fy,fz\n0.1,1,2,3,4\n", vi.SceneError, "line 2: it has not as many fields"),
        (
            "t,fx,fy,fz\n0.2,1,2,3\n0.1,1,2,3\n",
            vi.SceneError,
            "line 3: t is `0.1`; .*after the one before",
        ),
        ("t,fx,fy,fz\n,1,2,3\n", vi.SceneError, "line 2: t is ``; times are seconds"),
        ("t,fx,fy,fz\n", vi.SceneError, "one at least"),
        ("t,fx,fy,fz\n0.1,,,\n", vi.SceneError, "nothing was measured"),
        ("t,fx,fy,fz\n0.1,1,2,inf\n", vi.SceneError, "infinite"),
    ],
)
def test_damaged_tables_are_told(
    text: str | None, kind: type[Exception], words: str, tmp_path: Path
) -> None:
    table = tmp_path / "pull.csv"
    if text is not None:
        table.write_text(text)
    with pytest.raises(kind, match=words):
        vi.Measurements.csv(table, force={"grip": ["fx", "fy", "fz"]})


def test_markers_that_are_nowhere_are_told(truth: vi.Rest, tmp_path: Path) -> None:
    _, seen = measured(truth, None).markers["block"]
    outside = np.full((1, 3), 0.2)
    data = vi.Measurements(TIMES, markers={"block": (outside, seen[:, :1])})
    with pytest.raises(vi.SceneError, match=r"marker 0 of `block` lies \d+\.\d mm outside"):
        vi.fit(drawn(), data, BOUNDS, SIGMA)
    # A twentieth of the block's diagonal of 45 mm is 2.2 mm: as far out a coarse mesh may leave its skin.
    for out, is_told in ((4e-3, True), (1e-3, False)):
        place = np.array([[-out, 11e-3, 5e-3]])
        data = vi.Measurements(TIMES, markers={"block": (place, np.tile(place, (3, 1, 1)))})
        if is_told:
            with pytest.raises(vi.SceneError, match=r"lies (3\.[5-9]|4\.\d) mm outside"):
                vi.fit(drawn(), data, BOUNDS, SIGMA)
        else:
            # It is taken, and it was not seen where the block is at these times.
            with pytest.warns(vi.MisfitWarning, match="explain"):
                vi.fit(drawn(), data, {YOUNG: BOUNDS[YOUNG]}, {"markers": 1e-6})
    unknown = vi.Measurements(TIMES, markers={"liver": (outside, seen[:, :1])})
    with pytest.raises(vi.UnknownKeyError, match="liver"):
        vi.fit(drawn(), unknown, BOUNDS, SIGMA)
    table, markers = tmp_path / "pull.csv", tmp_path / "markers.csv"
    table.write_text("t,fx,fy,fz\n0.1,1,2,3\n")
    twice = "rest,a,0,0,0\n0.1,a,0,0,0\n"
    for rows, words in [
        ("0.1,a,0,0,0\n", "line 2: .*unloaded"),
        ("rest,a,0,0,0\n0.3,a,0,0,0\n", "line 3: at 0.3 s"),
        (twice + "0.1, a ,0,0,0\n", "line 4: marker `a` is seen at 0.1 s for the second time"),
        (twice + "Rest,a,0,0,0\n", "line 4: marker `a` is unloaded for the second time"),
    ]:
        markers.write_text("t,marker,x,y,z\n" + rows)
        with pytest.raises(vi.SceneError, match=words):
            vi.Measurements.csv(
                table, force={"grip": ["fx", "fy", "fz"]}, markers={"block": markers}
            )


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"unknown": {}}, vi.SceneError, "one unknown"),
        ({"unknown": {YOUNG: (5e3, 1e3)}}, vi.SceneError, "bounds ascend"),
        ({"unknown": {YOUNG: (0.0, 1e3)}}, vi.SceneError, "above 0"),
        ({"unknown": {YOUNG: 5e3}}, vi.SceneError, "two numbers"),
        ({"unknown": {"body.block.material.yong": (1e3, 5e3)}}, vi.UnknownKeyError, "yong"),
        ({"sigma": {"force": 0.02}}, vi.SceneError, r'sigma\["markers"\]'),
        ({"sigma": {**SIGMA, "force": -1.0}}, vi.SceneError, "above zero"),
        ({"sigma": {**SIGMA, "heat": 1.0}}, vi.UnknownKeyError, "heat"),
        ({"sigma": {**SIGMA, "force": "5 mN"}}, vi.SceneError, "this is '5 mN'"),
        ({"sigma": 0.005}, vi.SceneError, "sigma is a dictionary"),
        ({"unknown": [YOUNG]}, vi.SceneError, "unknown is a dictionary"),
        ({"unknown": {POISSON: (0.3, 0.5)}}, vi.SceneError, "at most 0.499"),
        ({"start": {YOUNG: 500.0}}, vi.SceneError, "within its bounds"),
        ({"start": {"young": 5e3}}, vi.UnknownKeyError, "not fitted"),
        ({"memory": "1 kB"}, vi.SimulationError, "memory="),
    ],
)
def test_what_cannot_be_fitted_is_told(
    arguments: dict[str, Any], kind: type[Exception], words: str, truth: vi.Rest
) -> None:
    given: dict[str, Any] = {"unknown": BOUNDS, "sigma": SIGMA, **arguments}
    with pytest.raises(kind, match=words):
        vi.fit(drawn(), measured(truth, None), **given)


def test_millimetres_are_told(truth: vi.Rest) -> None:
    rest, seen = measured(truth, None).markers["block"]
    data = vi.Measurements(TIMES, markers={"block": (rest, 1e3 * seen)})
    with pytest.raises(vi.SceneError, match="not millimetres"):
        vi.fit(drawn(), data, BOUNDS, SIGMA)


def test_forces_of_the_wrong_sign_are_told(truth: vi.Rest) -> None:
    data = vi.Measurements(TIMES, force={"grip": -truth.force("grip")})
    with pytest.warns(vi.MisfitWarning, match="look at units, signs"):
        vi.fit(drawn(), data, {YOUNG: BOUNDS[YOUNG]}, SIGMA)


@pytest.mark.parametrize(
    "given", [{"force": [[1, 2, 3]]}, {"markers": np.zeros((1, 3))}, {"markers": {"block": 1}}]
)
def test_measurements_that_are_no_dictionaries_are_told(given: dict[str, Any]) -> None:
    with pytest.raises(vi.SceneError, match=r"is a dictionary|are a pair"):
        vi.Measurements([0.1], **given)


def test_more_unknowns_than_numbers_are_told() -> None:
    one = [[1.0, np.nan, np.nan]]
    with pytest.raises(vi.SceneError, match="1 numbers were measured"):
        vi.fit(drawn(), vi.Measurements([0.1], force={"grip": one}), BOUNDS, SIGMA)
    with pytest.raises(vi.SceneError, match="shape"):
        vi.Measurements([0.1], force={"grip": [1.0, 2.0]})


def test_results_are_drawn(truth: vi.Rest, tmp_path: Path) -> None:
    found = vi.fit(drawn(), measured(truth, 4), BOUNDS, SIGMA, start=TRUTH)
    with warnings.catch_warnings():
        # Matplotlib's own.
        warnings.simplefilter("ignore", DeprecationWarning)
        found.plot(str(tmp_path / "fit.png"))
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    with pytest.raises(vi.UnknownKeyError, match="not fitted"):
        found.interval(DENSITY)
    with pytest.raises(vi.SceneError, match="between 0 and 1"):
        found.contains(TRUTH, 95.0)
    with pytest.raises(vi.UnknownKeyError, match="poisson"):
        found.contains({YOUNG: 1e4})


def test_missing_scipy_is_named(truth: vi.Rest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(ImportError, match=r"viscera\[fit\]"):
        vi.fit(drawn(), measured(truth, None), BOUNDS, SIGMA)

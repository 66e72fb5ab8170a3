"""The bound of `rv_reducer`: its slopes, its chance and its search against other computations, and its limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.models.loaded_units import modified_geometry
from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.conditional import Asked, estimated_optimum
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.inputs import Beta, Distribution, Normal, Triangular, Uniform
from tolevo.models.rv_reducer.contact.contact import LoadedContact, backlash, turn_angles
from tolevo.models.rv_reducer.contact.geometry import PartErrors
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.rv_reducer.bound import CommonErrorBound, Level, RippleEstimate
from tolevo.problems.settings import Bound, Settings, VariableSetting
from tolevo.units import ARCMIN, UM

INTERFERENCE = {"interference_probability": Bound(high=0.05)}
OTHERS = ("pin_position", "pin_hole_radius", "pin_radius", "pitch", "runout", "eccentricity", "circle_offset", "bore")
PERFECT = {f"{name}_um": VariableSetting(value=0.0) for name in OTHERS} | {"crank_phase_mrad": VariableSetting(value=0)}
GEOMETRIES: tuple[dict[str, Any], ...] = (
    {},
    {"cycloid_teeth": 23, "pins": 24, "discs": 3, "cranks": 3, "reduction_ratio": 73.0, "eccentricity_mm": 1.8,
     "pin_radius_mm": 4.0, "interference": "share_of_turn"},
    {"cycloid_teeth": 11, "pins": 12, "discs": 1, "involute_stage": False, "pin_circle_radius_mm": 50.0,
     "pin_radius_mm": 5.0, "eccentricity_mm": 2.0, "centre_distance_mm": 25.0, "interference": "overlap"},
)  # fmt: skip


def problem_of(parameters: dict[str, Any] | None = None, **settings: Any) -> RvReducer:
    settings = {"limits": INTERFERENCE, **settings}
    return RvReducer(Settings(parameters={"report_units": 1024, **(parameters or {})}, **settings))


def bound_at(problem: RvReducer, backlash_arcmin: float) -> float:
    values = {"backlash_max_arcmin": np.array([backlash_arcmin])}
    return float(problem.cost_bound().least_costs(values, 1)[0])


def laws(law: Distribution, *names: str) -> dict[str, VariableSetting]:
    return {f"{name}_um": VariableSetting(distribution=law) for name in names}


# ---------------------------------------------------------------- slopes


@pytest.mark.parametrize("at", range(3))
def test_slopes_are_the_least_of_the_exact_contact(at: int) -> None:
    """Differences of the backlash by one error at every position of a turn, for several modifications."""
    problem = problem_of(GEOMETRIES[at])
    slopes = {error.variable: error.slope for error in problem.cost_bound()._errors[0]}
    step, least = 0.5, dict.fromkeys(slopes, np.inf)
    for shift_mm in (-0.12, -0.08, -0.04):
        design = problem.model.design(
            dict(zip(problem.names, problem.starts()[0], strict=True)) | {"dr_rp_mm": 0.0, "dr_p_mm": shift_mm}
        )
        contact = LoadedContact(modified_geometry(problem.model.geometry, design), exact=True)
        angles = turn_angles(127, problem.model.geometry.nominal.cycloid_teeth)
        grown = {
            "pin_circle_radius_um": PartErrors(circle_radius=step * UM),
            "equidistance_um": PartErrors(equidistance=step * UM),
            "shift_um": PartErrors(shift=-step * UM),
            "crank_bearing_um": PartErrors(bearing_clearance=0.5 * step * UM),  # c/2 at z = 1
        }
        play = backlash(contact, PartErrors(), angles)
        for name, errors in grown.items():
            growth = (backlash(contact, errors, angles) - play) / ARCMIN / step
            least[name] = min(least[name], float(growth.min()))
    for name, slope in slopes.items():
        exact = 0.996 if name == "shift_um" else 1.0  # where the kernels move a tooth along the radius of its pin
        assert exact * slope < least[name] < 1.02 * slope, name


# ---------------------------------------------------------------- units that can be good


@pytest.mark.parametrize("law", [Uniform(), Normal(1.2, 0.1), Beta(2.0, 2.0), Triangular()])
@pytest.mark.parametrize(("limit", "gap"), [(1.0, 0.0), (0.6, 0.2)])
def test_the_chance_is_that_of_a_count(law: Distribution, limit: float, gap: float) -> None:
    """The mean of uniform parts lies anywhere in the range that their differences leave."""
    of_bearings = law if isinstance(law, Normal) else Uniform()
    variables = laws(law, "pin_circle_radius", "equidistance", "shift") | laws(of_bearings, "crank_bearing")
    bound = problem_of(variables=variables).cost_bound()
    steps = [720, 700, 660, 600]
    level = Level.of(bound._tolerances, bound._grades[2:3], limit, gap)
    count, rng, s = 1_000_000 if isinstance(law, Uniform) else 100_000, np.random.default_rng(8), 0.0
    for tolerance, step in zip(bound._tolerances, steps, strict=True):
        parts = {"pin_circle_radius_um": 1, "equidistance_um": 2, "shift_um": 2, "crank_bearing_um": 4}
        own = of_bearings if tolerance.error.variable == "crank_bearing_um" else law
        z = own.quantile(rng.random((parts[tolerance.error.variable], count))) - own.raw_moments(1)[1]
        mean = z.mean(axis=0)
        if isinstance(own, Uniform):
            mean = 0.5 * (2.0 - np.ptp(z, axis=0)) * rng.uniform(-1.0, 1.0, count)
        s = s + tolerance.error.slope * tolerance.t[step] * mean
    involute = bound._grades[2].involute
    phi_1 = involute.middle + involute.half * bound.problem.model.tightest(rng.normal(size=(3, count)))
    good = float(np.mean((phi_1 <= limit) & (phi_1 + 2.0 * np.abs(s) <= limit + gap)))
    assert 0.05 < good < 0.98
    computed = float(level.share(np.array([[*steps, 0]]))[0])
    assert computed == pytest.approx(good, abs=4.0 * np.sqrt(good * (1.0 - good) / count) + 2e-4)


def test_no_design_has_more_good_units_than_the_theorem_allows() -> None:
    """Units of perfect other parts come close to it: their backlash hardly varies over the turn."""
    problem = problem_of({"report_units": 4096, "positions": 31}, variables=PERFECT)
    bound, rng, missing = problem.cost_bound(), np.random.default_rng(3), []
    for limit in (0.7, 1.0, 1.4):
        for widths in rng.uniform(0.5, 2.5, (3, 4)):
            design = problem.starts()[0]
            for error, width in zip(bound._errors[0], widths, strict=True):
                design[problem.names.index(error.variable)] = width
            tolerances = [steps._replace(t=np.array([w])) for steps, w in zip(bound._tolerances, widths, strict=True)]
            for grade in bound._grades[:3]:
                design[problem.names.index("involute_grade")] = 4 + bound._grades.index(grade)
                level = Level.of(tolerances, [grade], limit, 0.0)
                allowed = float(level.share(np.zeros((1, 5), dtype=int))[0])
                for equidistance in np.linspace(-0.06, -0.01, 5):
                    design[problem.names.index("dr_rp_mm")] = equidistance
                    units = problem.evaluation(design, searching=False)
                    play = units.turn.play
                    within = units.involute.cdf(limit - np.maximum(play.max(axis=0), 0.0))
                    missing.append(allowed - float(np.mean(within * (play.mean(axis=0) >= 0.0))))
    assert min(missing) > -0.004  # the scatter of 4096 units
    assert min(missing) < 0.05


# ---------------------------------------------------------------- with the ripple that a sample shows


SMALL = {"report_units": 4096, "search_units": 256, "positions": 31}


def estimate_of(problem: RvReducer, limit: float) -> RippleEstimate:
    need = problem.cost_bound().estimate({"backlash_max_arcmin": limit})
    assert need is not None
    return need


def test_the_share_with_ripple_is_that_of_a_count_and_has_its_derivatives() -> None:
    problem = problem_of(SMALL)
    need, design, rng = estimate_of(problem, 1.0), problem.starts()[2], np.random.default_rng(4)
    share, slopes = need.share(design)
    units, count = problem.evaluation(design, searching=True), 4000
    play = units.turn.play.astype(float)
    ripple = np.repeat(play.max(axis=0) - play.mean(axis=0), count)
    s = np.zeros(len(ripple))
    for error, parts in zip(need.errors, (1, 2, 2, 4), strict=True):
        z = rng.uniform(-1.0, 1.0, (parts, len(ripple)))
        mean = 0.5 * (2.0 - np.ptp(z, axis=0)) * rng.uniform(-1.0, 1.0, len(ripple))
        s += error.slope * design[problem.names.index(error.variable)] * mean
    phi_1 = units.involute.middle + units.involute.half * problem.model.tightest(rng.normal(size=(3, len(ripple))))
    good = float(np.mean(phi_1 + ripple + 2.0 * np.abs(s) <= 1.0))
    assert 0.2 < good < 0.999
    assert share == pytest.approx(good, abs=4.0 * np.sqrt(good * (1.0 - good) / len(s)) + 2e-4)
    for at, name in enumerate(problem.names):
        step = 1e-3 * max(abs(design[at]), 0.01) if name != "involute_grade" else 0.0
        higher, lower = design.copy(), design.copy()
        higher[at], lower[at] = higher[at] + step, lower[at] - step
        by_difference = (need.share(higher)[0] - need.share(lower)[0]) / (2.0 * step) if step else 0.0
        assert slopes[at] == pytest.approx(by_difference, rel=0.05, abs=2e-4), name  # single precision, and kinks


def test_the_share_with_ripple_lies_between_that_without_and_that_of_a_design() -> None:
    """Of 30 designs near the starts of a search, at any modification, no more units are good than the sample lets."""
    problem = problem_of(SMALL)
    need, rng, room = estimate_of(problem, 1.0), np.random.default_rng(6), []
    for design in problem.starts()[rng.integers(4, size=30)]:
        for name in (v.name for v in problem.free if v.tolerance and not v.integer):
            low, high = problem.interval(name)
            at = problem.names.index(name)
            design[at] = np.clip(design[at] * np.exp(rng.normal(0.0, 0.4)), low, high)
        design[problem.names.index("dr_rp_mm")] += rng.normal(0.0, 0.002)
        units = problem.evaluation(design, searching=False)
        play = units.turn.play
        within = units.involute.cdf(1.0 - np.maximum(play.max(axis=0), 0.0))
        good = float(np.mean(within * (play.mean(axis=0) >= 0.0)))
        room.append(need.share(design, searching=False)[0] - good)
    assert min(room) > -0.01  # the scatter of 4096 units
    assert max(room) > 0.05


@pytest.mark.slow
def test_the_estimate_lies_above_the_bound_and_is_the_least_from_other_starts() -> None:
    """At three levels: 10.9, 14.0 and 7.2 by an independent computation with other positions and units."""
    problem, starts = problem_of({**SMALL, "positions": 61, "search_units": 512}), problem_of().starts()
    for limit, known in ((1.0, 10.90), (0.81, 13.97), (1.48, 7.24)):
        costs = [estimated_optimum(problem, Asked({"backlash_max_arcmin": limit}, start))[0] for start in starts[1:3]]
        np.testing.assert_allclose(costs, known, rtol=0.03)
        assert costs[0] == pytest.approx(costs[1], rel=3e-3)
        assert min(costs) > bound_at(problem, limit) * 1.2


@pytest.mark.parametrize(
    ("parameters", "settings"),
    [
        ({}, {"objectives": ("cost", "backlash_mean_arcmin")}),
        ({"interference": "share_of_turn"}, {}),
        ({}, {"limits": {"interference_share_of_turn": Bound(high=0.05)}}),
    ],
)
def test_no_ripple_is_estimated_where_the_theorem_has_no_use_for_it(
    parameters: dict[str, Any], settings: dict[str, Any]
) -> None:
    problem = problem_of(parameters, **settings)
    assert problem.cost_bound().estimate(dict.fromkeys(problem.objectives, 1.0)) is None
    assert np.all(
        np.isnan(estimated_optimum(problem, Asked(dict.fromkeys(problem.objectives, 1.0), problem.starts()[0])))
    )


# ---------------------------------------------------------------- least costs


def test_the_search_is_as_an_enumeration() -> None:
    """Two tolerances and the grade are free: every pair of steps is tried."""
    fixed = {"shift_um": VariableSetting(value=1.0), "crank_bearing_um": VariableSetting(value=2.0)}
    bound = problem_of(variables=fixed).cost_bound()
    level = Level.of(bound._tolerances, bound._grades, 0.9, 0.0)
    free = np.arange(0, 1025, 8)
    pairs = np.stack(np.meshgrid(free, free, [0], [0], range(len(bound._grades)), indexing="ij"), -1).reshape(-1, 5)
    cost = sum(table[pairs[:, at]] for at, table in enumerate(level.cost))
    least = float(cost[level.share(pairs) >= 0.9473].min())
    assert 0.995 * least < level.least_cost(0.9473) <= least


def test_bounds_rise_as_limits_fall() -> None:
    problem = problem_of()
    costs = [bound_at(problem, limit) for limit in (2.25, 1.48, 1.0, 0.81)]
    np.testing.assert_allclose(costs, [4.226, 4.893, 5.935, 6.795], rtol=0.005)  # by SLSQP on the same condition
    tighter = problem_of(limits={"interference_probability": Bound(high=0.01)})
    assert bound_at(tighter, 1.0) > costs[2]
    assert bound_at(problem, 0.3) == np.inf


@pytest.mark.parametrize("at", range(3))
def test_no_allocation_costs_less_than_its_bound(at: int) -> None:
    """Random designs and such near the starts of a search, at their own backlash and interference on fresh units."""
    objectives = ("cost", "backlash_max_arcmin", "interference_probability")
    problem = problem_of({**GEOMETRIES[at], "positions": 31}, objectives=objectives, limits={})
    rng, free = np.random.default_rng(at), [problem.names.index(v.name) for v in problem.free]
    near = problem.starts()[rng.integers(4, size=20)][:, free] * np.exp(rng.normal(0.0, 0.3, (20, problem.n_var)))
    x = np.vstack([problem.xl + (problem.xu - problem.xl) * rng.random((10, problem.n_var)) ** 3, near])
    values = problem.needed(problem.complete(np.clip(x, problem.xl, problem.xu)))
    proven = proof(problem, {name: values[name] for name in objectives}, len(x))
    assert np.all(proven.bound < values["cost"]) and np.all(proven.bound > 0.0)
    assert np.max(proven.bound / values["cost"]) > 0.3


def test_other_limits_on_backlash_and_interference_have_bounds() -> None:
    kept = {"backlash_max_arcmin": 1.0, "backlash_mean_arcmin": 1.0}
    missed = {"interference_probability": 0.05, "interference_share_of_turn": 0.05, "overlap_p95_arcmin": 0.1}
    of = {
        (k, m): problem_of(objectives=("cost",), limits={k: Bound(high=a), m: Bound(high=b)}).cost_bound()
        for k, a in kept.items()
        for m, b in missed.items()
    }
    costs = {pair: float(bound.least_costs({}, 1)[0]) for pair, bound in of.items() if not bound.missing}
    assert set(of) - set(costs) == {("backlash_mean_arcmin", "interference_share_of_turn")}
    plain = costs["backlash_max_arcmin", "interference_probability"]
    assert costs["backlash_max_arcmin", "interference_share_of_turn"] == plain
    assert costs["backlash_mean_arcmin", "overlap_p95_arcmin"] < plain  # an overlap leaves more room
    yields = {"yield_percent": Bound(low=99.73), **INTERFERENCE}
    assert problem_of(objectives=("cost",), limits=yields).cost_bound().least_costs({}, 1)[0] == pytest.approx(plain)


def test_laws_that_the_theorem_does_not_cover_are_not_counted() -> None:
    skewed = problem_of(variables=laws(Triangular(0.5), "shift"))
    several = problem_of(variables=laws(Triangular(), "crank_bearing"))
    common = problem_of({"share_discs": 0.5})
    for problem, names in ((skewed, "shift_um"), (several, "crank_bearing_um"), (common, "equidistance_um, shift_um")):
        assert f"not counted, for their laws: {names}" in problem.cost_bound().statement
        assert bound_at(problem, 1.0) < bound_at(problem_of(), 1.0)
    alike = problem_of({"share_discs": 1.0})  # one error in place of two spreads more
    assert bound_at(alike, 1.0) > bound_at(problem_of(), 1.0)


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            '[[effect]]\nname = "process_mean_shift"\nparameters = { shift_arcmin = 0.1 }',
            "effects change the backlash outside",
        ),
        ("[[variables.shift_um.machine]]\nname = 'a'\nsigma = 0.4\nprice = 1.0", "machines make tolerances (shift_um)"),
        ('[parameters]\ninterference = "preload"', "interference that is counted without load"),
    ],
)
def test_what_has_no_bound_says_why(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "c.toml"
    path.write_text(f'problem = "rv_reducer"\n{text}\n[limits]\ninterference_probability = 0.05\n', encoding="utf-8")
    problem = read(path).problem
    assert isinstance(problem, RvReducer)
    found = proof(problem, {"cost": np.array([9.0]), "backlash_max_arcmin": np.array([1.0])}, 1)
    assert np.isnan(found.bound).all()
    assert why in found.statement


def test_limits_that_no_design_keeps_are_refused_with_the_least_value(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    text = 'problem = "rv_reducer"\n[limits]\ninterference_probability = 0.05\nbacklash_max_arcmin = {}\n{}'
    for limit, cost, expected in (
        (0.3, "", "limits.backlash_max_arcmin: cannot be kept together with limits.interference_probability, by the"),
        (0.31, "", "so many units with the tightest tolerances need 0.3163 arcmin at least"),
        (1.0, "cost = 5.8", "limits.cost: at most 5.8 cannot be kept with the other limits, within which the least"),
    ):
        path.write_text(text.format(limit, cost), encoding="utf-8")
        with pytest.raises(InputError, match=expected.replace(".", r"\.")):
            read(path)
    assert not CommonErrorBound(problem_of(limits={**INTERFERENCE, "backlash_max_arcmin": Bound(high=0.32)})).faults()

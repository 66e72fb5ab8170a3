"""Every integral over a law against a count of units, and its gradient against differences.

For every distribution that can be stated, on every error at once. The counts draw what the
integrals leave out; the seeds are fixed, and four standard errors are allowed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from tolevo.models.inputs import (
    DISTRIBUTIONS,
    Beta,
    Distribution,
    Empirical,
    Exponential,
    LogNormal,
    Mixture,
    Normal,
    Rayleigh,
    SkewNormal,
    Trapezoid,
    Triangular,
    TruncatedNormal,
    Uniform,
)
from tolevo.models.rv_reducer.population.contact import Population
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.rv_reducer.declared import MEASURES
from tolevo.problems.rv_transmission_error import RvTransmissionError
from tolevo.problems.settings import Settings, VariableSetting
from tolevo.units import ARCMIN, ARCSEC

LAWS: dict[str, Distribution] = {
    "uniform": Uniform(),
    "triangular": Triangular(-0.4),
    "trapezoidal": Trapezoid(0.6),
    "normal": Normal(),
    "normal, off centre and wider than the zone": Normal(0.8, 0.2),
    "truncated_normal": TruncatedNormal(0.7, -0.3),
    "skew_normal": SkewNormal(4.0),
    "beta": Beta(2.0, 5.0),
    "beta with poles": Beta(0.4, 0.6),
    "mixture": Mixture((-0.4, 0.3), (0.2, 0.15), (0.7, 0.3)),
    "rayleigh": Rayleigh(),
    "exponential": Exponential(),
    "lognormal": LogNormal(0.5),
    "empirical": Empirical((-0.9, -0.5, -0.4, -0.1, 0.0, 0.1, 0.15, 0.4, 0.6, 1.1)),
    "empirical with atoms": Empirical((-1.0, -1.0, -0.5, 0.0, 0.0, 0.0, 0.5, 0.5, 1.0)),
}
SLOW = "mixture", "beta with poles", "skew_normal", "beta"
"""Laws of rigid units that `make test-long` alone counts: of the like of others, and slow."""
MOST = 4.0
"""Standard errors allowed."""
POSITIONS = 11
DESIGN = {
    "pin_circle_radius_um": 3.0,
    "pin_position_um": 2.94,
    "pin_hole_radius_um": 2.38,
    "pin_radius_um": 1.53,
    "pitch_um": 5.4,
    "runout_um": 3.1,
    "eccentricity_um": 2.6,
    "equidistance_um": 0.75,
    "shift_um": 1.01,
    "crank_bearing_um": 2.4,
    "involute_grade": 5.0,
    "stagger_arcmin": 0.0,
    "dr_rp_mm": -0.0371,
    "dr_p_mm": -0.0673,
    "circle_offset_um": 3.0,
    "bore_um": 2.0,
    "crank_phase_mrad": 1.54,
}


def reducer(law: Distribution, **parameters: float) -> RvReducer:
    errors = [variable.name for variable in RvReducer.declaration.variables if variable.random]
    small: dict[str, float] = {"search_units": 2048, "search_positions": POSITIONS, "share_pins": 0.3}
    return RvReducer(Settings(
        variables={name: VariableSetting(distribution=law) for name in errors}, parameters=small | parameters
    ))  # fmt: skip


def test_every_distribution_that_can_be_stated_is_tried() -> None:
    assert {type(law) for law in LAWS.values()} == set(DISTRIBUTIONS.sound().values())


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in LAWS]
)
def test_every_statistic_of_rigid_units_is_that_of_a_count(name: str) -> None:
    law, units = LAWS[name], 2**15
    problem = reducer(law)
    rng, design = np.random.default_rng(7), problem.model.design(DESIGN)
    drawn = Population.draw(problem.model.geometry, POSITIONS, units, rng, problem.model.hierarchy)
    turn = drawn.turn(design)
    measures, play = problem.model.measures(turn), turn.play.astype(float)
    involute, score = problem.model.involute(5.0), rng.standard_normal((3, units))
    clearances = law.quantile(ndtr(np.sqrt(0.5) * (score[0] + score[1:])))
    backlash = involute.middle + involute.half * clearances.min(axis=0) + np.maximum(play, 0.0)
    by_unit = {"max": backlash.max(axis=0), "mean": backlash.mean(axis=0)}
    overlap = np.maximum(-play.min(axis=0), 0.0)
    counts = {
        "yield": by_unit["max"] <= 1.0,
        "interference": play.mean(axis=0) < 0.0,
        "interference share_of_turn": np.mean(play < 0.0, axis=0),
        "interference overlap": overlap > problem.model.conditions.overlap,
        "rms": backlash**2,
    }
    for what, values in by_unit.items():
        counts[f"quantile {what}"] = values <= measures[f"quantile {what}"].statistic.value
        counts[f"mean {what}"] = values
        counts[f"deviation {what}"] = (values - values.mean()) ** 2
    values = {measure: measures[measure].statistic.value for measure in (*MEASURES.values(), "interference overlap")}
    values |= dict.fromkeys(("quantile max", "quantile mean"), problem.model.conditions.coverage)
    for measure, count in counts.items():
        value = values[measure] ** (2 if measure.partition(" ")[0] in ("rms", "deviation") else 1)
        error = np.std(count) / np.sqrt(units) + 2.0 / units
        if measure.startswith("mean"):
            error *= 0.75  # the units themselves are the same
        assert abs(value - np.mean(count)) < MOST * error, (measure, value, np.mean(count))
    if values["overlap"] > 0.0:
        assert np.mean(overlap <= values["overlap"]) == pytest.approx(0.95, abs=0.001)


@pytest.mark.parametrize("name", LAWS)
def test_gradients_of_the_integrals_are_differences(name: str) -> None:
    """Kinks, and the steps of a law of few values, are within 6 % on 2048 units."""
    outputs = ("interference_probability", "interference_share_of_turn", "yield_percent", "backlash_max_arcmin")
    problem = reducer(LAWS[name])
    row = np.array([DESIGN[variable] for variable in problem.names])
    evaluation = problem.evaluation(row, searching=True)
    for variable, step in (("pin_circle_radius_um", 0.03), ("equidistance_um", 0.02), ("involute_grade", 0.05)):
        moved = np.array([row, row])
        moved[:, problem.names.index(variable)] += (-step, step)
        ends = [problem.evaluation(one, searching=True) for one in moved]
        for output in outputs:
            slope = (ends[1].value(output) - ends[0].value(output)) / (2.0 * step)
            found, least = evaluation.gradient(output)[variable], {"yield_percent": 0.4, "backlash_max_arcmin": 0.007}
            assert found == pytest.approx(slope, rel=0.06, abs=least.get(output, 0.004)), output


def test_growth_with_the_pin_circle_is_that_of_the_contacts_that_touch() -> None:
    """A difference of the backlash itself; the constant that stood for it was 2.5 % too small."""
    problem = reducer(Uniform())
    drawn, design = problem.populations(searching=True).rigid, problem.model.design(DESIGN)
    step = 1e-3
    wider, narrower = (
        drawn.turn(replace(design, mid={**design.mid, "pin_circle_radius": design.middle("pin_circle_radius") + by}))
        for by in (step, -step)
    )
    slope = (wider.play.astype(float) - narrower.play) / (2.0 * step)
    found = drawn.turn(design).by_circle
    assert np.quantile(np.abs(found - slope), 0.99) < 2e-3  # float32, and a kink here and there
    assert found.mean() == pytest.approx(slope.mean(), rel=1e-3)


@pytest.mark.parametrize(
    "name", ["uniform", "triangular", "trapezoidal", "truncated_normal", "normal", "beta", "empirical"]
)
def test_transmission_error_and_force_are_those_of_a_count(name: str) -> None:
    """Centred laws; document A's tolerances at Q = 5. The normal law, for any, was 12 % off for uniform errors."""
    centred = {"triangular": Triangular(), "truncated_normal": TruncatedNormal(0.7), "beta": Beta(0.5, 0.5),
               "empirical": Empirical((-1.0, -0.4, -0.3, 0.0, 0.3, 0.4, 1.0))}  # fmt: skip
    law, units = centred.get(name, LAWS[name]), 2**18
    errors = [v.name for v in RvTransmissionError.declaration.variables if v.random]
    problem = RvTransmissionError(Settings(variables={e: VariableSetting(distribution=law) for e in errors}))
    row = problem.references()["document A, Q = 5"][None]
    out, rng = problem.outputs_of(row, errors=False), np.random.default_rng(2)
    spread = problem.residual(row).spread[0]
    deviation = np.sqrt(law.raw_moments(2)[2])
    parts = law.quantile(rng.random((units, len(errors)))) / deviation
    noise = rng.standard_normal((units, spread.shape[1] - len(errors)))
    angles = np.hstack([parts, noise]) @ spread.T
    for values, stated in ((problem.influence.amplitude(angles) / ARCSEC, out["te_amplitude_arcsec"][0]),
                           (problem.influence.peak_force(angles), out["peak_mesh_force_N"][0])):  # fmt: skip
        error = np.sqrt(0.9973 * 0.0027 * (1.0 / units + 1.0 / 65_536))
        assert abs(np.mean(values <= stated) - 0.9973) < MOST * error
    assert bool(problem.unproven()) == (name != "normal")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "mixture" else []) for name in LAWS]
)
def test_every_statistic_of_the_closed_form_is_that_of_a_count(name: str) -> None:
    law, units = LAWS[name], 2**18
    errors = [v.name for v in RvBacklash.declaration.variables if v.random]
    problem = RvBacklash(Settings(variables={error: VariableSetting(distribution=law) for error in errors}))
    known = [DESIGN[variable] for variable in problem.names]
    row = np.array([known])
    out, total, rng = problem.outputs_of(row), problem.total(row), np.random.default_rng(3)

    def drawn(linear: float, quadratic: float, constant: float, z: np.ndarray) -> np.ndarray:
        return np.asarray((constant + linear * z + quadratic * z**2) / ARCMIN)

    sums = []
    for terms in (total.clipped, total.free):
        summed = np.zeros(units)
        for term in terms:
            z = law.quantile(rng.random((2, units)) if term is total.free[0] else rng.random(units))
            if term is total.free[0]:  # the tighter of two planets with half of their variance in common
                score = rng.standard_normal((3, units))
                z = law.quantile(ndtr(np.sqrt(0.5) * (score[0] + score[1:]))).min(axis=0)
            bend = 0.0 if term.quadratic is None else float(term.quadratic[0])
            summed += drawn(float(term.linear[0]), bend, float(term.constant[0]), z)
        sums.append(summed)
    backlash = np.maximum(sums[0], 0.0) + sums[1]
    counts = {
        "interference_probability": np.asarray(sums[0] < 0.0, dtype=float),
        "yield_percent": np.where(backlash <= problem.limit, 100.0, 0.0),
        "backlash_mean_arcmin": backlash,
    }
    for output, count in counts.items():
        error = np.std(count) / np.sqrt(units) + 2.0 / units
        assert abs(float(out[output][0]) - np.mean(count)) < MOST * error, output
    below = np.mean(backlash <= out["backlash_arcmin"][0])
    assert abs(below - 0.9973) < MOST * np.sqrt(0.9973 * 0.0027 / units)
    assert float(out["backlash_std_arcmin"][0]) == pytest.approx(backlash.std(), rel=0.006)

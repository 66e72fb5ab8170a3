"""`rv_transmission_error`: the contract, propagation, document A's allocation, faults."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize

from tolevo.algorithms.archive import nondominated
from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.gde3 import GDE3
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.models.assembly.assemble import assemble
from tolevo.models.inputs import Normal, Uniform
from tolevo.problems.forms import Form
from tolevo.problems.rv_transmission_error import RvTransmissionError, declared
from tolevo.problems.rv_transmission_error import form as implied
from tolevo.problems.rv_transmission_error.form import least_ratio
from tolevo.problems.settings import Bound, PropagationSetting, Settings, VariableSetting
from tolevo.section import Value
from tolevo.testing import ProblemContract
from tolevo.units import ARCSEC, MRAD

pytestmark = pytest.mark.long

Array = NDArray[np.float64]
DOCUMENT = np.array(list(declared.DOCUMENT_MRAD.values()))


@cache
def plain() -> RvTransmissionError:
    return RvTransmissionError(Settings(propagation=PropagationSetting(samples=4096)))


def design(precision: float = 0.0, scale: float = 1.0) -> Array:
    return np.array([[*(scale * DOCUMENT), precision]])


def searched(problem: RvTransmissionError, *designs: Array) -> dict[str, Array]:
    return problem.outputs_of(np.vstack(designs), searching=True)


class TestRvTransmissionError(ProblemContract):
    problem_type = RvTransmissionError

    def problem(self) -> RvTransmissionError:
        return plain()


def test_names_are_those_of_the_contract() -> None:
    problem = plain()
    assert problem.names == [
        f"{part}_{axis}_mrad" for part in ("crankshaft_1", "gear_1", "crankshaft_2", "gear_2") for axis in "xyz"
    ] + ["precision_weight"]
    outputs = {one.name for one in problem.outputs}
    assert outputs >= {"cost", "adjustment_effort", "te_amplitude_arcsec", "peak_mesh_force_N"}
    assert outputs >= {f"kc_{k}_{a}_std_mrad" for k in (1, 2, 3, 4) for a in "xyz"}


# ---------------------------------------------------------------- propagation


def test_angles_without_adjustment_add_in_squares() -> None:
    """sigma = t/3; KC2 carries crankshaft 1 and gear 1, KC4 crankshaft 2 and gear 2."""
    found = searched(plain(), design())
    sigma = DOCUMENT.reshape(4, 3) / 3.0
    for axis, name in enumerate("xyz"):
        crank_1, gear_1, crank_2, gear_2 = sigma[:, axis]
        expected = (crank_1, np.hypot(crank_1, gear_1), crank_2, np.hypot(crank_2, gear_2))
        each = [found[f"kc_{at}_{name}_std_mrad"][0] for at in (1, 2, 3, 4)]
        np.testing.assert_allclose(each, expected, rtol=1e-12)
    assert found["adjustment_effort"][0] == 0.0


GENERAL: dict[str, Value] = {
    "transition_2": (1.0, 0.2, 0.0, 0.0, 0.0, 0.8, 0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.3, 0.0, 0.0, 1.0),
    "transition_4": (0.9, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.4, 0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 0.2, 1.0),
    "error_flow": (1.0, 0.0, 0.0, 0.1, 0.5, 1.0, 0.0, 0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0, 0.7, 1.0),
    "final_weights": (2.0, 0.0, 1.0, 3.0),
}
"""A(k), F and the diagonal of Q that follow from no datum flow chain."""


def test_general_matrices_against_single_assemblies() -> None:
    """Final angles about z of each part's error alone, taken through the steps one by one."""
    problem = RvTransmissionError(Settings(parameters=GENERAL))
    control = problem._gains(np.array([5.0]))[0]
    a = [np.array(GENERAL.get(f"transition_{k}", np.eye(4).ravel())).reshape(4, 4) for k in range(1, 5)]
    f = np.array(GENERAL["error_flow"]).reshape(4, 4)
    b = np.array([[1.0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]])
    variance = np.zeros(4)
    for part in range(4):
        x = np.zeros(4)
        for k in range(4):
            x = (a[k] - b @ control[k, 2::3, 2::3]) @ x + f[:, part] * (part == k)
        variance += (x * DOCUMENT[3 * part + 2] / 3.0) ** 2
    found = searched(problem, design(5.0))
    std = [found[f"kc_{at}_z_std_mrad"][0] for at in (1, 2, 3, 4)]
    np.testing.assert_allclose(std, np.sqrt(variance), rtol=1e-10)


@pytest.mark.parametrize(
    "parameters", [{}, {"insertion": "after", "reading": "consistent"}, {"springback": 0.3}, GENERAL]
)
def test_spread_and_effort_against_drawn_assemblies(parameters: dict[str, Value]) -> None:
    """50,000 assemblies drawn step by step, within 5 standard errors."""
    problem, count = RvTransmissionError(Settings(parameters=parameters)), 50_000
    given = problem.settings.parameters
    rng = np.random.default_rng(0)
    errors = DOCUMENT / 3.0 * MRAD * rng.standard_normal((count, 12))
    control = problem._gains(np.array([5.0]))[0]
    drawn = assemble(problem.process, control, errors, str(given["insertion"]), declared.departures(given))
    found = searched(problem, design(5.0))
    std = [found[f"kc_{at}_{a}_std_mrad"][0] for at in (1, 2, 3, 4) for a in "xyz"]
    rtol = 5.0 / np.sqrt(2.0 * count)
    np.testing.assert_allclose(drawn.state.std(axis=0) / MRAD, std, rtol=rtol)
    effort = drawn.effort(problem.process) / MRAD**2
    error = 5.0 * effort.std() / np.sqrt(count)
    assert found["adjustment_effort"][0] == pytest.approx(effort.mean(), abs=error)


def test_quantiles_against_the_full_model_of_drawn_units() -> None:
    """1500 units of document A's allocation, adjusted with Q = 5, through the loaded contact.

    Nothing of the influence coefficients or of the quantile's formula enters; at 95 % coverage the
    sample quantile is known to about 3 %.
    """
    setting = Settings(propagation=PropagationSetting(coverage=0.95, samples=4096))
    problem = RvTransmissionError(setting)
    rng = np.random.default_rng(1)
    errors = DOCUMENT / 3.0 * MRAD * rng.standard_normal((1500, 12))
    state = assemble(problem.process, problem._gains(np.array([5.0]))[0], errors).state
    full = declared.transmission(problem.settings.parameters)
    turned = full.turn(state.reshape(-1, 4, 3))
    found = problem.outputs_of(design(5.0))
    te, force = (np.quantile(v, 0.95) for v in (full.amplitude(turned) / ARCSEC, full.peak(turned)))
    assert found["te_amplitude_arcsec"][0] == pytest.approx(te, rel=0.04)
    assert found["peak_mesh_force_N"][0] == pytest.approx(force, rel=0.02)
    corrected = found["peak_mesh_force_N"][0] / (1.0 + found["force_error_percent"][0] / 100.0)
    assert corrected == pytest.approx(force, rel=0.015)


def test_stated_error_is_zero_where_the_coefficients_are_exact() -> None:
    """Tiny angles: the full model is linear there but for the ripple of the pins."""
    found = plain().outputs_of(design(0.0, 0.02))
    assert abs(found["force_error_percent"][0]) < 0.5
    wide = plain().outputs_of(design(0.0, 2.5))
    assert found["te_amplitude_arcsec"][0] < wide["te_amplitude_arcsec"][0]
    assert abs(wide["force_error_percent"][0]) > 2.0, "beyond the linear range it is said"


def test_uniform_parts_spread_more() -> None:
    """Standard deviation t/sqrt(3) in place of t/3."""
    settings = {name: VariableSetting(distribution=Uniform()) for name in declared.DOCUMENT_MRAD}
    wide = searched(RvTransmissionError(Settings(variables=settings)), design())
    normal = searched(plain(), design())
    assert wide["kc_2_x_std_mrad"] == pytest.approx(normal["kc_2_x_std_mrad"] * np.sqrt(3.0))


def test_search_and_report_agree() -> None:
    rows = (design(), design(5.0), design(10.0, 0.5))
    problem = RvTransmissionError(Settings(objectives=("cost", "peak_mesh_force_N")))
    coarse = searched(problem, *rows)
    fine = problem.outputs_of(np.vstack(rows))
    np.testing.assert_allclose(coarse["peak_mesh_force_N"], fine["peak_mesh_force_N"], rtol=0.01)
    np.testing.assert_array_equal(coarse["te_amplitude_arcsec"], fine["te_amplitude_arcsec"])


# ---------------------------------------------------------------- tightening against adjusting


def test_tolerances_may_open_with_adjustment() -> None:
    """With Q = 5 tolerances twice as wide are about as accurate, at half the variable cost."""
    found = searched(plain(), design(0.0), design(5.0, 2.0))
    assert found["cost"][1] == pytest.approx(0.5 * found["cost"][0])
    assert found["te_amplitude_arcsec"][1] < found["te_amplitude_arcsec"][0]
    assert found["adjustment_effort"][1] > 0.0


def test_outputs_move_with_the_precision_weight() -> None:
    found = searched(plain(), *(design(q) for q in (0.0, 2.0, 5.0, 10.0, 30.0)))
    assert np.all(np.diff(found["te_amplitude_arcsec"]) < 0.0)
    assert np.all(np.diff(found["peak_mesh_force_N"]) < 0.0)
    assert np.all(np.diff(found["adjustment_effort"]) > 0.0)
    assert np.ptp(found["cost"]) == 0.0


def test_measurement_noise_costs_accuracy() -> None:
    noisy = Settings(parameters={"measurement_std_mrad": 0.3, "insertion": "after"})
    exact = Settings(parameters={"insertion": "after"})
    te = [searched(RvTransmissionError(one), design(10.0))["te_amplitude_arcsec"][0]
          for one in (exact, noisy)]  # fmt: skip
    assert te[1] > 1.1 * te[0]


# ---------------------------------------------------------------- document A


def test_references_are_the_printed_tolerances() -> None:
    printed = plain().references()
    assert list(printed) == [f"document A, Q = {q}" for q in (0, 5, 10)]
    table = printed["document A, Q = 5"][:12].reshape(4, 3)
    np.testing.assert_array_equal(
        table, [[1.71, 1.66, 1.69], [2.63, 2.62, 2.62], [1.54, 1.52, 1.52], [1.26, 1.26, 1.26]]
    )


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("composite", implied.COMPOSITES)
def test_implied_costs_give_the_printed_allocation_back(composite: str, exponent: float) -> None:
    """By the closed form, and by SLSQP from equal tolerances."""
    influence = implied.sensitivities(composite)
    costs = implied.implied_costs(DOCUMENT, influence, exponent)
    limit = float(np.linalg.norm(influence * DOCUMENT))
    forward = implied.optimal_allocation(costs, influence, limit, exponent)
    np.testing.assert_allclose(forward, DOCUMENT, rtol=1e-12)
    solve: Any = minimize  # its annotations know no analytic derivatives of a constraint
    found = solve(
        lambda x: np.sum(costs * np.exp(-exponent * x)),
        np.zeros(12),
        jac=lambda x: -exponent * costs * np.exp(-exponent * x),
        constraints={
            "type": "ineq",
            "fun": lambda x: 1.0 - np.sum((influence * np.exp(x) / limit) ** 2),
            "jac": lambda x: -2.0 * (influence * np.exp(x) / limit) ** 2,
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    np.testing.assert_allclose(np.exp(found.x), DOCUMENT, rtol=1e-4)


@pytest.mark.parametrize(("composite", "ratio"), [("sum", 0.63), ("rss", 0.794)])
def test_allocation_at_least_cost_within_the_composite_error(composite: str, ratio: float) -> None:
    """The proven optimum of the problem is Lagrange's, and crankshafts are to gears as the physics note says."""
    name, influence = f"kc_{composite}_std_mrad", implied.sensitivities(composite)
    own = searched(plain(), design())[name][0]
    assert own == pytest.approx(np.linalg.norm(influence * DOCUMENT) / 3.0, rel=1e-12)
    problem = RvTransmissionError(Settings(
        variables={"precision_weight": VariableSetting(value=0.0)}, objectives=("cost",), limits={name: Bound(high=own)}
    ))  # fmt: skip
    form = problem.form()
    assert form is not None and name in form.outputs
    assert not any("as wide as" in text for text in problem.warnings())
    found = problem.complete(search(problem, Exact(), Budget(), 0).chosen)[0, :12]
    wanted = implied.optimal_allocation(np.ones(12), influence, 3.0 * float(own))
    np.testing.assert_allclose(found, wanted, rtol=1e-5)
    assert found[0] / found[3] == pytest.approx(ratio, abs=0.003)


def test_composite_errors_of_drawn_assemblies() -> None:
    """Sum of the four angles about each axis, and all twelve, of 50,000 adjusted assemblies."""
    problem = RvTransmissionError(Settings(parameters=GENERAL))
    errors = DOCUMENT / 3.0 * MRAD * np.random.default_rng(4).standard_normal((50_000, 12))
    state = assemble(problem.process, problem._gains(np.array([5.0]))[0], errors).state / MRAD
    found = searched(problem, design(5.0))
    wanted = np.sqrt(state.reshape(-1, 4, 3).sum(axis=1).var(axis=0).sum()), np.sqrt(state.var(axis=0).sum())
    np.testing.assert_allclose([found[f"kc_{c}_std_mrad"][0] for c in ("sum", "rss")], wanted, rtol=0.01)


def test_implied_costs_of_gear_2_are_the_lowest() -> None:
    """The tightest part of the table would have to be the cheapest, several times over."""
    for composite in implied.COMPOSITES:
        costs = implied.implied_costs(DOCUMENT, implied.sensitivities(composite)).reshape(4, 3)
        assert np.all(costs[3] < costs[:3] / 3.0)


def test_least_cost_is_asked_at_the_documents_accuracy() -> None:
    label, problem = plain().least_cost()
    own = searched(plain(), design())["te_amplitude_arcsec"][0]
    assert problem.objectives == ("cost",)
    assert problem.settings.limits["te_amplitude_arcsec"] == Bound(high=own)
    assert problem.fixed == {"precision_weight": 0.0}
    assert "without adjustment" in label


# ---------------------------------------------------------------- faults and warnings


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        (Settings(parameters={"adjustment_weights_2": (10.0, 5.0, 5.0, 1000.0)}),
         "parameters.adjustment_weights_2[2]"),
        (Settings(parameters={"hangs_on": (0.0, 2.0, 0.0, 3.0)}), "parameters.hangs_on[1]"),
        (Settings(parameters={"transition_3": (1.0, 0.0)}), "parameters.transition_3"),
        (Settings(parameters={"final_weights": (0.0, 0.0, 0.0, 0.0)}), "parameters.final_weights"),
        (Settings(variables={"gear_1_x_mrad": VariableSetting(distribution=Normal(shift=0.2))}),
         "variables.gear_1_x_mrad.distribution"),
        (Settings(limits={"te_amplitude_arcsec": Bound(high=0.01)}), "limits.te_amplitude_arcsec"),
        (Settings(limits={"cost": Bound(high=0.1)}), "limits.cost"),
    ],
)  # fmt: skip
def test_faults(settings: Settings, place: str) -> None:
    found = RvTransmissionError(settings).faults()
    assert [fault.place for fault in found] == [place]


def test_warnings() -> None:
    limits = {"peak_mesh_force_N": Bound(high=2500.0)}
    bought = Settings(objectives=("cost", "te_amplitude_arcsec"), limits=limits)
    assert "adjustment" in RvTransmissionError(bought).warnings()[0]
    assert "peak_mesh_force_N is neither" in plain().warnings()[0]
    sound = Settings(limits=limits)
    assert RvTransmissionError(sound).warnings() == ()
    heavy = Settings(limits=limits, parameters={"torque_Nm": 3000.0})
    assert "momentary torque" in RvTransmissionError(heavy).warnings()[0]


# ---------------------------------------------------------------- the convex form


def form_values(form: Form, designs: Array) -> Array:
    """The requirements (n, rows) of a form, by its formula."""
    spread = np.array([feature.ways[0].spread for feature in form.features])
    return np.asarray(form.offset + np.sqrt(form.constant + designs[:, :12] ** 2 @ spread**2))


def fixed(precision: float, **parameters: Value) -> RvTransmissionError:
    setting = {"precision_weight": VariableSetting(value=precision)}
    pair = ("cost", "te_amplitude_arcsec")
    return RvTransmissionError(Settings(parameters, setting, objectives=pair))


@pytest.mark.parametrize(("precision", "parameters"), [(0.0, {}), (5.0, {}), (5.0, GENERAL)])
def test_form_bounds_the_transmission_error_from_below(precision: float, parameters: dict[str, Value]) -> None:
    problem = fixed(precision, measurement_std_mrad=0.2, **parameters)
    form = problem.form()
    assert form is not None
    designs = problem.complete(np.random.default_rng(2).uniform(problem.xl, problem.xu, (50, 12)))
    found, values = searched(problem, designs), form_values(form, designs)
    te = found["te_amplitude_arcsec"]
    assert np.all(values[:, 0] <= te)
    assert np.max(te / values[:, 0]) < 1.25
    for at, name in enumerate(form.outputs[1:], 1):
        np.testing.assert_allclose(values[:, at], found[name], rtol=1e-9)


def test_form_is_tight_where_the_ellipse_is_round() -> None:
    problem, level = fixed(5.0), np.full((1, 12), 1.0)
    form = problem.form()
    assert form is not None
    designs = problem.complete(level)
    te = searched(problem, designs)["te_amplitude_arcsec"]
    assert form_values(form, designs)[0, 0] == pytest.approx(te[0], rel=0.02)


def test_no_form_where_the_precision_weight_is_searched() -> None:
    assert plain().form() is None


@pytest.mark.parametrize("coverage", [0.2, 0.9, 0.9973])
def test_least_ratio_is_that_of_a_circle_or_a_line(coverage: float) -> None:
    ends = stats.rayleigh.ppf(coverage) ** 2 / 2.0, stats.halfnorm.ppf(coverage) ** 2
    assert least_ratio(coverage) == pytest.approx(min(ends), rel=1e-4)


def test_front_at_fixed_precision_weight_is_proven_within_a_few_percent() -> None:
    problem = fixed(5.0)
    found = search(problem, GDE3(population=60), Budget(evaluations=12_000), 0, engine="array")
    front = found.f[nondominated(found.f)]
    values = {name: front[:, at] for at, name in enumerate(problem.objectives)}
    gap = proof(problem, values, len(front)).gap_percent(values["cost"])
    assert 0.0 < np.median(gap) < 5.0

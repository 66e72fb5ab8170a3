"""The document's task on the rebuilt manipulator: optimum, symmetry, groupings, faults."""

from pathlib import Path

import numpy as np
import pytest

from tests.models.unit_effects import unit_effects
from tolevo import registry
from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.solver import Exact, closed_form
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.effects.measurements import Active, changes_of, effect_actions, measurements_of, target_of
from tolevo.models.manipulator.geometry import Manipulator, TaskRing
from tolevo.models.manipulator.maps import SOURCES as ELEMENTARY
from tolevo.models.manipulator.pose import ManipulatorPose
from tolevo.models.manipulator.ring import quadrature
from tolevo.problems.limits import LIMIT_ROUNDING as ROOM
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.pose_accuracy.outputs import NINE, SOURCES
from tolevo.problems.settings import Bound, Settings
from tolevo.testing import ProblemContract


class TestContract(ProblemContract):
    problem_type = PoseAccuracy


def problem_of(index: str, objectives: tuple[str, ...] = ("cost",)) -> PoseAccuracy:
    return PoseAccuracy(Settings(parameters={"index": index}, objectives=objectives))


def limited(limits: dict[str, float]) -> PoseAccuracy:
    bounds = {name: Bound(high=high) for name, high in limits.items()}
    return PoseAccuracy(Settings(parameters={"index": "rms_plane"}, objectives=("cost",), limits=bounds))


def optimum(problem: PoseAccuracy) -> tuple[float, np.ndarray, float]:
    """Least cost, its design, and the proven bound."""
    form = closed_form(problem)
    assert form is not None
    found = least_cost(form, np.full((1, len(form.outputs)), 0.2))
    return float(found.cost[0]), found.t[0], float(found.bound[0])


# physics/manipulator.md, section 6
PUBLISHED = [("rms_plane", 12.590, 5e-4), ("rms_volume", 12.599, 5e-4), ("every_pose", 17.679, 2e-3)]


@pytest.mark.parametrize(("index", "cost", "within"), PUBLISHED)
def test_optimum_of_the_notes(index: str, cost: float, within: float) -> None:
    found, _, bound = optimum(problem_of(index))
    np.testing.assert_allclose(found, cost, atol=within)
    np.testing.assert_allclose(bound, found, rtol=1e-8)


def test_allocation_of_the_notes() -> None:
    _, t, _ = optimum(problem_of("rms_plane"))
    np.testing.assert_allclose(t[:3], [5.73, 5.73, 10.87], atol=5e-3)
    np.testing.assert_allclose(t[3:6], [12.3, 12.3, 80.0], atol=5e-2)
    np.testing.assert_allclose(t[6:], [0.057, 0.057, 0.086], atol=5e-4)
    np.testing.assert_allclose(t[[0, 3, 6]], t[[1, 4, 7]], rtol=1e-6)  # chains 1 and 2 are equal
    np.testing.assert_allclose(t[5], 80.0, rtol=1e-9)  # it has no effect: on its bound


def test_outputs_are_root_sums_over_the_ring() -> None:
    """Recomputed from the unit effects at the nodes of a quadrature of another order."""
    problem = problem_of("rms_plane", ("cost", "squareness_mrad"))
    rng = np.random.default_rng(0)
    designs = rng.uniform(problem.xl, problem.xu, (5, 9))
    r, z, weight = quadrature(TaskRing(), "rms_plane", 40)
    effects = unit_effects(Manipulator(), r, z)
    total = np.zeros((5, 3, len(r)))
    for at, name in enumerate(problem.names):
        stem, unit = name.rsplit("_", 1)
        sigma = designs[:, at] * {"um": 1e-6, "mrad": 1e-3}[unit]
        turn = np.sum(effects.orientation[stem] ** 2, axis=2)  # (n, 3), over components
        move = np.sum(effects.position[stem] ** 2, axis=(1, 2))
        square = np.stack([turn[:, 0] + turn[:, 1], turn[:, 2], move])
        total += sigma[:, None, None] ** 2 * square
    expected = np.sqrt(total @ weight) * 1e3
    found = problem.outputs_of(designs)
    for at, name in enumerate(("squareness_mrad", "yaw_mrad", "position_mm")):
        np.testing.assert_allclose(found[name], expected[:, at], rtol=1e-3)


@pytest.mark.parametrize("index", ["plane", "rms_volume", "every_pose"])
def test_gradient_is_the_central_difference(index: str) -> None:
    problem = problem_of(index)
    design = np.array([[6.0, 7.0, 9.0, 13.0, 12.0, 40.0, 0.05, 0.07, 0.09]])
    exact = problem.gradient(design)
    for at in range(9):
        step = 1e-5 * design[0, at]
        ends = np.repeat(design, 2, axis=0)
        ends[:, at] += [-step, step]
        values = problem.outputs_of(ends, errors=False)
        for name, slope in exact.items():
            difference = (values[name][1] - values[name][0]) / (2.0 * step)
            np.testing.assert_allclose(slope[0, at], difference, rtol=1e-6, atol=1e-9)


def test_exact_front_beats_random_designs_and_is_its_own_bound() -> None:
    problem = problem_of("rms_plane", ("cost", "squareness_mrad"))
    found = search(problem, Exact(points=40), Budget(), 0)
    assert len(found.x) >= 38
    rng = np.random.default_rng(1)
    x = np.exp(rng.uniform(np.log(problem.xl), np.log(problem.xu), (20_000, 9)))
    designs = problem.complete(x)
    values = problem.outputs_of(designs, errors=False)
    kept = np.all(problem.violations(designs, values) <= 0.0, axis=1)
    assert kept.sum() > 20
    proven = proof(problem, {n: values[n][kept] for n in problem.objectives}, int(kept.sum()))
    assert np.all(proven.bound <= values["cost"][kept])
    own = proof(problem, dict(zip(problem.objectives, found.f.T, strict=True)), len(found.f))
    np.testing.assert_allclose(own.bound, found.f[:, 0], rtol=1e-6)


@pytest.mark.parametrize("above", [-1e-8, -1e-15, 0.0, 1e-15, 1e-13, 1e-12, 1e-11, 1e-9])
def test_at_the_tightest_limit_only_what_contributes_to_it_is_paid_for(above: float) -> None:
    """Six of nine tolerances make the squareness: at its least they are tightest, 10 each.

    Of the other three (cost 10 low / t) two make the yaw in addition, along whose limit the least
    cost is sought by a scan; the third is at its loosest, low / high = 1 / 40.
    """
    form = closed_form(limited({"squareness_mrad": 1.0, "yaw_mrad": 1.0}))
    assert form is not None and form.outputs == ("squareness_mrad", "yaw_mrad")
    a = np.array([f.ways[0].spread for f in form.features])
    low = np.array([f.ways[0].low for f in form.features])
    least = np.sqrt(((a * low[:, None]) ** 2).sum(axis=0))
    limit = least[0] * (1.0 + above), 1.5 * least[1]
    room = limit[1] ** 2 - ((np.delete(a[:, 1] * low, [2, 8])) ** 2).sum()
    t2 = np.linspace(low[2], 40.0 * low[2], 400_001)
    t8 = np.sqrt(np.maximum(room - (a[2, 1] * t2) ** 2, 0.0)) / a[8, 1]
    t8 = np.where(t8 < low[8], np.nan, np.minimum(t8, 40.0 * low[8]))
    exact = 60.0 + 10.0 / 40.0 + float(np.nanmin(10.0 * low[2] / t2 + 10.0 * low[8] / t8))
    bounded = limited({"squareness_mrad": float(limit[0]), "yaw_mrad": float(limit[1])})
    result = search(bounded, Exact(), Budget(), 0)
    if above < -ROOM:
        assert not len(result.x)
    else:
        assert result.f[0, 0] == pytest.approx(exact, rel=1e-7)


def test_at_two_tightest_limits_all_that_contributes_to_either_is_paid_for() -> None:
    """Eight of nine tolerances make squareness or yaw; the ninth is at its loosest, low / high = 1 / 40."""
    form = closed_form(limited({"squareness_mrad": 1.0, "yaw_mrad": 1.0}))
    assert form is not None
    a, low = (np.array([getattr(f.ways[0], name) for f in form.features]) for name in ("spread", "low"))
    limit = np.sqrt(((a * low[:, None]) ** 2).sum(axis=0)) * (1.0 + 1e-13)
    bounded = limited(dict(zip(form.outputs, limit.tolist(), strict=True)))
    assert search(bounded, Exact(), Budget(), 0).f[0, 0] == pytest.approx(80.0 + 10.0 / 40.0, rel=1e-9)


BASE = """problem = "pose_accuracy"
[objectives]
minimise = ["cost", "yaw_mrad"]
[algorithm]
name = "exact"
points = 20
"""


def configured(path: Path, text: str) -> PoseAccuracy:
    path.write_text(BASE + text, encoding="utf-8")
    problem = read(path).problem
    assert isinstance(problem, PoseAccuracy)
    return problem


def grouping_of(changes: dict[str, list[str]]) -> str:
    table = {name: list(sources) for name, sources in NINE.items()} | changes
    lines = [f"{name} = {sources}" for name, sources in table.items() if sources]
    return "[grouping]\n" + "\n".join(lines).replace("'", '"') + "\n"


def test_a_grouping_of_ones_own(tmp_path: Path) -> None:
    both = {"rod_length_12_um": ["rod_length_1", "rod_length_2"], "rod_length_1_um": [],
            "rod_length_2_um": []}  # fmt: skip
    problem = configured(tmp_path / "c.toml", grouping_of(both))
    assert len(problem.names) == 8
    nine = problem_of("plane", ("cost", "yaw_mrad"))
    design = np.array([[5.0, 5.0, 9.0, 13.0, 12.0, 40.0, 0.05, 0.07, 0.09]])
    own = np.array([[dict(zip(nine.names, design[0], strict=True)).get(n, 5.0)
                     for n in problem.names]])  # fmt: skip
    for name in ("squareness_mrad", "yaw_mrad", "position_mm"):
        np.testing.assert_allclose(problem.outputs_of(own)[name], nine.outputs_of(design)[name], rtol=1e-12)
    again = tmp_path / "again.toml"
    again.write_text(read(tmp_path / "c.toml").toml(), encoding="utf-8")
    assert read(again).toml() == read(tmp_path / "c.toml").toml()


BAD = [
    (grouping_of({"rod_length_1_um": ["rod_length_1", "rod_length_2"]}), "already belongs to"),
    (grouping_of({"rod_length_1_um": []}), "leaves out rod_length_1"),
    (grouping_of({"rod_length_1_um": ["rod_lenght_1"]}), "did you mean `rod_length_1`"),
    (grouping_of({"rod_length_1_mrad": ["rod_length_1"], "rod_length_1_um": []}), "end with _um"),
    ("[parameters]\nring_r_mm = [300, 900]\n", "too far away for chain"),
    ("[parameters]\narm_length_mm = [400, 400]\n", "list of 3 numbers"),
    ("[variables.rod_length_1_um]\nlow = 0\n", "rod_length_1_um"),
    ("[variables.rod_length_1_um]\nvalue = -1\n", "rod_length_1_um"),
    ("[parameters]\nindex = 'plain'\n", "plane"),
    ("[limits]\nyaw_mrad = 0.001\n", "cannot be met"),
]


@pytest.mark.parametrize(("text", "expected"), BAD)
def test_bad_input_is_named(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        configured(tmp_path / "c.toml", text)


def test_every_source_is_in_the_nine_kinds_once() -> None:
    named = [source for sources in NINE.values() for source in sources]
    assert sorted(named) == sorted(SOURCES)
    assert len(SOURCES) == 18


EFFECTS: dict[str, dict[str, float]] = {
    "joint_zero_offset": {"zero_1_mrad": 1.0, "zero_2_mrad": -0.5},
    "arm_length_error": {"length_1_um": 200.0, "length_3_um": -100.0},
    "base_tilt": {"x_mrad": 1.0, "y_mrad": -2.0},
    "gravity_sag": {"compliance_1_mrad_per_Nm": 0.01, "moving_mass_kg": 20.0},
    "thermal_growth": {"expansion_per_K_ppm": 12.0},
    "drive_eccentricity": {"drive_cos_1_mrad": 0.5, "drive_sin_2_mrad": 0.5},
    "joint_clearance": {"joint_clearance_um": 50.0},
}


@pytest.mark.parametrize("name", list(EFFECTS))
def test_effects_move_the_mean_of_machines_and_not_their_spread(name: str) -> None:
    """Machines drawn at one pose, exact kinematics: the same ones with the effect and without.

    The problem's outputs are spreads, so that effects of the manipulator have no counterpart.
    """
    model, count, rng = ManipulatorPose(), 1000, np.random.default_rng(5)
    table = {
        "r_mm": np.full(count, 450.0), "z_mm": np.full(count, 200.0), "phi_deg": np.zeros(count),
        "payload_kg": np.full(count, 10.0), "temperature_C": np.full(count, 30.0),
    }  # fmt: skip
    drawn = {one.name: rng.normal(0.0, 0.1 if one.unit == "mrad" else 20.0, count) for one in ELEMENTARY}
    one = Active(registry.load("effects", name)(), EFFECTS[name])
    target = target_of(model, "manipulator_pose", table)
    added = changes_of(effect_actions([one], measurements_of(target.columns, table), target))
    none = np.zeros(count)
    both = {key: drawn.get(key, none) + added.get(key, none) for key in {*drawn, *added}}
    plain, moved = (model.predict(table, rng, changes) for changes in (drawn, both))
    shift = {key: abs(moved[key].mean() - plain[key].mean()) for key in plain}
    assert max(shift.values()) > 1e-3
    for key, values in plain.items():
        assert moved[key].std() == pytest.approx(values.std(), rel=0.005), key
    assert PoseAccuracy(Settings(effects=(one,))).counterparts() == ("",)

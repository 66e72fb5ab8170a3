"""The records are what they say they are, and share no code with what they judge."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.gap.generator.assemblies import Builds, Faults, assembled
from benchmarks.gap.generator.hysteresis import LOCKED
from benchmarks.gap.generator.mechanisms import ROTATING
from benchmarks.gap.generator.noise import NOISES
from benchmarks.gap.generator.outside import OUTSIDE, SINCE_INSIDE
from benchmarks.gap.generator.records import BENCH_GROUPS, LEAST_LAMBDA, TIMED, Truth, orthogonal, record
from benchmarks.gap.generator.tables import POOR, points
from benchmarks.gap.scoring.rivals import RIVALS, least_left
from benchmarks.gap.scoring.told import UNTOLD

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmarks" / "gap"
MAKERS = (
    *sorted((BENCHMARK / "generator").glob("*.py")), *sorted((BENCHMARK / "scoring").glob("*.py")),
    *(one for one in sorted((BENCHMARK / "namers").glob("*.py")) if one.stem != "workflow"),
)  # fmt: skip
KNOWN = (
    "__future__", "collections", "dataclasses", "functools", "itertools", "typing", "math",
    "warnings", "logging", "importlib.util", "numpy", "scipy", "sklearn", "pandas", "sympy", "pysindy", "adcd",
    "benchmarks.gap.generator",
    "benchmarks.gap.scoring", "benchmarks.gap.namers",
)  # fmt: skip


@pytest.mark.parametrize("module", MAKERS, ids=lambda one: f"{one.parent.name}-{one.stem}")
def test_nothing_of_the_project_is_imported(module: Path) -> None:
    tree = ast.parse(module.read_text(encoding="utf-8"))
    found = [one for one in ast.walk(tree) if isinstance(one, ast.Import | ast.ImportFrom)]
    modules = [one.module or "." for one in found if isinstance(one, ast.ImportFrom)]
    modules += [alias.name for one in found if isinstance(one, ast.Import) for alias in one.names]
    assert [one for one in modules if not one.startswith(KNOWN)] == []
    assert "benchmarks.gap.namers.workflow" not in modules
    called = {one.id for one in ast.walk(tree) if isinstance(one, ast.Name)}
    assert not called & {"__import__", "exec", "eval"}


@pytest.fixture(scope="module")
def many() -> list[Truth]:
    """150 records each with one effect, of good and of poor designs."""
    return [record(group, k)[1] for group in ("good", "poor") for k in range(150)]


def test_grid_is_that_of_the_notes(many: list[Truth]) -> None:
    """Every design, noise and mechanism; 60 to 2400 rows, signal to noise 0.2 to 3."""
    assert {one.poor for one in many} == {None, *POOR}
    assert {one.noise for one in many} == set(NOISES)
    assert {name for one in many for name in one.names} == {*ROTATING, *LOCKED}
    rows = [len(one.points) for one in many]
    assert 60 <= min(rows) < 100 and 2000 < max(rows) <= 2400
    snr = [np.sqrt(np.mean(orthogonal(one.free, one.hidden[0].added) ** 2)) / one.sigma for one in many]
    assert 0.2 <= min(snr) < 0.25 and 2.5 < max(snr) <= 3.0 + 1e-9


def test_causes_outside_the_library_are_told_from_every_name_of_it() -> None:
    """At a thousand rows and twice as much signal as noise."""
    at = points(np.random.default_rng(0), 1000, None)
    free = np.ones((len(at), 1))
    for name, cause in OUTSIDE.items():
        left = orthogonal(free, cause(np.random.default_rng(1), at).added)
        left = 2.0 * left / np.sqrt(np.mean(left**2))
        own = SINCE_INSIDE.get(name, "")
        least = min(least_left(one, at, free, left)[0] for one in RIVALS["rotating"] if one.name != own)
        assert least > UNTOLD, name
    assert not {*OUTSIDE} & {*ROTATING, *LOCKED}


@pytest.mark.parametrize("group", BENCH_GROUPS)
def test_a_record_follows_from_its_group_and_number(group: str) -> None:
    (one, truth), (again, _), (other, _) = record(group, 3), record(group, 3), record(group, 4)
    assert one.table.equals(again.table)
    assert one.configuration == again.configuration
    assert one.name != other.name
    assert np.isfinite(one.table.to_numpy()).all()
    there = set(one.table.columns) - {"session"}
    assert set(tomllib.loads(one.configuration)["columns"]) == there
    assert not any(name in f"{one.name} {one.configuration}" for name in truth.names)


@pytest.mark.parametrize("group", ["good", "poor", "pair", "outside"])
def test_signal_to_noise_is_that_of_the_part_that_recalibration_cannot_make(group: str) -> None:
    for number in range(12):
        _, truth = record(group, number)
        for one in truth.hidden:
            left = orthogonal(truth.free, one.added)
            strength = float((left**2).sum()) / truth.sigma**2
            assert strength >= LEAST_LAMBDA - 1e-9 if group != "pair" else strength > 149.0
            assert 0.19 < np.sqrt(strength / len(left)) < 3.01


def test_assembly_is_the_printed_one() -> None:
    """Document A's part errors, final states of its printed reading at Q = 0, 5 and 10."""
    errors = np.tile([-1.6, 5.3, 5.8, 3.2], (3, 1))
    found = assembled(Builds(errors, np.array([0.0, 5.0, 10.0])), Faults())
    printed = [
        [-1.6, 3.7, 5.8, 9.0], [-1.314, 1.375, 3.314, 4.857], [-0.985, 0.884, 2.486, 4.029],
    ]  # fmt: skip
    np.testing.assert_allclose(found, printed, atol=5e-4)


def test_every_mechanism_adds_something_and_draws_its_own_dimensions() -> None:
    at = points(np.random.default_rng(0), 500, None)
    for name, mechanism in ROTATING.items():
        one = mechanism(np.random.default_rng(1), at).added
        other = mechanism(np.random.default_rng(2), at).added
        assert one.std() > 0.0, name
        assert np.abs(np.corrcoef(one, other)[0, 1]) <= 1.0 + 1e-12
        assert not np.allclose(one, other), name


@pytest.mark.parametrize("law", [one for one in NOISES if one != "outliers"])
def test_noise_has_unit_size(law: str) -> None:
    rng = np.random.default_rng(5)
    sizes = [np.mean(NOISES[law](rng, points(rng, 1500, None)) ** 2) for _ in range(30)]
    np.testing.assert_allclose(np.mean(sizes), 1.0, atol=0.03)


def test_autocorrelation_and_outliers() -> None:
    rng = np.random.default_rng(6)
    at = points(rng, 20000, None)
    noise = NOISES["autocorrelated"](rng, at)
    np.testing.assert_allclose(np.corrcoef(noise[1:], noise[:-1])[0, 1], 0.7, atol=0.02)
    wrong = np.mean(np.abs(NOISES["outliers"](rng, at)) > 5.0)
    np.testing.assert_allclose(wrong, 0.02, atol=0.004)


def test_poor_designs_tie_their_inputs() -> None:
    rng = np.random.default_rng(7)
    by_time = points(rng, 2000, "temperature follows time")
    by_direction = points(rng, 2000, "speed follows direction")
    free = points(rng, 2000, None)
    assert np.corrcoef(by_time.tau, by_time.time)[0, 1] > 0.8
    assert np.corrcoef(by_direction.speed, by_direction.direction)[0, 1] > 0.8
    assert abs(np.corrcoef(free.tau, free.time)[0, 1]) < 0.1
    by_angle = points(rng, 2000, "torque follows angle")
    waves = np.column_stack([np.cos(by_angle.angle), np.sin(by_angle.angle)])
    left = orthogonal(waves, by_angle.torque)
    assert (left**2).sum() < 0.15 * (by_angle.torque**2).sum()


def test_waves_of_other_gears_are_those_of_their_wheels() -> None:
    """The spectrum of each such record is highest where its teeth say, and nowhere else."""
    kinds = set()
    for number in range(8):
        found, truth = record("own gear", number)
        at, (one,) = truth.points, truth.hidden
        kinds.add(truth.kind)
        assert ("[gear]" in found.configuration) == at.declared == (truth.kind == "own gear")
        grid = np.arange(1.0, 400.0, 0.25)
        own = one.added - one.added.mean()
        if one.name == "load_sharing":
            own = own / at.torque
        power = [abs(np.mean(own * np.exp(-1j * order * at.angle))) for order in grid]
        highest = grid[int(np.argmax(power))]
        multiples = [k * at.pin for k in (1, 2, 3, 4)]  # a pulse has several
        expected = (*at.excitations, *multiples)
        assert min(abs(highest - order) for order in expected) <= 0.5, (number, highest, expected)
    assert kinds == {"own gear", "unknown gear"}


def test_sessions_have_clocks_of_their_own() -> None:
    """Each from 0 on, in records in which nothing follows the time; about half of those."""
    cut = 0
    for number in range(40):
        found, truth = record("dominant", number)
        if "session" not in found.table:
            continue
        cut += 1
        assert not TIMED & set(truth.names)
        by = found.table.groupby("session", sort=False)["time_s"]
        assert 2 <= by.ngroups <= 4 and (by.min() == 0.0).all()
        assert all((part.diff().dropna() > 0.0).all() for _, part in by)
    assert 5 <= cut <= 25


def test_a_late_channel_is_the_prediction_of_another_moment() -> None:
    """Moved back by the delay that fits best, it is the prediction again."""
    for number in range(3):
        found, truth = record("late good", number)
        at, (one,) = truth.points, truth.hidden
        y = found.table["te_arcsec_predicted"].to_numpy()
        late = np.arange(-9.0, 9.01, 0.05) * at.pace
        left = [np.std(np.interp(at.time - by, at.time, y)[50:-50] - (y + one.added)[50:-50])
                for by in late]  # fmt: skip
        best = int(np.argmin(left))
        assert abs(late[best]) >= 0.4 * at.pace
        assert left[best] < 0.1 * np.std(one.added)


def test_forms_of_approximate_records_are_off_by_as_much_as_they_should() -> None:
    """Least squares of the published formulas leave 1 to 10 % of each law, of an asymmetric one its offset."""
    seen = set()
    for number in range(40):
        _, truth = record("approximate", number)
        at, (one,) = truth.points, truth.hidden
        forms = {
            "friction_hysteresis": [at.direction], "viscous_friction": [at.direction * at.speed],
            "torsional_compliance": [at.torque],
            "hertz_stiffening": [np.sign(at.torque) * np.abs(at.torque) ** (2 / 3)],
            "output_eccentricity": [np.cos(at.angle), np.sin(at.angle)],
        }  # fmt: skip
        if one.name in forms:
            x = np.column_stack([np.ones(len(at)), *forms[one.name]])
            left = one.added - x @ np.linalg.lstsq(x, one.added, rcond=None)[0]
            off = np.linalg.norm(left) / np.linalg.norm(one.added - one.added.mean())
            assert 0.0099 < off < 0.101 or (one.name == "friction_hysteresis" and off < 1e-6)
        seen.add(one.name)
    assert len(seen) == 6

"""The damper's records and its model, before any workflow sees them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.gap.generator.tables import Array
from tests.gap_benchmark.damper import Jenkins, arts
from tolevo import registry
from tolevo.commands.gap import gap
from tolevo.commands.gap.plan import GapPlan
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult

PLAIN = ("stiffness_kip_per_in", "slip_force_kip", "start_in")


STEP = [1e-3]
"""Relative step of the differences: the error is only piecewise smooth."""

read = lru_cache(arts)


def force(amplitude: str, p: Array, width: float = 0.0) -> Array:
    model = Jenkins(dict(zip(PLAIN, [*np.abs(p[:2]).tolist(), p[2]], strict=True)))
    table = {str(name): column.to_numpy() for name, column in read(amplitude).items()}
    changes = {"bearing_clearance_in": np.full(1, abs(width))}
    return model.predict(table, np.random.default_rng(0), changes)["force_kip"]


def error(amplitude: str, p: Array, width: float = 0.0, late: float = 0.0) -> float:
    measured, time = (read(amplitude)[name].to_numpy() for name in ("force_kip", "time_s"))
    recorded = np.interp(time - late, time, force(amplitude, p, width))
    return float(np.sqrt(np.mean((recorded - measured) ** 2)))


def test_loop_of_the_element_is_the_parallelogram_of_its_parameters() -> None:
    """Stiffness 10, slip at 2: the force of a full cycle of 1 in. loses 4 F (A - F/k) of work."""
    turn = np.linspace(0.0, 4.0 * np.pi, 40001)
    path = np.sin(turn)
    model = Jenkins({"stiffness_kip_per_in": 10.0, "slip_force_kip": 2.0})
    for width in (0.0, 0.15):
        found = model.predict({"displacement_in": path}, np.random.default_rng(0),
                              {"bearing_clearance_in": np.full(1, width)})["force_kip"]  # fmt: skip
        second = turn >= 2.0 * np.pi
        work = np.trapezoid(found[second], path[second])
        assert work == pytest.approx(4.0 * 2.0 * (1.0 - 0.2 - width / 2.0), rel=1e-3)
        assert np.abs(found).max() == pytest.approx(2.0)


def fitted(start: Array) -> Array:
    """Least squares on the 1 in. record: stiffness, slip, beginning, and a width where asked."""
    measured = read("1")["force_kip"].to_numpy()

    def left(p: Array) -> Array:
        return np.asarray(force("1", p[:3], p[3] if len(p) > 3 else 0.0) - measured)

    return np.asarray(least_squares(left, start, diff_step=STEP).x)


def on_the_other_record(p: Array, width: float, late: float = 0.0) -> float:
    """RMSE [kip] on the 0.5 in. record, its beginning free."""
    starts = np.linspace(-0.2, 0.2, 41)
    return min(error("0.5", np.array([*p[:2], at]), width, late) for at in starts)


@pytest.fixture(scope="module")
def plain() -> Array:
    return fitted(np.array([12.0, 2.0, 0.0]))


def test_a_dead_zone_of_an_inch_over_six_is_in_the_record(plain: Array) -> None:
    """By least squares alone, before the workflow says so."""
    full = fitted(np.append(plain, 0.1))
    assert 0.17 < abs(full[3]) < 0.18
    assert on_the_other_record(full, full[3]) < 0.6 * on_the_other_record(plain, 0.0)


@pytest.fixture(scope="module")
def result(plain: Array, tmp_path_factory: pytest.TempPathFactory) -> GapResult:
    """The analysis of the 1 in. record with the whole library, from the plain element's fit."""
    path = tmp_path_factory.mktemp("arts") / "damper.csv"
    read("1").to_csv(path, index=False)
    plan = GapPlan(
        model_name="damper",
        model=Jenkins(),
        parameters=dict(zip(PLAIN, plain.tolist(), strict=True)),
        free=Jenkins.free,
        rebuild=Jenkins,
        library=tuple(registry.names("effects")),
    )
    return gap.analysis_result(plan, read_data(plan, path))


def test_the_workflow_names_the_clearance_and_its_width(result: GapResult) -> None:
    # channels of the test rig that are a few milliseconds apart may stand beside it
    assert set(result.names) - {"delay"} == {"bearing_clearance"}
    (width,) = next(e for e in result.effects if e.name == "bearing_clearance").parameters
    assert width.name == "bearing_clearance_in"
    assert width.low < 0.18 and width.high > 0.17
    assert abs(width.value / 0.175 - 1.0) < 0.05


def test_the_gap_is_located_at_small_force(result: GapResult) -> None:
    region = max(result.where, key=lambda one: one.share)
    assert "force" in region.variable
    largest = float(np.abs(read("1")["force_kip"]).max())
    assert -0.1 * largest < region.low < 0.0 < region.high < 0.1 * largest


def test_the_record_that_was_not_fitted_is_predicted_better(result: GapResult, plain: Array) -> None:
    """Half the amplitude, its beginning free: by all that was named the error falls by half."""
    after = {one.name: one.after for one in result.gate.recalibrated}
    corrected = np.array([after[name] for name in PLAIN])
    named = {p.name: p.value for one in result.effects for p in one.parameters}
    found = on_the_other_record(corrected, named["bearing_clearance_in"], named.get("delay_s", 0.0))
    assert found < 0.5 * on_the_other_record(plain, 0.0)

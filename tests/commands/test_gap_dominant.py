"""What dominates a gap is named before any curve, although the form of no formula is that of a machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo
from tests.commands.gap_toy import N, directions, member, toy
from tolevo.commands.gap import gap
from tolevo.commands.gap.analysis import analysed as analysed_rows
from tolevo.commands.gap.blocks import coarsest_split
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.generic import generic
from tolevo.commands.gap.library import candidates
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.commands.gap.setup import prepare_setup

ROLES = {
    "v": '{ role = "speed", unit = "m/s" }', "d": '{ role = "direction" }', "t": '{ role = "time", unit = "s" }',
    "force": '{ role = "measured", unit = "N" }', "force_sim": '{ role = "predicted", unit = "N" }',
    "angle": '{ role = "angle", unit = "deg" }', "torque": '{ role = "torque", unit = "N m" }',
    "te": '{ role = "measured", unit = "arcsec" }', "te_sim": '{ role = "predicted", unit = "arcsec" }',
    "x": '{ role = "angle", unit = "mm" }', "n": '{ role = "speed", unit = "rpm" }',
    "pos": '{ role = "measured", unit = "mm" }', "pos_sim": '{ role = "predicted", unit = "mm" }',
    "oil": '{ role = "temperature", unit = "degC" }',
    "M": '{ role = "measured", unit = "N m" }', "M_sim": '{ role = "predicted", unit = "N m" }',
}  # fmt: skip


def files(folder: Path, table: pd.DataFrame, more: str = "") -> tuple[Path, Path]:
    """The two files of a record: its table, and the roles of its columns."""
    lines = [f"{name} = {ROLES[name]}" for name in table if name in ROLES]
    configuration, data = folder / "gap.toml", folder / "data.csv"
    text = ['model = "table"', "[columns]", *lines, more, "[settings]", "simulations = 500", ""]
    configuration.write_text("\n".join(text), encoding="utf-8")
    table.to_csv(data, index=False)
    return configuration, data


def analysed(folder: Path, table: pd.DataFrame, more: str = "") -> GapResult:
    plan = read_gap((paths := files(folder, table, more))[0])
    return gap.analysis_result(plan, read_data(plan, paths[1]))


def axis(rows: int) -> pd.DataFrame:
    """A screw axis that moves to and fro: 20 N of dry friction, 5 % more in one direction, with a dip of no
    Gaussian form at low speed, and a drag of 8 N at full speed.
    """
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 40.0, rows)
    v = 0.12 * np.sin(2.0 * np.pi * 0.21 * t) + 0.08 * np.sin(2.0 * np.pi * 0.53 * t + 1.0)
    d, speed = np.sign(v), np.abs(v)
    friction = d * (20.0 + 2.0 / (1.0 + (speed / 0.02) ** 1.3) + 40.0 * speed) + 1.0
    force = friction + rng.normal(0.0, 0.15, rows)
    return pd.DataFrame({"t": t, "v": speed, "d": d, "force": force, "force_sim": np.zeros(rows)})


FRICTION = {"friction_hysteresis": "half_width", "stribeck": "level", "directional_offset": "forward"}


@pytest.mark.parametrize("rows", [250, 2000, pytest.param(16000, marks=pytest.mark.slow)])
def test_dry_friction_is_named_whatever_its_form_at_low_speed(tmp_path: Path, rows: int) -> None:
    """Its number is that of least squares by its formula to 5 %, or within the interval, from any number of
    rows of one machine; curves come after.
    """
    table = axis(rows)
    result = analysed(tmp_path, table)
    named = [effect for effect in result.effects if effect.name in FRICTION]
    assert len(named) == 1 and result.effects[0] is named[0], result.names
    number = next(p for p in named[0].parameters if p.name.startswith(FRICTION[named[0].name]))
    d, drag = table["d"].to_numpy(), (table["d"] * table["v"]).to_numpy()
    columns = [np.maximum(d, 0.0), np.minimum(d, 0.0)] if number.name.startswith("forward") else [d]
    columns += [drag] if "viscous_friction" in result.names else []
    level = float(np.linalg.lstsq(np.column_stack(columns), table["force"].to_numpy(), rcond=None)[0][0])
    assert 20.0 < level < 25.0
    assert abs(number.value / level - 1.0) < 0.05 or number.low <= level <= number.high
    assert number.high - number.low < 0.3 * number.value
    assert named[0].explains_percent > 90.0
    assert {*result.names} <= {*FRICTION, "viscous_friction"}
    assert len(result.unresolved) <= 3


def test_what_an_effect_explains_is_that_of_least_squares(tmp_path: Path) -> None:
    """A twist T |T|^0.1, of which compliance leaves what least squares by numpy leaves."""
    rng = np.random.default_rng(2)
    torque = rng.uniform(-400.0, 400.0, 600)
    te = 0.1 * torque * np.abs(torque / 400.0) ** 0.1 + rng.normal(0.0, 0.2, 600)
    result = analysed(tmp_path, pd.DataFrame({"torque": torque, "te": te, "te_sim": np.zeros(600)}))
    x = np.column_stack([np.ones(600), torque])
    left = te - x @ np.linalg.lstsq(x, te, rcond=None)[0]
    explained = 100.0 * (1.0 - left @ left / np.sum((te - te.mean()) ** 2))
    assert result.names == ("torsional_compliance",) and result.verdict == "partial"
    effect = result.effects[0]
    assert effect.explains_percent == pytest.approx(explained, abs=1e-3)
    form = float(np.sqrt(np.mean(left**2) - 0.2**2))
    assert effect.form_error == pytest.approx(form, rel=0.1)
    assert effect.parameters[0].value == pytest.approx(np.linalg.lstsq(x, te, rcond=None)[0][1], rel=0.02)
    assert f"explains {explained:.3g} % of the gap; its form errs by" in str(effect)
    saved = gap.record(result)["effects"][0]
    assert saved["explains_percent"] == effect.explains_percent and saved["form_error"] == effect.form_error


def test_effects_that_cancel_are_found_by_their_variance_inflation() -> None:
    """Two columns of correlation r have a variance inflation of 1 / (1 - r^2): 9 at r^2 = 8/9."""
    a, b = directions(2).T
    for square, cancels in ((0.87, False), (0.90, True)):
        near = np.sqrt(square) * a + np.sqrt(1.0 - square) * b
        search = toy([member("a"), member("near")], {"a": a, "near": near}, 50.0 * a - 30.0 * near)
        fit = search.fitter.fit(search.dictionary.members)
        assert bool(search.cancelling(fit)) == cancels
        assert search.cancelling(search.fitter.fit(search.dictionary.members[:1])) == ()
    assert len(search.fitter.y) == N


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_parts_that_deflect_against_each_other_cancel(sense: float) -> None:
    a, b = directions(2).T
    two = member("creep", linear=2, together=2)
    search = toy([two], {"creep": np.column_stack([a, b])}, 30.0 * a + sense * 20.0 * b)
    assert search.cancelling(search.fitter.fit([two])) == (() if sense > 0.0 else (0,))


@pytest.mark.parametrize(("there", "cancels"), [(5.5, True), (5.6, False)])
def test_an_effect_whose_size_is_no_coefficient_may_cancel_too(there: float, cancels: bool) -> None:
    """A size of 10 where s is there contributes 10 and takes away s^2 - (10 - s)^2: 3 times as much at s = 5.56."""
    (a,) = directions(1).T
    search = toy([member("late", linear=0, shape={"delay": 1.0})], {"late": 10.0 * a}, there * a)
    fit = search.fitter.fit(search.dictionary.members)
    assert bool(search.fitter.cancelling(fit, search.thresholds.library)) == cancels
    assert bool(search.cancelling(fit, True)) == cancels
    assert not search.cancelling(fit)  # a set on the way, beside which its size is not yet the best


def test_errors_elsewhere_hold_a_curve_at_the_ends_of_the_other_rows(tmp_path: Path) -> None:
    """As `simulate` does: a friction that rises with the oil as no effect does, in sessions of one temperature each."""
    session = np.repeat([1, 2, 3, 4, 5], 60)
    oil = 15.0 + 10.0 * session + np.random.default_rng(7).uniform(-5.0, 5.0, 300)
    drag = 0.4 * np.abs((oil - 42.0) / 10.0) ** 1.5 + np.random.default_rng(8).normal(0.0, 0.05, 300)
    table = pd.DataFrame({"oil": oil, "M": drag, "M_sim": np.zeros(300), "session": session})
    plan = read_gap((paths := files(tmp_path, table))[0])
    analysis = analysed_rows(prepare_setup(plan, read_data(plan, paths[1])))
    assert analysis.fit.terms and not analysis.fit.effects
    tested, split = analysis.search.elsewhere.tested(analysis.fit), analysis.search.split
    assert split is not None and split.by == "session"
    for part in range(5):
        rows, others = split.labels == part, split.labels != part
        beyond = rows & ((oil > oil[others].max()) | (oil < oil[others].min()))
        np.testing.assert_array_equal(tested.held_at_ends[rows & ~beyond], tested.fitted[rows & ~beyond])
        if part in (0, 4):
            assert beyond.sum() > 40
            assert np.ptp(tested.held_at_ends[beyond]) < 1e-9 < 0.1 < np.ptp(tested.fitted[beyond])


def test_a_gap_within_a_stated_floor_is_none(tmp_path: Path) -> None:
    """A clear parabola of 0.1 arcsec under a stated noise of 0.5."""
    torque = np.linspace(-400.0, 400.0, 300)
    te = 0.3 * (torque / 400.0) ** 2 + np.random.default_rng(1).normal(0.0, 0.02, 300)
    table = pd.DataFrame({"torque": torque, "te": te, "te_sim": np.zeros(300)})
    result = analysed(tmp_path, table, "[noise]\nte = 0.5")
    assert result.verdict == "no_gap" and result.names == () and result.unresolved == ()
    assert result.gap_before["te"] < result.noise_floor["te"] == 0.5
    assert analysed(tmp_path, table).verdict != "no_gap"


def test_the_error_elsewhere_is_that_of_sessions_left_out(tmp_path: Path) -> None:
    """A slope that differs by session: each session is predicted by least squares of the others."""
    rng = np.random.default_rng(4)
    session = np.repeat([1, 2, 3], 100)
    torque = rng.uniform(-400.0, 400.0, 300)
    te = 0.1 * torque * (1.0 + 0.05 * (session - 2)) + rng.normal(0.0, 0.2, 300)
    table = pd.DataFrame({"torque": torque, "te": te, "te_sim": np.zeros(300), "session": session})
    result = analysed(tmp_path, table)
    assert result.names[0] == "torsional_compliance"
    assert result.split["by"] == "session" and result.split["parts"] == 3
    if not result.unresolved:
        x, left = np.column_stack([np.ones(300), torque]), np.empty(300)
        for k in (1, 2, 3):
            out = session == k
            left[out] = te[out] - x[out] @ np.linalg.lstsq(x[~out], te[~out], rcond=None)[0]
        assert result.elsewhere["te"] == pytest.approx(np.sqrt(np.mean(left**2)), rel=0.02)
    assert gap.record(result)["elsewhere"] == result.elsewhere["te"] > result.gap_after["te"]


def test_levels_of_an_input_split_a_record_without_sessions(tmp_path: Path) -> None:
    """Three torques are test conditions; without few values there are four levels of the speed."""
    torque = np.tile([-100.0, 0.0, 100.0], 40)
    table = pd.DataFrame({"torque": torque, "te": torque, "te_sim": np.zeros(120)})
    plan = read_gap((paths := files(tmp_path, table))[0])
    split = coarsest_split(read_data(plan, paths[1]))
    assert split.by == "torque" and split.natural and split.ends == (0, 2)
    assert np.array_equal(np.bincount(split.labels), [40, 40, 40])
    plan = read_gap((paths := files(tmp_path, axis(400)))[0])
    split = coarsest_split(read_data(plan, paths[1]))
    assert split.by == "levels of v" and not split.natural
    assert np.array_equal(np.bincount(split.labels), [100] * 4)


@pytest.mark.parametrize(("turn", "named"), [(0.45, False), (0.55, True)])
def test_less_than_half_a_wave_is_not_nameable(tmp_path: Path, turn: float, named: bool) -> None:
    angle = np.linspace(0.0, 360.0 * turn, 200)
    table = pd.DataFrame({"angle": angle, "te": np.cos(np.radians(angle)), "te_sim": np.zeros(200)})
    plan = read_gap((paths := files(tmp_path, table))[0])
    names = {candidate.name for candidate in candidates(plan.library, read_data(plan, paths[1]))}
    assert ("output_eccentricity" in names) == named
    orders = [form.order for form in generic(read_data(plan, paths[1]))[0] if form.kind == "order"]
    assert min(orders) * 2.0 * np.pi * turn >= np.pi


def test_a_reversal_error_of_an_axis_has_either_sign(tmp_path: Path) -> None:
    """A screw in cycles of ISO 230-2 that lags by 14 um, more towards one end, with a pitch error and a
    screw that warms: the lag is the half difference of the two directions' means.
    """
    way = np.linspace(-200.0, 200.0, 17)
    x, d = np.tile(np.r_[way, way[::-1]], 6), np.tile(np.repeat([1, -1], 17), 6)
    t = 0.4 * 60.0 * np.arange(len(x))
    grown = 1.15e-5 * 2.8 * -np.expm1(-t / 1500.0) * (x + 250.0)
    error = 0.006 * np.sin(2.0 * np.pi * x / 310.0 + 0.4) + grown - 0.007 * d * (1.0 + 0.2 * x / 200.0)
    pos = x + error + np.random.default_rng(109).normal(0.0, 0.0006, len(x))
    result = analysed(tmp_path, pd.DataFrame({"t": t, "x": x, "d": d, "pos": pos, "pos_sim": x}))
    (lag,) = (p for one in result.effects if one.name == "friction_hysteresis" for p in one.parameters)
    apart = pos - x - grown
    assert lag.low <= 0.5 * (apart[d > 0].mean() - apart[d < 0].mean()) <= lag.high < 0.0
    assert lag.value == pytest.approx(-0.007, rel=0.1)
    assert not any("order" in part.shape for part in result.remainder)  # 0.4 m hold no wave of a turn


def drag(rows: int) -> pd.DataFrame:
    """A drag in one direction, with the speed to the power 1.7, which falls as the oil warms."""
    rng, t = np.random.default_rng(106), 4.0 * np.arange(rows)
    n = rng.choice([100.0, 300.0, 600.0, 1000.0, 1500.0, 2200.0, 3000.0], rows)
    oil = 35.0 - 35.0 * np.expm1(-t / 900.0) + rng.normal(0.0, 0.4, rows)
    drag = churned(n, oil) + rng.normal(0.0, 0.03, rows)
    return pd.DataFrame({"t": t, "n": n, "oil": oil, "M": drag, "M_sim": np.zeros(rows)})


def churned(n: np.ndarray, oil: np.ndarray) -> np.ndarray:
    return np.asarray(0.9 * (n / 1000.0) ** 1.7 * np.exp(-0.004 * (oil - 35.0)) + 0.05)


def test_a_drag_in_one_direction_is_named_and_stays_one_beyond_the_record(tmp_path: Path) -> None:
    """At three times the largest speed the correction is flagged, and off by less than a half."""
    result = analysed(tmp_path, drag(700))
    assert result.effects[0].name in ("windage", "viscous_friction")
    assert result.effects[0].explains_percent > 90.0 and "gauge_bias" not in result.names
    assert "n is never negative, and there is no direction: rows that move count as motion in +" in result.notes
    (tmp_path / "corrected.toml").write_text(result.corrected, "utf-8")
    n, oil = np.array([50.0, 2000.0, 4500.0, 9000.0]), np.full(4, 60.0)
    asked = pd.DataFrame({"t": np.linspace(0.0, 2700.0, 4), "n": n, "oil": oil, "M_sim": np.zeros(4)})
    said = tolevo.simulate(tmp_path / "corrected.toml", asked)
    assert said["outside_record"].fillna("").tolist() == ["n", "", "n", "n"]
    away, true = said["M"].to_numpy() - churned(n, oil), churned(n, oil)
    assert (np.abs(away) < np.maximum(0.5 * true, 0.05)).all()

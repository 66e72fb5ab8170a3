"""Forms of the library that the rows choose, and names that they cannot show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.errors import InputError
from tolevo.models.effects.angle import highest_order
from tolevo.models.effects.load import LoadFriction
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.effects.speed import LoadViscous
from tolevo.models.measurable import Column, Role
from tolevo.section import Output

pytestmark = pytest.mark.usefixtures("without_figures", "units_once")

HEAD = """model = "table"
[columns]
x = { role = "ROLE", unit = "UNIT" }
clock = { role = "time", unit = "s" }
measured = { role = "measured", unit = "N" }
predicted = { role = "predicted", unit = "N" }
[settings]
simulations = 300
bootstrap = 0
"""
ROWS = 400


def found(folder: Path, role: str, unit: str, x: np.ndarray, gap_of_rows: np.ndarray, noise: float) -> GapResult:
    configuration, table = folder / "gap.toml", folder / "rows.csv"
    configuration.write_text(HEAD.replace("ROLE", role).replace("UNIT", unit), encoding="utf-8")
    measured = gap_of_rows + np.random.default_rng(1).normal(0.0, noise, ROWS)
    columns = {"x": x, "clock": np.arange(ROWS) * 1.0, "measured": measured, "predicted": 0.0}
    pd.DataFrame(columns).to_csv(table, index=False)
    plan = read_gap(configuration)
    return gap.analysis_result(plan, read_data(plan, table))


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_stribecks_friction_falls_with_the_exponent_of_the_rows(tmp_path: Path, exponent: float) -> None:
    """Of a signed speed alone, without a column of the direction."""
    rng = np.random.default_rng(5)
    speed = rng.choice([-1.0, 1.0], ROWS) * rng.uniform(0.01, 0.6, ROWS)
    friction = np.sign(speed) * (20.0 + 12.0 * np.exp(-((np.abs(speed) / 0.08) ** exponent)))
    result = found(tmp_path, "speed", "m/s", speed, friction, 0.3)
    assert result.verdict == "named"
    (effect,) = result.effects
    assert effect.name == "stribeck"
    numbers = {number.name: number for number in effect.parameters}
    assert numbers["exponent"].value == exponent
    for name, made in (("level_N", 20.0), ("excess_N", 12.0), ("speed_m_per_s", 0.08)):
        width = numbers[name].high - numbers[name].low
        assert numbers[name].low - 0.5 * width <= made <= numbers[name].high + 0.5 * width  # some 4 standard errors
        assert numbers[name].value == pytest.approx(made, rel=0.05)


@pytest.mark.parametrize(("turns", "named"), [(0.25, False), (0.6, True), (2.0, True)])
def test_an_order_that_nobody_declared_needs_two_waves(tmp_path: Path, turns: float, named: bool) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi * turns, ROWS)
    result = found(tmp_path, "angle", "rad", angle, 5.0 * np.sin(5.0 * angle + 0.3), 0.5)
    assert ("gear_order" in result.names) is named
    if named:
        assert {number.name: number.value for number in result.effects[0].parameters}["order"] == 5.0


def test_a_stated_memory_needs_rows_in_order(tmp_path: Path) -> None:
    configuration, table = tmp_path / "gap.toml", tmp_path / "rows.csv"
    text = HEAD.replace("ROLE", "angle").replace("UNIT", "rad").replace('clock = { role = "time", unit = "s" }\n', "")
    text += '[[effect]]\nname = "dahl_friction"\n[effect.parameters]\nlevel_N = 5.0\nlength_rad = 0.1\n'
    configuration.write_text(text, encoding="utf-8")
    angle = np.random.default_rng(3).uniform(0.0, 6.0, ROWS)
    pd.DataFrame({"x": angle, "measured": np.sin(angle), "predicted": 0.0}).to_csv(table, index=False)
    with pytest.raises(
        InputError, match="dahl_friction has no place in these rows: its memory needs rows in the order"
    ):
        read_data(read_gap(configuration), table)


def test_orders_that_the_rows_cannot_tell_from_others_are_none_of_theirs() -> None:
    """Half of the positions per turn, whatever the noise of the encoder; rows at random places have no end."""
    rng, places = np.random.default_rng(0), np.arange(36) * 10.0
    again = np.repeat(places, 10)
    for degrees in (again, again + rng.normal(0.0, 1e-4, 360), np.r_[places, places[::-1] + rng.normal(0.0, 1e-3, 36)]):
        assert highest_order(np.deg2rad(degrees)) == pytest.approx(18.0, rel=1e-3)
    assert highest_order(rng.uniform(0.0, 6.0, 300)) == np.inf
    assert highest_order(np.zeros(5)) == np.inf


def warmed(rows: int) -> np.ndarray:
    """The temperature of a hall [degC], by day and by night."""
    hours = np.arange(rows)
    return np.asarray(22.0 + 4.0 * np.sin(hours * 0.04) + 2.0 * np.sin(hours * 0.017 + 1.0))


def test_what_warms_late_is_no_delay_of_the_channel(tmp_path: Path) -> None:
    """A part whose temperature follows that of the hall as a first order lag."""
    hall, lag = warmed(ROWS), 8.0
    part = hall.copy()
    for row in range(1, ROWS):
        part[row] += (part[row - 1] - hall[row]) * np.exp(-1.0 / lag)
    result = found(tmp_path, "temperature", "degC", hall, 3.0 * (part - 20.0), 0.3)
    assert result.verdict == "partial"
    assert result.names == ("thermal_zero",)


def test_what_all_channels_read_late_is_a_delay(tmp_path: Path) -> None:
    """The same hall, read late by a channel that also has what the prediction has."""
    configuration, table = tmp_path / "gap.toml", tmp_path / "rows.csv"
    configuration.write_text(HEAD.replace("ROLE", "temperature").replace("UNIT", "degC"), encoding="utf-8")
    clock = np.arange(ROWS) * 1.0

    def channel(t: np.ndarray) -> np.ndarray:
        return 40.0 * np.sin(0.3 * t) + 30.0 * np.sin(0.11 * t)

    noise = np.random.default_rng(1).normal(0.0, 0.3, ROWS)
    columns = {"x": warmed(ROWS), "clock": clock, "measured": channel(clock - 0.8) + noise, "predicted": channel(clock)}
    pd.DataFrame(columns).to_csv(table, index=False)
    plan = read_gap(configuration)
    assert gap.analysis_result(plan, read_data(plan, table)).names == ("delay",)


def test_three_effects_of_a_speed_are_named_without_a_curve_over_it(tmp_path: Path) -> None:
    """Dry friction that falls off, a drag, and a bias: no pair of effects of the speed has this form."""
    rng = np.random.default_rng(8)
    speed = rng.choice([-1.0, 1.0], ROWS) * np.maximum(0.6 * rng.uniform(0.0, 1.0, ROWS) ** 2, 1e-3)
    friction = np.sign(speed) * (20.0 + 12.0 * np.exp(-((speed / 0.07) ** 2))) + 15.0 * speed + 1.3
    result = found(tmp_path, "speed", "m/s", speed, friction, 0.06)
    assert set(result.names) == {"stribeck", "viscous_friction", "gauge_bias"}
    level = next(n for effect in result.effects for n in effect.parameters if n.name == "level_N")
    assert level.value == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize(("spread", "shown"), [(0.04, False), (0.6, True)])
def test_a_load_that_hardly_changes_shows_no_friction_that_grows_with_it(spread: float, shown: bool) -> None:
    load = 80.0 * (1.0 + spread * np.sin(np.arange(200) * 0.1))
    columns = (Column("T", "N m", "", role=Role.TORQUE), Column("v", "rpm", "", role=Role.SPEED))
    table = {"T": load, "v": 100.0 * np.sin(np.arange(200) * 0.3 + 0.1)}
    outputs = (Output("y", "N m", "torque"),)
    target = target_from("table", outputs, columns, table)
    for effect in (LoadFriction(), LoadViscous()):
        assert (effect.lacks(measurements_of(columns, table), target) == "") is shown


@pytest.mark.parametrize(
    ("order", "fault"), [("1e9", "must lie in"), ("60", "more waves per turn than half of the rows")]
)
def test_a_declared_order_that_rows_cannot_hold_is_a_fault(tmp_path: Path, order: str, fault: str) -> None:
    """Rows at every 3.6 degrees hold 50 waves per turn."""
    configuration, table = tmp_path / "gap.toml", tmp_path / "rows.csv"
    text = HEAD.replace("ROLE", "angle").replace("UNIT", "deg") + f'[gear]\norders = {{ "mesh" = {order} }}\n'
    configuration.write_text(text, encoding="utf-8")
    columns = {
        "x": np.arange(ROWS) * 3.6,
        "clock": np.arange(ROWS),
        "measured": np.sin(np.arange(ROWS)),
        "predicted": 0.0,
    }
    pd.DataFrame(columns).to_csv(table, index=False)
    with pytest.raises(InputError, match=rf"gear\.orders\.mesh: .*{fault}"):
        read_data(read_gap(configuration), table)

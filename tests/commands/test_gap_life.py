"""Lost motion over hours of operation: the first 600 h predict the rest of a life that is printed.

Printed (note on conditions): +12.92" in 1,550 h, 0.0024"/h after the first 600 h. The scatter and the time constant of
running in are made up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo

LATE = 0.0024 / 60.0
"""Growth of lost motion after running in [arcmin/h]."""
GROWN = 12.92 / 60.0
"""Growth in 1,550 h [arcmin]."""
RUNNING_IN = GROWN - 1550.0 * LATE
"""What running in adds: all of it in the first 600 h, but for exp(-4)."""
TIME_CONSTANT, SCATTER = 150.0, 0.002
"""Hours, and arcmin of each reading."""
OWN = {
    "name": "flank wear with running in",
    "formula": "direction * (a * time_s + b * (1 - exp(-c * time_s)))",
    "bounds": {"c": [1e-6, 4e-6]},  # a time constant of 70 to 280 h
}


def record(hours: list[float], scatter: float) -> pd.DataFrame:
    """Hysteresis loops of +-3 % of the rated torque, one at each of the hours, of flanks that wear."""
    torque = np.concatenate([np.linspace(-12.0, 12.0, 9), np.linspace(12.0, -12.0, 9)])
    loops = [
        pd.DataFrame({"time_s": 3600.0 * hour + 5.0 * np.arange(18), "torque_Nm": torque,
                      "direction": np.repeat([1.0, -1.0], 9)})
        for hour in hours
    ]  # fmt: skip
    table = pd.concat(loops, ignore_index=True)
    hour = table["time_s"] / 3600.0
    worn = RUNNING_IN * (1.0 - np.exp(-hour / TIME_CONSTANT)) + LATE * hour
    new = np.asarray(tolevo.simulate({"model": "rv_lost_motion"}, table)["twist_arcmin"])
    noise = scatter * np.random.default_rng(1).standard_normal(len(table))
    return table.assign(twist_arcmin=new + 0.5 * worn * table["direction"] + noise)


def grown(table: pd.DataFrame, twist: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Growth of lost motion from the first loop to the last [arcmin]: of the gap between both directions."""
    gap = 2.0 * (twist * table["direction"]).to_numpy()
    return float(gap[-18:].mean() - gap[:18].mean())


@pytest.mark.slow
def test_the_first_600_hours_predict_1550(tmp_path: Path) -> None:
    first = record(list(np.arange(0.0, 601.0, 10.0)), SCATTER)
    found = tolevo.gap({"model": "rv_lost_motion", "seed": 1, "effect": [OWN]}, first)
    assert found.record is not None
    (effect,) = found.record.effects
    assert effect.name == OWN["name"]
    rate = next(parameter for parameter in effect.parameters if parameter.name == "a")
    assert 2.0 * 3600.0 * rate.value == pytest.approx(LATE, rel=0.25)
    found.write(tmp_path / "gap")
    life = record([0.0, 1550.0], 0.0)
    predicted = np.asarray(tolevo.simulate(tmp_path / "gap" / "corrected.toml", life)["twist_arcmin"])
    assert grown(life, life["twist_arcmin"].to_numpy()) == pytest.approx(GROWN, rel=1e-4)
    assert grown(life, predicted) == pytest.approx(GROWN, rel=0.1)


@pytest.mark.slow
def test_wear_at_one_rate_alone_is_named_in_part() -> None:
    """The library's `wear` has one rate: while flanks run in, its form errs, and `gap` says so."""
    found = tolevo.gap({"model": "rv_lost_motion", "seed": 1}, record(list(np.arange(0.0, 601.0, 10.0)), SCATTER))
    assert found.record is not None and found.record.verdict == "partial"
    assert [effect.name for effect in found.record.effects] == ["wear"]
    assert any("time_s" in term.variables for term in found.record.remainder)

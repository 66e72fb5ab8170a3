"""Where a gap is located: one region for one cause, at its place."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import Region

Array = np.ndarray
HEAD = """
model = "table"
[columns]
"angle" = { role = "angle", unit = "deg" }
"torque" = { role = "torque", unit = "N m" }
"clock" = { role = "time", unit = "s" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
"""
LARGEST = 400.0
"""[Nm]"""


def located(folder: Path, frame: pd.DataFrame) -> Sequence[Region]:
    (folder / "gap.toml").write_text(HEAD, encoding="utf-8")
    frame.to_csv(folder / "bench.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "bench.csv")).where


def bench(seed: int, n: int = 300) -> pd.DataFrame:
    """Independent inputs, a prediction, and a measurement that is off by nothing but noise of 1."""
    rng = np.random.default_rng(seed)
    frame = pd.DataFrame({"angle": rng.uniform(0.0, 360.0, n)})
    frame["torque"] = rng.uniform(-LARGEST, LARGEST, n)
    frame["clock"] = np.arange(n) * 2.0
    frame["te_predicted"] = 0.2 * frame["torque"]
    frame["te"] = frame["te_predicted"] + rng.normal(0.0, 1.0, n)
    return frame


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("taken_up", [30.0, 100.0])
def test_dead_band_is_one_region_about_no_torque(tmp_path: Path, seed: int, taken_up: float) -> None:
    frame = bench(seed)
    frame["te"] += 3.0 * np.clip(frame["torque"] / taken_up, -1.0, 1.0)
    (only,) = located(tmp_path, frame)
    assert only.variable == "torque"
    assert only.low == pytest.approx(-only.high)
    assert 0.4 * taken_up < only.high < 1.7 * taken_up
    assert only.share > 0.95


def test_what_grows_with_the_torque_is_over_all_of_it(tmp_path: Path) -> None:
    frame = bench(5)
    frame["te"] += 0.01 * frame["torque"]
    (only,) = located(tmp_path, frame)
    assert only.low < -0.75 * LARGEST
    assert only.high > 0.75 * LARGEST


def test_a_bump_is_where_it_is(tmp_path: Path) -> None:
    frame = bench(6)
    frame["te"] += 4.0 * np.exp(-(((frame["torque"] - 200.0) / 60.0) ** 2))
    first = located(tmp_path, frame)[0]
    assert first.variable == "torque"
    assert 80.0 < first.low < 200.0 < first.high < 320.0


def test_two_causes_are_two_regions(tmp_path: Path) -> None:
    frame = bench(9)
    frame["te"] += 3.0 * np.cos(39.0 * np.radians(frame["angle"])) + 0.01 * frame["torque"]
    regions = located(tmp_path, frame)
    assert [one.kind for one in regions] == ["interval", "order"]
    assert regions[1].order == 39.0
    assert sum(one.share for one in regions) == pytest.approx(1.0, abs=0.15)


def test_noise_is_nowhere(tmp_path: Path) -> None:
    assert located(tmp_path, bench(8)) == ()


@pytest.mark.parametrize("degrees", [6.5, 12.0, 14.0])
def test_a_joint_that_hardly_turns_holds_half_a_wave_of_no_order(tmp_path: Path, degrees: float) -> None:
    """Beside a position orders end at 12; below 15 degrees not half a wave of them is in the record."""
    rng = np.random.default_rng(3)
    frame = pd.DataFrame({"angle": rng.uniform(0.0, degrees, 120), "place": rng.uniform(100.0, 400.0, 120)})
    frame["err_predicted"] = 0.1 * frame["place"]
    frame["err"] = 1.05 * frame["err_predicted"] + rng.normal(0.0, 0.1, 120)
    configuration = {
        "model": "table",
        "columns": {
            "angle": {"role": "angle", "unit": "deg"},
            "place": {"role": "position", "unit": "mm"},
            "err": {"role": "measured", "unit": "um"},
            "err_predicted": {"role": "predicted", "of": "err", "unit": "um"},
        },
    }
    frame.to_csv(tmp_path / "joint.csv", index=False)
    plan = read_gap(configuration)
    assert gap.analysis_result(plan, read_data(plan, tmp_path / "joint.csv")).spectrum.empty

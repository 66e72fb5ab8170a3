"""Ranges of the next measurement that cannot be: every fault at once, status 2, nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app

pytestmark = pytest.mark.usefixtures("without_figures", "units_once")

WRONG = """
model = "rv_transmission"
[next_measurement]
readings = 0
effects = ["complience"]
amount = { drift = -1 }
wrong = 1
[next_measurement.range]
torque_Nm = []
direction = [-0.5, 0.5]
output_speed_rpm = { values = [0, 5] }
temperature_C = [-300, 20]
te_arcsec = [0, 1]
torqe_Nm = [0, 1]
output_angle_deg = [0, inf]
time_s = [0, 1, 2]
repeat = [0, 1]
"""
SAID = (
    "next_measurement.readings: must lie in [1, 100000], got 0",
    'next_measurement.effects: "complience" is not an effect (did you mean `torsional_compliance`?)',
    "next_measurement.amount.drift: must be above 0, got -1",
    "next_measurement.wrong: is not a known key",
    "next_measurement.range.torque_Nm: is empty",
    "next_measurement.range.direction: holds neither +1 nor -1",
    "next_measurement.range.output_speed_rpm: 0 must be above 0",
    "next_measurement.range.temperature_C: -300 is below absolute zero",
    "next_measurement.range.te_arcsec: is measured, not chosen",
    "next_measurement.range.torqe_Nm: is not a column of the model (did you mean `torque_Nm`?)",
    "next_measurement.range.output_angle_deg: must be finite, got inf",
    "next_measurement.range.time_s: must be [low, high]",
    "next_measurement.range.repeat: holds labels",
)


def check(folder: Path, text: str) -> str:
    (folder / "gap.toml").write_text(text, encoding="utf-8")
    ended = CliRunner().invoke(app, ["check", str(folder / "gap.toml")])
    assert ended.exit_code == 2
    return ended.output


def test_every_fault_at_once(tmp_path: Path) -> None:
    output = check(tmp_path, WRONG)
    assert [one for one in SAID if one not in output] == []


@pytest.mark.parametrize(
    ("model", "ranges", "said"),
    [
        ("rv_lost_motion", "torque_Nm = [-4000, 400]", "torque_Nm: -4000 is beyond the momentary"),
        ("rv_batch", "temperature_C = [50, 10]", "goes from 50 down to 10: write the lower end"),
        ("assembly", "precision_weight = [-1, 5]", "precision_weight: -1 must be at least 0"),
        ("rv_batch", 'temperature_C = "5 kg"', "range.temperature_C"),
        ("rv_batch", "temperature_C = true", "temperature_C: must be [low, high], a number"),
        ("manipulator_pose", "r_mm = [5000, 6000]\nz_mm = [0, 9]", "measurement.range: holds no point"),
        ("rv_batch", 'lot = "A"', "range.lot: holds labels"),
    ],
)
def test_beyond_the_model(tmp_path: Path, model: str, ranges: str, said: str) -> None:
    output = check(tmp_path, f'model = "{model}"\n[next_measurement.range]\n{ranges}\n')
    assert said in output


def test_a_good_one_is_printed_and_can_be_read_again(tmp_path: Path) -> None:
    text = (
        'model = "rv_lost_motion"\n[next_measurement]\nreadings = 7\n[next_measurement.range]\n'
        "torque_Nm = [-400, 400]\n"
    )
    (tmp_path / "gap.toml").write_text(text)
    ended = CliRunner().invoke(app, ["check", str(tmp_path / "gap.toml")])
    assert ended.exit_code == 0
    (tmp_path / "again.toml").write_text(ended.output)
    again = CliRunner().invoke(app, ["check", str(tmp_path / "again.toml")])
    assert again.output == ended.output
    assert "readings = 7" in again.output


TABLE = """
model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"clock" = { role = "time", unit = "s" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
[next_measurement.range]
"""


@pytest.mark.parametrize(
    ("ranges", "said"),
    [
        ("te_predicted = [0, 1]", "range.te_predicted: is a prediction, not an input"),
        ("clock = [0, 30]", "range.clock: ends before the record, at 39"),
    ],
)
def test_of_a_table(tmp_path: Path, ranges: str, said: str) -> None:
    assert said in refused(tmp_path, TABLE + ranges, bench())


def test_a_column_that_the_data_have_not(tmp_path: Path) -> None:
    frame = bench()[["torque"]].rename(columns={"torque": "torque_Nm"})
    text = 'model = "rv_lost_motion"\n[next_measurement.range]\ntemperature_C = [10, 50]\n'
    output = refused(tmp_path, text, frame.assign(twist_arcmin=0.02 * frame["torque_Nm"]))
    assert "range.temperature_C: bench.csv has no such column" in output


def test_no_reach_at_the_height_of_the_data(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    frame = pd.DataFrame(
        {
            "r_mm": rng.uniform(400.0, 420.0, 30),
            "z_mm": rng.uniform(240.0, 250.0, 30),
            "phi_deg": rng.uniform(0.0, 9.0, 30),
            "dz_mm": rng.normal(size=30),
        }
    )
    text = 'model = "manipulator_pose"\n[free]\n[next_measurement.range]\nr_mm = [3000, 4000]\n'
    assert "next_measurement.range: contains no point that the model reaches" in refused(tmp_path, text, frame)


def bench() -> pd.DataFrame:
    rng = np.random.default_rng(1)
    torque = rng.uniform(-300.0, 300.0, 40)
    return pd.DataFrame({"torque": torque, "clock": np.arange(40.0), "te_predicted": 0.1 * torque,
                         "te": 0.1 * torque + rng.normal(size=40)})  # fmt: skip


def refused(folder: Path, text: str, frame: pd.DataFrame) -> str:
    (folder / "gap.toml").write_text(text, encoding="utf-8")
    frame.to_csv(folder / "bench.csv", index=False)
    words = ["gap", str(folder / "gap.toml"), str(folder / "bench.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(folder / "out"), "--quiet"])
    assert ended.exit_code == 2
    assert not (folder / "out").exists()
    return ended.output

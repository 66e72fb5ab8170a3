"""Batches that can tell nothing, through the command: clear words, never a confident name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from tolevo.cli import app

pytestmark = pytest.mark.usefixtures("without_figures")

Frame = pd.DataFrame
MODELS = {"rv_batch": 'parameters.model = "document"\n[free]\n', "assembly": "[settings]\nsimulations = 400\n"}


def units(n: int, seed: int = 1) -> Frame:
    """Measurements of about the right size, from a normal law of our own."""
    y = 0.7 + 0.24 * np.random.default_rng(seed).standard_normal(n)
    return pd.DataFrame({"unit": np.arange(1, n + 1), "backlash_arcmin": np.abs(y)})


def command(folder: Path, frame: Frame, model: str = "rv_batch") -> Result:
    (folder / "gap.toml").write_text(f'model = "{model}"\n{MODELS[model]}', encoding="utf-8")
    frame.to_csv(folder / "units.csv", index=False)
    words = ["gap", str(folder / "gap.toml"), str(folder / "units.csv"), "--quiet", "--out"]
    return CliRunner().invoke(app, [*words, str(folder / "out")])


def written(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "out" / "gap.json").read_text(encoding="utf-8"))
    return found


def test_three_units(tmp_path: Path) -> None:
    ended = command(tmp_path, units(3))
    assert ended.exit_code == 2
    assert "cannot tell with n = 3; a batch needs at least 12 units" in " ".join(ended.output.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("repeat", [False, True])
def test_one_unit_measured_many_times(tmp_path: Path, repeat: bool) -> None:
    frame = units(40).assign(unit=1)
    ended = command(tmp_path, frame.assign(repeat=np.arange(40)) if repeat else frame)
    assert ended.exit_code == 2
    assert "holds 1 units in 40 rows: cannot tell with n = 1" in " ".join(ended.output.split())


def test_identical_values(tmp_path: Path) -> None:
    ended = command(tmp_path, units(40).assign(backlash_arcmin=0.8))
    assert ended.exit_code == 2
    assert "is the same in every row" in " ".join(ended.output.split())


def test_nearly_identical_values_have_no_input(tmp_path: Path) -> None:
    y = 0.8 + 1e-6 * np.arange(40)
    ended = command(tmp_path, units(40).assign(backlash_arcmin=y))
    assert ended.exit_code == 0, ended.output
    found = written(tmp_path)
    assert found["effects"] == []
    assert {one["verdict"] for one in found["attribution"]} == {"cannot tell"}
    assert any(one["statistic"] == "standard deviation" and one["verdict"] == "differs"
               for one in found["population"])  # fmt: skip


def test_two_lots_of_one_unit_each(tmp_path: Path) -> None:
    ended = command(tmp_path, units(2).assign(lot=["A", "B"]))
    assert ended.exit_code == 2
    assert "cannot tell with n = 2" in " ".join(ended.output.split())


def test_lots_of_one_unit_beside_a_large_one(tmp_path: Path) -> None:
    """Both far off: nothing is said of lots that cannot be compared."""
    frame = units(42).assign(lot=["A"] * 40 + ["B", "C"])
    frame.loc[40:, "backlash_arcmin"] += 2.0
    ended = command(tmp_path, frame)
    assert ended.exit_code == 0, ended.output
    found = written(tmp_path)
    assert "lot_offset" not in [one["name"] for one in found["effects"]]
    assert not any(one["verdict"] == "attributed" for one in found["attribution"])
    assert not any(one["aspect"] == "lots" for one in found["population"])
    assert any("B, C" in note for note in found["notes"])


@pytest.mark.parametrize("lot", [np.nan, ""])
def test_lots_without_a_label(tmp_path: Path, lot: float | str) -> None:
    frame = units(40).assign(lot=["A"] * 20 + ["B"] * 20)
    frame.loc[3:5, "lot"] = lot
    ended = command(tmp_path, frame)
    assert ended.exit_code == 2
    assert "column lot" in ended.output
    assert "row 5" in ended.output
    assert not (tmp_path / "out").exists()


def test_twelve_units_far_off_have_no_input(tmp_path: Path) -> None:
    frame = units(12)
    ended = command(tmp_path, frame.assign(backlash_arcmin=frame["backlash_arcmin"] + 3.0))
    assert ended.exit_code == 0, ended.output
    found = written(tmp_path)
    assert found["effects"] == []
    (one,) = found["attribution"]
    assert one["verdict"] == "cannot tell"
    assert "cannot tell with n = 12" in one["text"]
    assert "cannot tell with n = 12" in ended.output
    assert any(one["verdict"] == "differs" for one in found["population"])


def test_units_that_may_be_anything_are_of_no_input(tmp_path: Path) -> None:
    """Measurements of another product: a wide, even spread from 5 to 50 arcmin."""
    y = np.random.default_rng(2).uniform(5.0, 50.0, 60)
    ended = command(tmp_path, units(60).assign(backlash_arcmin=y))
    assert ended.exit_code == 0, ended.output
    assert not any(one["verdict"] == "attributed" for one in written(tmp_path)["attribution"])


def assembly(n: int, seed: int = 1) -> Frame:
    """Measurements that are not of the model: random angles beside random parts."""
    rng = np.random.default_rng(seed)
    names = [f"{part}_{k}_mrad" for part in ("dtheta", "delta") for k in range(1, 5)]
    frame = pd.DataFrame({name: rng.normal(0.0, 3.0, n) for name in names})
    return frame.assign(unit=np.arange(n), precision_weight=5.0)


def test_constant_outputs_of_an_assembly(tmp_path: Path) -> None:
    ended = command(tmp_path, assembly(40).assign(delta_2_mrad=1.0), "assembly")
    assert ended.exit_code == 2
    assert "delta_2_mrad" in ended.output
    assert "is the same in every row" in " ".join(ended.output.split())


def test_parts_all_alike_at_one_weight(tmp_path: Path) -> None:
    """Nothing that was set varies: the same assembly again and again."""
    alike = {f"dtheta_{k}_mrad": 2.0 for k in range(1, 5)}
    ended = command(tmp_path, assembly(60).assign(**alike), "assembly")
    assert ended.exit_code == 2
    assert "no input varies" in ended.output
    assert not (tmp_path / "out").exists()


def test_parts_all_alike_and_angles_at_random(tmp_path: Path) -> None:
    alike = {f"dtheta_{k}_mrad": 2.0 for k in range(1, 5)}
    weights = np.resize([0.0, 5.0], 40)
    frame = assembly(40).assign(**alike, precision_weight=weights)
    ended = command(tmp_path, frame, "assembly")
    assert ended.exit_code == 0, ended.output
    assert not any(one["verdict"] == "attributed" for one in written(tmp_path)["attribution"])


def test_few_assemblies_have_no_input(tmp_path: Path) -> None:
    ended = command(tmp_path, assembly(14), "assembly")
    assert ended.exit_code == 0, ended.output
    found = written(tmp_path)
    assert found["attribution"] == []
    said = {one["verdict"] for one in found["population"]} - {"differs"}
    assert all(one.startswith("cannot tell with n = ") for one in said)


def test_one_assembly_measured_many_times(tmp_path: Path) -> None:
    """60 rows of the same unit are one assembly."""
    rng = np.random.default_rng(4)
    names = [*(f"dtheta_{k}_mrad" for k in range(1, 5)), *(f"delta_{k}_mrad" for k in range(1, 5))]
    frame = pd.DataFrame(rng.normal(size=(60, 8)), columns=names).assign(unit=1, precision_weight=5)
    (tmp_path / "gap.toml").write_text('model = "assembly"\n', encoding="utf-8")
    frame.to_csv(tmp_path / "units.csv", index=False)
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "units.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(tmp_path / "out"), "--quiet"])
    assert ended.exit_code == 2
    assert "cannot tell with n = 1" in " ".join(ended.output.split())
    assert not (tmp_path / "out").exists()


def test_readings_beyond_all_measure(tmp_path: Path) -> None:
    ended = command(tmp_path, units(40).assign(backlash_arcmin=1e300))
    assert ended.exit_code == 2
    assert "beyond all measurable values" in " ".join(ended.output.split())

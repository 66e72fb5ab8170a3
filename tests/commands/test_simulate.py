from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo
from tolevo.errors import InputError

BATCH = {"model": "rv_batch"}


def table(folder: Path, content: str) -> Path:
    path = folder / "units.csv"
    path.write_text(content)
    return path


def test_outputs_beside_the_inputs(tmp_path: Path) -> None:
    path = table(tmp_path, "unit,lot,time_s,backlash_arcmin_std\n007,A,0,0.01\nx,B,5,0.01\n")
    found = tolevo.simulate(BATCH, path, tmp_path / "out.csv")
    names = ["unit", "lot", "time_s", "backlash_arcmin_std", "backlash_arcmin"]
    assert found.columns.tolist() == names
    written = pd.read_csv(tmp_path / "out.csv", dtype={"unit": str})
    assert written.columns.tolist() == names
    assert written["unit"].tolist() == ["007", "x"]
    assert written["backlash_arcmin"].tolist() == found["backlash_arcmin"].tolist()


def test_missing_optional_columns_are_said(tmp_path: Path) -> None:
    found = tolevo.simulate(BATCH, table(tmp_path, "unit\n1\n"))
    said = "\n".join(found.attrs["notes"])
    assert "temperature_C" in said
    assert "lot" in said


def test_parquet_by_suffix(tmp_path: Path) -> None:
    path = table(tmp_path, "unit\n1\n2\n")
    out = tmp_path / "out.parquet"
    first = tolevo.simulate(BATCH, path, out)
    pd.read_parquet(out)[["unit"]].to_parquet(tmp_path / "in.parquet")
    again = tolevo.simulate(BATCH, tmp_path / "in.parquet")
    assert again["backlash_arcmin"].tolist() == first["backlash_arcmin"].tolist()


def test_seed_zero_is_a_seed(tmp_path: Path) -> None:
    path = table(tmp_path, "unit\n1\n2\n")
    one, two, other = (tolevo.simulate({**BATCH, "seed": seed}, path)["backlash_arcmin"].tolist() for seed in (0, 0, 1))
    assert one == two != other


def test_every_fault_at_once_and_nothing_written(tmp_path: Path) -> None:
    path = table(tmp_path, "backlash_arcmin,temperatur_C,time_s\n1,2,x\n")
    with pytest.raises(InputError) as caught:
        tolevo.simulate(BATCH, path, tmp_path / "out.csv")
    said = str(caught.value)
    assert "units.csv: column unit is missing" in said
    assert "temperatur_C is not known (did you mean `temperature_C`?)" in said
    assert 'units.csv: row 2, column time_s: must be a number, got "x"' in said
    assert [file.name for file in tmp_path.iterdir()] == ["units.csv"]


def test_a_measurement_table_is_taken(tmp_path: Path) -> None:
    """Its measured output gives way to the prediction, its other columns stay."""
    content = "unit,session,repeat,time_s,backlash_arcmin,backlash_arcmin_std\n7,monday,1,0,99,1\n"
    found = tolevo.simulate(BATCH, table(tmp_path, content))
    assert found.columns.tolist() == [
        "unit", "session", "repeat", "time_s", "backlash_arcmin_std", "backlash_arcmin",
    ]  # fmt: skip
    assert found["session"].tolist() == ["monday"]
    assert found["backlash_arcmin"][2] < 10.0
    assert any("backlash_arcmin as written are predictions" in note for note in found.attrs["notes"])
    bare = tolevo.simulate(BATCH, table(tmp_path, "unit\n7\n"))
    assert bare["backlash_arcmin"].tolist() == found["backlash_arcmin"].tolist()
    assert not any("predictions" in note for note in bare.attrs["notes"])


@pytest.mark.parametrize("grain", [8, 65_536])
@pytest.mark.parametrize(
    ("more", "worn"),
    [
        ("", False),
        ("lots", False),
        ("repeats", False),
        ("labels", False),
        ("", True),
        ("lots", True),
        ("repeats", True),
    ],
)
def test_a_value_follows_the_number_of_its_unit(
    grain: int, more: str, worn: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shuffled rows of 20 units have the values of their units, in the order of the rows."""
    monkeypatch.setattr("tolevo.commands.simulate.GRAIN", grain)
    frame = pd.DataFrame({"unit": range(1, 21)})
    if more == "labels":
        frame["unit"] = [f"B{at}" for at in frame["unit"]]
    if more == "lots":
        frame = pd.DataFrame({"unit": [*range(1, 11)] * 2, "lot": ["A"] * 10 + ["B"] * 10})
    if more == "repeats":
        frame = pd.DataFrame({"unit": [*range(1, 11)] * 2, "repeat": [1] * 10 + [2] * 10})
    keys = [name for name in ("lot", "unit", "repeat") if name in frame]
    effect = {"name": "tool_wear_drift", "parameters": {"rate_per_unit_arcmin": 0.01}}
    config = BATCH | ({"effect": [effect]} if worn else {})
    values = tolevo.simulate(config, frame).set_index(keys)["backlash_arcmin"]
    for seed in (1, 2):
        shuffled = frame.sample(frac=1.0, random_state=seed)
        found = tolevo.simulate(config, shuffled)
        assert found[keys].to_numpy().tolist() == shuffled[keys].to_numpy().tolist()
        assert found.set_index(keys)["backlash_arcmin"].loc[values.index].tolist() == values.tolist()
    assert values.nunique() == (10 if more == "repeats" else 20)


RECORDED = {
    "model": "table",
    "columns": {
        "speed_mm_s": {"role": "speed", "unit": "mm/s"},
        "temp_C": {"role": "temperature", "unit": "degC"},
        "model_N": {"role": "predicted", "unit": "N", "of": "force_N"},
        "force_N": {"role": "measured", "unit": "N"},
    },
    "effect": [{"name": "drag", "formula": "c * speed_mm_s * temp_C", "parameters": {"c": 0.001}}],
    "unresolved": [{"output": "force_N", "variable": "speed_mm_s", "shape": "power", "exponent": 0.5, "scale": 300.0,
                    "signed": True, "coefficients": [2.0]}],
    "record": {"speed_mm_s": [-300.0, 300.0], "temp_C": [20, 40]},
}  # fmt: skip


def test_a_row_beyond_the_record_is_named_and_its_terms_stay_as_at_the_end() -> None:
    """0.001 v T goes on by its formula; 2 (v/300)^0.5 stays at 2 beyond 300 mm/s."""
    told = list[str]()
    points = pd.DataFrame({"speed_mm_s": [75.0, -1200.0, 100.0], "temp_C": [30.0, 10.0, 50.0], "model_N": 1.0})
    found = tolevo.simulate(RECORDED, points, tell=told.append)
    by_hand = np.array(
        [0.001 * 75.0 * 30.0 + 1.0, -0.001 * 1200.0 * 10.0 - 2.0, 0.001 * 100.0 * 50.0 + 2.0 / np.sqrt(3.0)]
    )
    np.testing.assert_allclose(found["force_N_correction"], by_hand, rtol=1e-12)
    np.testing.assert_allclose(found["force_N"], 1.0 + by_hand, rtol=1e-12)
    assert list(found["outside_record"]) == ["", "speed_mm_s, temp_C", "temp_C"]
    note = next(line for line in told if "leave the record" in line)
    assert "2 of 3 rows" in note and "drag by its formula and terms without a name as at the end" in note


def test_a_correction_without_a_record_adds_no_columns() -> None:
    points = pd.DataFrame({"speed_mm_s": [75.0], "temp_C": [30.0], "model_N": [1.0]})
    table = {key: value for key, value in RECORDED.items() if key != "record"}
    assert list(tolevo.simulate(table, points).columns)[-1] == "force_N"


def test_the_range_of_a_record_is_two_numbers() -> None:
    wrong = {**RECORDED, "record": {"speed_mm_s": [1.0], "temp_C": "20 to 40"}}
    with pytest.raises(InputError) as caught:
        tolevo.simulate(wrong, pd.DataFrame({"speed_mm_s": [1.0], "temp_C": [1.0], "model_N": [1.0]}))
    assert [fault.place for fault in caught.value.faults] == ["record.speed_mm_s", "record.temp_C"]

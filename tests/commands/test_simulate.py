from pathlib import Path

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

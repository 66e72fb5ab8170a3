"""Bad input of a gap analysis: said in words, status 2 or a stated limitation, never a name."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from tolevo.cli import app
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.gap import record
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.errors import InputError

pytestmark = pytest.mark.usefixtures("without_figures", "units_once")

HEAD = """
model = "table"
seed = 0
[columns]
"torque" = { role = "torque", unit = "N m" }
"warmth" = { role = "temperature", unit = "degC" }
"clock" = { role = "time", unit = "s" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
"""
COMPLIANCE = 0.05
"""[arcsec/Nm]"""


def bench(n: int = 240, seed: int = 0) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    torque = rng.uniform(-400.0, 400.0, n)
    predicted = 0.2 * torque
    te = predicted + COMPLIANCE * torque + 3.0 + rng.normal(0.0, 2.0, n)
    warmth, clock = rng.uniform(20.0, 40.0, n), np.arange(n) * 1.0
    return pd.DataFrame({"torque": torque, "warmth": warmth, "clock": clock, "te": te, "te_predicted": predicted})


def found(folder: Path, frame: pd.DataFrame, text: str = HEAD) -> GapResult:
    configuration, table = folder / "gap.toml", folder / "bench.csv"
    configuration.write_text(text, encoding="utf-8")
    frame.to_csv(table, index=False)
    plan = read_gap(configuration)
    return gap.analysis_result(plan, read_data(plan, table))


def refused(folder: Path, frame: pd.DataFrame, text: str = HEAD) -> str:
    with pytest.raises(InputError) as caught:
        found(folder, frame, text)
    return str(caught.value)


def command(folder: Path, frame: pd.DataFrame, text: str = HEAD) -> Result:
    (folder / "gap.toml").write_text(text, encoding="utf-8")
    frame.to_csv(folder / "bench.csv", index=False)
    words = ["gap", str(folder / "gap.toml"), str(folder / "bench.csv"), "--out"]
    return CliRunner().invoke(app, [*words, str(folder / "out"), "--quiet"])


def test_the_bench_itself_is_named(tmp_path: Path) -> None:
    result = found(tmp_path, bench())
    assert result.names == ("torsional_compliance",)
    (number,) = result.effects[0].parameters
    assert number.low < COMPLIANCE < number.high


def test_missing_column(tmp_path: Path) -> None:
    ended = command(tmp_path, bench().drop(columns="torque"))
    assert ended.exit_code == 2
    assert "bench.csv: column torque is missing" in ended.output
    assert not (tmp_path / "out").exists()


def test_faults_of_configuration_and_output_together(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_text("x", encoding="utf-8")
    ended = command(
        tmp_path, bench(), HEAD.replace('"measured", unit = "arcsec"', '"measured", unit = "kg"') + "[free]\na = 1\n"
    )
    assert ended.exit_code == 2
    assert '"arcsec" does not fit te, which is in "kg"' in ended.output
    assert "--out" in ended.output


def test_units_that_do_not_fit(tmp_path: Path) -> None:
    said = refused(tmp_path, bench(), HEAD.replace('"N m"', '"mm"'))
    assert 'columns.torque.unit: must be a unit of torque such as "N m", got "mm"' in said


def test_constant_columns_are_said(tmp_path: Path) -> None:
    result = found(tmp_path, bench().assign(warmth=20.0))
    assert any("warmth is the same in every row" in note for note in result.notes)
    assert result.names == ("torsional_compliance",)


def test_measured_that_never_changes(tmp_path: Path) -> None:
    assert "is the same in every row: nothing was measured" in refused(tmp_path, bench().assign(te=1.0))


def test_duplicated_column_names(tmp_path: Path) -> None:
    said = refused(tmp_path, bench().rename(columns={"warmth": "torque"}))
    assert "column torque appears 2 times" in said


def test_copies_cannot_be_told_apart(tmp_path: Path) -> None:
    frame = bench()
    text = HEAD + '"third" = { role = "input", unit = "mm" }\n'
    result = found(tmp_path, frame.assign(third=frame["torque"]), text)
    assert any("third is a copy of torque" in n or "torque is a copy of third" in n
               for n in result.notes)  # fmt: skip


def test_rows_that_were_joined_twice_are_said(tmp_path: Path) -> None:
    """The interval is narrower by the root of 2, without a new measurement."""
    once = bench(60).drop(columns="clock")
    head = HEAD.replace('"clock" = { role = "time", unit = "s" }\n', "")
    single, double = found(tmp_path, once, head), found(tmp_path, pd.concat([once, once]), head)
    assert not any("others again" in note for note in single.notes)
    (note,) = [note for note in double.notes if "others again" in note]
    assert note.startswith("60 of 120 rows are others again, the measured values included")
    widths = [result.effects[0].parameters[0].high - result.effects[0].parameters[0].low for result in (single, double)]
    assert widths[0] / widths[1] == pytest.approx(np.sqrt(2.0), rel=0.1)


def test_collinear_columns_are_said(tmp_path: Path) -> None:
    frame = bench()
    frame["third"] = 0.3 * frame["torque"] + 4.0 * frame["warmth"]
    text = HEAD + '"third" = { role = "input", unit = "mm" }\n'
    result = found(tmp_path, frame, text)
    assert any("are collinear" in note and "third" in note for note in result.notes)


def test_fewer_rows_than_numbers(tmp_path: Path) -> None:
    assert "has 8 rows" in refused(tmp_path, bench(8))


@pytest.mark.parametrize("cell", ["nan", "inf", "-inf", "", "broken"])
def test_cells_that_are_no_number_are_named(tmp_path: Path, cell: str) -> None:
    frame = bench().astype(object)
    frame.loc[6, "te"] = cell
    said = refused(tmp_path, frame)
    assert "bench.csv: row 8, column te" in said
    assert "data.drop_bad_rows" in said


def test_bad_rows_are_dropped_if_asked(tmp_path: Path) -> None:
    frame = bench().astype(object)
    frame.loc[6, "te"] = "nan"
    result = found(tmp_path, frame, HEAD.replace("[columns]", "[data]\ndrop_bad_rows = true\n[columns]"))
    assert any("1 rows" in note and "rows 8" in note for note in result.notes)
    assert len(result.residuals) == 239


def test_time_out_of_order(tmp_path: Path) -> None:
    frame = bench()
    mixed = frame.sample(frac=1.0, random_state=1)
    result = found(tmp_path, mixed)
    assert any("put in the order of clock" in note for note in result.notes)
    np.testing.assert_array_equal(result.residuals["te"], frame["te"])


def test_one_angle_takes_no_effect_of_the_angle(tmp_path: Path) -> None:
    """A bench that is stiffer than its model, at one angle: no wave of the teeth."""
    stiff = bench().assign(angle=33.0)
    stiff["te"] -= 2.0 * COMPLIANCE * stiff["torque"]
    text = HEAD + '"angle" = { role = "angle", unit = "deg" }\n'
    assert found(tmp_path, stiff, text).verdict == "unnamed"


def test_a_clock_that_begins_late_is_said(tmp_path: Path) -> None:
    """Wear and creep count from 0: with the seconds of a day they are another effect."""
    late = bench().assign(clock=np.arange(240) + 5000.0)
    assert any("clock begins at 5000 s" in note for note in found(tmp_path, late).notes)
    assert not any("begins at" in note for note in found(tmp_path, bench()).notes)


def test_time_with_gaps(tmp_path: Path) -> None:
    frame = bench()
    frame.loc[120:, "clock"] += 5000.0
    assert any("broken by 1 gaps" in note for note in found(tmp_path, frame).notes)


def test_outliers_are_counted_and_do_not_count(tmp_path: Path) -> None:
    frame = bench()
    frame.loc[[10, 60, 200], "te"] += [90.0, -120.0, 400.0]
    result = found(tmp_path, frame)
    assert result.gate.outputs[0].outliers == 3
    assert result.residuals["te_outlier"].sum() == 3
    assert result.names == ("torsional_compliance",)
    assert any("3 outliers" in note for note in result.notes)


def test_prediction_that_copies_the_measurement(tmp_path: Path) -> None:
    frame = bench()
    assert "is a copy of te" in refused(tmp_path, frame.assign(te_predicted=frame["te"]))
    assert "is a copy of te" in refused(tmp_path, frame.assign(te_predicted=frame["te"] - 3.3))


@pytest.mark.parametrize("content", ["", "torque,warmth,clock,te,te_predicted\n"])
def test_no_rows(tmp_path: Path, content: str) -> None:
    (tmp_path / "gap.toml").write_text(HEAD, encoding="utf-8")
    (tmp_path / "bench.csv").write_text(content, encoding="utf-8")
    plan = read_gap(tmp_path / "gap.toml")
    with pytest.raises(InputError):
        read_data(plan, tmp_path / "bench.csv")


def test_noise_of_zero(tmp_path: Path) -> None:
    frame = bench().assign(te_std=2.0)
    frame.loc[3, "te_std"] = 0.0
    said = refused(tmp_path, frame, HEAD + '"te_std" = { role = "std", unit = "arcsec" }\n')
    assert "row 5, column te_std: must be above 0" in said


def test_direction_that_is_none(tmp_path: Path) -> None:
    frame = bench().assign(way=1.0)
    frame.loc[0, "way"] = 0.5
    said = refused(tmp_path, frame, HEAD + '"way" = { role = "direction" }\n')
    assert "row 2, column way: a direction is +1 or -1" in said


OUTSIDE = {
    "manipulator_pose": ("r_mm,z_mm,phi_deg,dr_mm", "5000,200,0,{}", "r_mm: is out of reach"),
    "rv_transmission": ("output_angle_deg,torque_Nm,output_speed_rpm,te_arcsec", "0,9999,5,{}",
                        "torque_Nm: is beyond the momentary torque"),
    "rv_lost_motion": ("torque_Nm,direction,twist_arcmin", "-9999,1,{}",
                       "torque_Nm: is beyond the momentary torque"),
    "assembly": ("unit,dtheta_1_mrad,dtheta_2_mrad,dtheta_3_mrad,dtheta_4_mrad,precision_weight,"
                 "delta_1_mrad", "{0},0,0,0,0,-1,{0}", "precision_weight: must be at least 0"),
    "rv_batch": ("unit,temperature_C,backlash_arcmin", "{0},-300,{0}",
                 "temperature_C: is below absolute zero"),
}  # fmt: skip


@pytest.mark.parametrize("model", OUTSIDE)
def test_outside_of_a_models_range(tmp_path: Path, model: str) -> None:
    """Every row is named by its line, and nothing by an effect."""
    head, row, said = OUTSIDE[model]
    (tmp_path / "gap.toml").write_text(f'model = "{model}"\n', encoding="utf-8")
    lines = [head, *(row.format(0.01 * at) for at in range(60))]
    (tmp_path / "bench.csv").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_data(read_gap(tmp_path / "gap.toml"), tmp_path / "bench.csv")
    named = [str(one) for one in caught.value.faults]
    assert named[0].startswith(f"bench.csv: row 2, column {said}")
    assert named[-1].startswith("bench.csv: row 61, column")


def test_colder_than_cold_in_the_unit_of_the_column(tmp_path: Path) -> None:
    frame = bench().assign(warmth=300.0 + np.arange(240))
    frame.loc[5, "warmth"] = -1.0
    said = refused(tmp_path, frame, HEAD.replace('"degC"', '"K"'))
    assert said == "bench.csv: row 7, column warmth: is below absolute zero"


def test_faults_of_configuration_and_data_in_one_report(tmp_path: Path) -> None:
    """Those of the form of the table, of its cells, and of every section."""
    frame = bench().drop(columns="warmth").astype(object)
    frame.loc[3, "te"] = "x"
    text = HEAD + '[noise]\ntee = 1.0\n[validation]\nblocks = "clok"\n[settings]\nfoo = 1\n'
    (tmp_path / "gap.toml").write_text(text, encoding="utf-8")
    content = frame.to_csv(index=False) + "1,2,3\n"
    (tmp_path / "bench.csv").write_text(content, encoding="utf-8")
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "bench.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(tmp_path / "out"), "--workers", "0"])
    assert ended.exit_code == 2
    for part in (
        "noise.tee: is not a measured output (did you mean `te`?)",
        "settings.foo: is not a known key",
        "--workers: must be at least 1",
        "bench.csv: row 242: 4 cells expected",
        "bench.csv: column warmth is missing",
        "bench.csv: row 5, column te: must be a number",
        'validation.blocks: bench.csv has no column "clok" (did you mean `clock`?)',
    ):
        assert part in ended.output, part
    assert not (tmp_path / "out").exists()


def test_blocks_that_hold_nothing_out(tmp_path: Path) -> None:
    frame = bench().assign(warmth=20.0)
    said = refused(tmp_path, frame, HEAD + '[validation]\nblocks = "warmth"\n')
    assert "validation.blocks: warmth is the same in every row" in said


def test_a_session_may_stand_beside(tmp_path: Path) -> None:
    """A column that the contract names; it is said what it would be good for."""
    (tmp_path / "gap.toml").write_text('model = "rv_batch"\nparameters.model = "document"\n', encoding="utf-8")
    table = pd.DataFrame({"unit": range(30), "session": ["a", "b"] * 15})
    table.assign(backlash_arcmin=np.linspace(0.0, 1.0, 30)).to_csv(tmp_path / "b.csv", index=False)
    data = read_data(read_gap(tmp_path / "gap.toml"), tmp_path / "b.csv")
    assert any("every session may have a separate level" in note for note in data.notes)
    data = read_data(read_gap(tmp_path / "gap.toml", ["validation.blocks=session"]), tmp_path / "b.csv")
    assert data.blocks is not None
    assert data.blocks.tolist() == ["a", "b"] * 15
    assert "session" not in " ".join(data.notes)


def test_what_any_table_may_add_needs_no_role(tmp_path: Path) -> None:
    """time_s is the order of measuring, <output>_std the known noise, by their names alone."""
    frame = bench().assign(repeat=0, session="a", te_std=2.0)
    frame = frame.rename(columns={"clock": "time_s"}).iloc[::-1]
    text = "\n".join(line for line in HEAD.splitlines() if "clock" not in line)
    result = found(tmp_path, frame, text)
    assert result.names == ("torsional_compliance",)
    assert result.residuals["time_s"].is_monotonic_increasing
    assert result.noise_floor["te"] == pytest.approx(2.0)


@pytest.mark.parametrize("content", [b"PK\x03\x04\xff\xfe", b"a\0b,c\n", "größe;\n1;".encode("mac_roman")])
def test_what_is_no_text(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "gap.toml").write_text(HEAD, encoding="utf-8")
    (tmp_path / "bench.csv").write_bytes(content)
    with pytest.raises(
        InputError, match=r"bench\.csv: (is not (a workbook|text)|the encoding cannot be determined|has no)"
    ):
        read_data(read_gap(tmp_path / "gap.toml"), tmp_path / "bench.csv")


def test_noise_of_something_that_is_not_measured(tmp_path: Path) -> None:
    said = refused(tmp_path, bench(), HEAD + "[noise]\ntee = 1.0\n")
    assert "noise.tee: is not a measured output (did you mean `te`?)" in said


def test_everything_wrong_is_said_at_once(tmp_path: Path) -> None:
    text = HEAD.replace("seed = 0", "sed = 0") + "[free]\na = 1\n[settings]\nbootstrap = -1\n"
    said = refused(tmp_path, bench(), text)
    for part in ("sed: is not a known key", "free.a", "settings.bootstrap: must be at least 0"):
        assert part in said


def test_same_data_same_file(tmp_path: Path) -> None:
    ended = command(tmp_path, bench())
    assert ended.exit_code == 0, ended.output
    first = (tmp_path / "out" / "gap.json").read_bytes()
    again = tmp_path / "again"
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "bench.csv"), "--out", str(again)]
    assert CliRunner().invoke(app, [*words, "--quiet", "--workers", "2"]).exit_code == 0
    assert (again / "gap.json").read_bytes() == first
    assert json.loads(first)["verdict"] == "named"
    assert str(tmp_path) not in first.decode()


def test_corrected_configuration_simulates(tmp_path: Path) -> None:
    """The corrected table model adds what was found to the prediction that the table carries."""
    frame = bench()
    assert command(tmp_path, frame).exit_code == 0
    out = tmp_path / "again.csv"
    frame.drop(columns="te").to_csv(tmp_path / "inputs.csv", index=False)
    words = ["simulate", str(tmp_path / "out" / "corrected.toml"), str(tmp_path / "inputs.csv")]
    ended = CliRunner().invoke(app, [*words, "--out", str(out), "--quiet"])
    assert ended.exit_code == 0, ended.output
    left = frame["te"] - pd.read_csv(out)["te"]
    assert left.std() == pytest.approx(2.0, rel=0.15)
    assert "outside_record" not in pd.read_csv(out).columns
    spanned = tomllib.loads((tmp_path / "out" / "corrected.toml").read_text(encoding="utf-8"))["record"]
    for name, ends in spanned.items():
        assert ends == [frame[name].min(), frame[name].max()]
    assert len(spanned) >= 2


def test_what_is_in_the_model_already_is_no_gap(tmp_path: Path) -> None:
    """The corrected model, given back with the same data, has nothing to add."""
    rng = np.random.default_rng(0)
    n = 300
    inputs = pd.DataFrame({"output_angle_deg": rng.uniform(0, 360, n), "torque_Nm": rng.uniform(-400, 400, n)})
    inputs["output_speed_rpm"], inputs["direction"] = rng.uniform(2, 30, n), rng.choice([-1, 1], n)
    simulated = tmp_path / "te.csv"
    inputs.to_csv(tmp_path / "inputs.csv", index=False)
    (tmp_path / "gap.toml").write_text('model = "rv_transmission"\n', encoding="utf-8")
    words = ["simulate", str(tmp_path / "gap.toml"), str(tmp_path / "inputs.csv")]
    assert CliRunner().invoke(app, [*words, "--out", str(simulated), "--quiet"]).exit_code == 0
    frame = pd.read_csv(simulated)
    frame["te_arcsec"] += 3.0 * inputs["direction"] + rng.normal(0.0, 2.0, n)
    ended = command(tmp_path, frame, 'model = "rv_transmission"\n[free]\n')
    assert ended.exit_code == 0, ended.output
    said = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert [one["name"] for one in said["effects"]] == ["friction_hysteresis"]
    corrected = (tmp_path / "out" / "corrected.toml").read_text(encoding="utf-8") + "[free]\n"
    assert found(tmp_path, frame, corrected).verdict == "no_gap"


def test_intervals_from_the_bootstrap(tmp_path: Path) -> None:
    result = found(tmp_path, bench(120), HEAD.replace("seed = 0", "seed = 0\n[settings]\nbootstrap = 30"))
    (effect,) = result.effects
    (number,) = effect.parameters
    assert effect.frequency > 0.9
    assert number.low < COMPLIANCE < number.high
    assert number.high - number.low == pytest.approx(2 * 1.645 * 2.0 / np.sqrt(120) / 231.0, rel=0.5)


def test_readings_in_degrees_are_named_as_those_in_seconds(tmp_path: Path) -> None:
    """A step of a reading is in degrees then, and no phase of a circle."""
    frame = bench()
    frame[["te", "te_predicted"]] /= 3600.0
    result = found(tmp_path, frame, HEAD.replace("arcsec", "deg"))
    assert result.names == ("torsional_compliance",)
    (number,) = result.effects[0].parameters
    assert number.low < COMPLIANCE / 3600.0 < number.high


def test_regions_say_where_they_begin_and_end(tmp_path: Path) -> None:
    regions = record(found(tmp_path, bench()))["where"]
    assert {"output", "variable", "region", "order", "share"} <= set(regions[0])
    assert regions[0]["variable"] == "torque"
    low, high = regions[0]["region"]
    assert -400.0 <= low < high <= 400.0

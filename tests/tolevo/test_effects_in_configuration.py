"""`[[effect]]`: read, checked, written again, and active in what is simulated."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.configuration import Configuration
from tolevo.configuration.reader import read
from tolevo.errors import InputError

EXPANSION = """[[effect]]
name = "differential_thermal_expansion"
[effect.parameters]
temperature_difference_K = 5.0
"""


def config(folder: Path, effects: str, head: str = 'model = "rv_batch"\n') -> Path:
    path = folder / "config.toml"
    path.write_text(head + effects)
    return path


def loaded(folder: Path, effects: str, head: str = 'model = "rv_batch"\n') -> Configuration:
    return read(config(folder, effects, head))


def refused(folder: Path, effects: str, head: str = 'model = "rv_batch"\n') -> list[str]:
    with pytest.raises(InputError) as caught:
        loaded(folder, effects, head)
    return [str(fault) for fault in caught.value.faults]


def one(name: str, parameters: str) -> str:
    return f'[[effect]]\nname = "{name}"\nparameters = {{ {parameters} }}\n'


def test_effects_of_a_model(tmp_path: Path) -> None:
    found = loaded(tmp_path, EXPANSION + one("lot_mixture", 'share = 0.25, offset = "6 arcsec"'))
    first, second = found.settings.effects
    assert (first.effect.name, dict(first.values)) == (
        "differential_thermal_expansion",
        {"temperature_difference_K": 5.0},
    )
    given = dict(second.values)
    assert given["offset_arcmin"] == pytest.approx(0.1, rel=1e-12)
    assert given["share"] == 0.25


def test_resolved_configuration_is_read_again(tmp_path: Path) -> None:
    for head in ('model = "rv_batch"\n', 'problem = "rv_backlash"\n'):
        found = loaded(tmp_path, EXPANSION + one("process_mean_shift", "shift_arcmin = -0.1"), head)
        again = loaded(tmp_path, found.toml(), "")
        assert again.toml() == found.toml()
        assert [dict(active.values) for active in again.settings.effects] == [
            {"temperature_difference_K": 5.0},
            {"shift_arcmin": -0.1},
        ]


def test_every_fault_at_once(tmp_path: Path) -> None:
    text = (
        one("differential_thermal_expanson", "temperature_difference_K = 5.0")
        + one("spread_inflation", "growth = -0.2")
        + one("lot_mixture", "share = 0.2, offst_arcmin = 1")
        + one("lot_mixture", 'share = 0.2, offset = "3 um"')
        + one("lot_mixture", "share = 0.2, offset = 3")
        + one("lot_mixture", 'share = 0.2, offset = "3 arcmin", offset_arcmin = 3')
        + one("lot_mixture", "offset_arcmin = 1")
        + one("torsional_compliance", "compliance_arcmin_per_Nm = 1")
        + "[[effect]]\nparameters = {}\n"
        + one("process_mean_shift", "")
        + '[[effect]]\nname = "process_mean_shift"\nparameter = { shift_arcmin = 1 }\n'
    )
    found = refused(tmp_path, "tolerance = 3\n" + text)
    places = [line.partition(": ")[0] for line in found]
    assert "did you mean `differential_thermal_expansion`?" in found[0]
    assert places == [
        "effect[0].name",
        "effect[1].parameters.growth",
        "effect[2].parameters.offst_arcmin",
        "effect[3].parameters.offset",
        "effect[4].parameters.offset",
        "effect[5].parameters.offset_arcmin",
        "effect[6].parameters.share",
        "effect[7].name",
        "effect[8].name",
        "effect[9].parameters",
        "effect[10].parameter",
        "effect[10].parameters",
        "tolerance",
    ]
    assert "(did you mean `offset_arcmin`?); it takes offset_arcmin, share" in found[2]
    assert 'write offset = "... arcmin", or offset_arcmin' in found[4]
    assert "given twice" in found[5]
    assert "has no place in the model rv_batch" in found[7]


@pytest.mark.parametrize("text", ["effect = 3\n", "[effect]\nname = 'drift'\n", "effect = [1]\n"])
def test_effect_is_a_list_of_tables(tmp_path: Path, text: str) -> None:
    assert any("write [[effect]]" in line for line in refused(tmp_path, text))


def test_effect_needs_a_model(tmp_path: Path) -> None:
    head = """problem = "stack"
[requirement]
name = "gap"
unit = "mm"
formula = "a - b"
"""
    found = refused(tmp_path, one("drift", "rate_mm_per_s = 1"), head)
    assert any("this problem has none that effects could act in" in line for line in found)


def tolevo(*words: str) -> str:
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, result.output
    return result.output


def simulated(folder: Path, effects: str, table: str = "unit\n" + "\n".join("abcdef")) -> pd.Series:
    (folder / "units.csv").write_text(table + "\n")
    out = folder / "out.csv"
    tolevo("simulate", str(config(folder, effects)), str(folder / "units.csv"), "--out", str(out))
    return pd.read_csv(out)["backlash_arcmin"]


def test_simulate_has_the_effects_in_it(tmp_path: Path) -> None:
    plain = simulated(tmp_path, "")
    shifted = simulated(tmp_path, one("process_mean_shift", "shift_arcmin = 0.5"))
    np.testing.assert_allclose(shifted - plain, 0.5, rtol=1e-12)
    read_in_steps = simulated(tmp_path, one("quantisation", "step_arcmin = 0.25"))
    np.testing.assert_allclose(read_in_steps / 0.25, np.round(plain / 0.25), atol=1e-12)


def test_lots_are_named_by_their_labels(tmp_path: Path) -> None:
    table = "unit,lot\na,1\nb,2\nc,2\nd,A-1"
    plain = simulated(tmp_path, "", table)
    found = simulated(tmp_path, one("lot_offset", "offset_2_arcmin = 0.5, offset_A-1_arcmin = 1.0"), table)
    np.testing.assert_allclose(found - plain, [0.0, 0.5, 0.5, 1.0], atol=1e-12)


def test_effect_whose_column_is_missing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "units.csv").write_text("unit\na\n")
    path = config(tmp_path, one("lot_offset", "offset_A_arcmin = 1"))
    out = tmp_path / "out.csv"
    result = CliRunner().invoke(app, ["simulate", str(path), str(tmp_path / "units.csv"), "--out", str(out)])
    assert result.exit_code == 2
    assert "units.csv: the effect lot_offset needs a column of lot" in result.output
    assert not out.exists()


def test_check_prints_effects_and_what_they_do(tmp_path: Path) -> None:
    text = EXPANSION + one("tool_wear_drift", "rate_per_unit_arcmin = 0.01")
    shown = tolevo("check", str(config(tmp_path, text, 'problem = "rv_backlash"\n')))
    assert "differential_thermal_expansion (temperature, time): The disc is warmer" in shown
    assert "temperature_difference_K = 5" in shown
    assert "phi_2 changes by -0.28" in shown
    assert "effect tool_wear_drift has no counterpart in this problem" in shown
    alone = tolevo("check", str(config(tmp_path, EXPANSION)))
    assert "# Effects" in alone
    assert "counterpart" not in alone
    again = tmp_path / "again.toml"
    again.write_text(shown)
    assert read(again).settings.effects[1].effect.name == "tool_wear_drift"


def test_list_names_the_families() -> None:
    shown = tolevo("list")
    assert "hertz_stiffening load: Hertzian twist" in shown
    assert "creep            temperature, time: " in shown

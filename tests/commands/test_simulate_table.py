"""`model = "table"` in `simulate`: predictions of any simulator, with effects added to them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.errors import InputError

CONFIG = """model = "table"
[columns]
"Angle" = { role = "angle", unit = "deg" }
"Load" = { role = "torque", unit = "kN m" }
"te" = { role = "measured", unit = "deg" }
"te_sim" = { role = "predicted", unit = "arcmin" }
"note" = { role = "ignore" }
[[effect]]
name = "torsional_compliance"
parameters = { compliance = "0.6 arcmin/Nm" }
[[effect]]
name = "output_eccentricity"
parameters = { cos_1_deg = 0.5 }
"""
TABLE = """Angle,Load,te,te_sim,note
0,0.01,1,6,first
90,-0.01,2,12,second
"""


def simulated(folder: Path, config: str, table: str) -> tuple[int, str]:
    (folder / "config.toml").write_text(config)
    (folder / "data.csv").write_text(table)
    words = ["simulate", "config.toml", "data.csv", "--out", "out.csv"]
    paths = [words[0], *(str(folder / one) for one in words[1:3]), "--out", str(folder / words[4])]
    result = CliRunner().invoke(app, paths)
    return result.exit_code, result.output


def test_effects_are_added_to_the_predictions_of_the_table(tmp_path: Path) -> None:
    """By hand: 6' + 0.6' x 10 + 30' = 0.7 deg; 12' - 6' + 0 = 0.1 deg."""
    status, told = simulated(tmp_path, CONFIG, TABLE)
    assert status == 0, told
    found = pd.read_csv(tmp_path / "out.csv")
    assert list(found) == ["Angle", "Load", "te_sim", "te"]
    np.testing.assert_allclose(found["te"], [0.7, 0.1], atol=1e-12)
    assert "te as written are predictions with the effects in them, not the measurements" in told


def test_resolved_table_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(CONFIG)
    found = read(path)
    path.write_text(found.toml())
    assert read(path).toml() == found.toml()
    assert dict(found.settings.effects[0].values)["compliance_deg_per_Nm"] == pytest.approx(0.01)


def test_check_tells_amplitude_and_phase(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(CONFIG.replace("cos_1_deg = 0.5", "cos_1_deg = -3.0, sin_1_deg = 4.0"))
    told = CliRunner().invoke(app, ["check", str(path)]).output
    assert "amplitude_1 = 5 deg, phase_1 = 126.87 deg" in told


def test_faults_of_the_columns_and_of_the_effects(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(CONFIG.replace('unit = "kN m"', 'unit = "mm"'))
    with pytest.raises(InputError, match=r"columns\.Load\.unit: must be a unit of torque"):
        read(path)
    path.write_text(CONFIG.replace("torsional_compliance", "windage"))
    with pytest.raises(InputError, match='"windage" has no place in the model table'):
        read(path)
    path.write_text(CONFIG + "[parameters]\nx = 1\n")
    with pytest.raises(InputError, match="parameters: belongs to a model"):
        read(path)


def test_prediction_must_be_in_the_table(tmp_path: Path) -> None:
    status, told = simulated(tmp_path, CONFIG, "Angle,Load,te\n1,2,3\n")
    assert status == 2
    assert "column te_sim is missing" in told

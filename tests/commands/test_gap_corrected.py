"""`corrected.toml`: all that was fitted is in it, and every command takes it."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import output_of as tolevo
from tolevo.commands.gap.configuration import read_gap
from tolevo.configuration.plugins import foreign_model_message, model_belongs
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.problems.rv_backlash import RvBacklash

pytestmark = pytest.mark.usefixtures("without_figures", "units_once")

ZERO = 7.0
"""[arcsec or arcmin] What the instrument reads at rest."""
CONFIGS = Path(str(files("tolevo.configs")))
TABLE = """model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"direction" = { role = "direction" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcmin" }
"""
LITTLE = '[effects]\nconsider = ["friction_hysteresis"]\n[settings]\nsimulations = 200\n'


def readings(model: str, folder: Path) -> pd.DataFrame:
    """Inputs, and an output with a zero, friction and noise."""
    rng = np.random.default_rng(1)
    n = 150
    direction = rng.choice([-1.0, 1.0], n)
    frame = pd.DataFrame({"torque_Nm": rng.uniform(-400.0, 400.0, n), "direction": direction})
    more = ZERO + 3.0 * direction + rng.normal(0.0, 0.5, n)
    if model == "table":
        frame = frame.rename(columns={"torque_Nm": "torque"})
        frame["te_predicted"] = rng.normal(size=n)
        return frame.assign(te=60.0 * frame["te_predicted"] + more)
    frame.insert(0, "output_angle_deg", rng.uniform(0.0, 360.0, n))
    frame["output_speed_rpm"] = rng.uniform(5.0, 20.0, n)
    (folder / "bare.toml").write_text(f'model = "{model}"\n', encoding="utf-8")
    frame.to_csv(folder / "inputs.csv", index=False)
    out = folder / "bare.csv"
    tolevo("simulate", folder / "bare.toml", folder / "inputs.csv", "--out", out, "--quiet")
    return frame.assign(te_arcsec=pd.read_csv(out)["te_arcsec"] + more)


@pytest.mark.parametrize(
    ("model", "output", "text"),
    [("table", "te", TABLE), ("rv_transmission", "te_arcsec", 'model = "rv_transmission"\n')],
)
def test_simulated_it_leaves_what_the_analysis_left(tmp_path: Path, model: str, output: str, text: str) -> None:
    frame = readings(model, tmp_path)
    frame.to_csv(tmp_path / "data.csv", index=False)
    (tmp_path / "gap.toml").write_text(text + LITTLE, encoding="utf-8")
    out = tmp_path / "out"
    tolevo("gap", tmp_path / "gap.toml", tmp_path / "data.csv", "--out", out, "--quiet")
    zero = tomllib.loads((out / "corrected.toml").read_text(encoding="utf-8"))["zero"]
    assert zero == {output: pytest.approx(ZERO, abs=0.2)}
    told = tolevo("simulate", out / "corrected.toml", tmp_path / "data.csv", "--out",
                  tmp_path / "again.csv")  # fmt: skip
    assert f"{output} as written are predictions" in " ".join(told.split())
    left = frame[output] - pd.read_csv(tmp_path / "again.csv")[output]
    residuals = pd.read_parquet(out / "residuals.parquet")
    np.testing.assert_allclose(left, residuals[f"{output}_after"], rtol=0.0, atol=1e-9)
    assert np.sqrt(np.mean(left**2)) < 1.2 * 0.5

    plan = read_gap(out / "corrected.toml")
    assert plan.zero == zero
    second = tmp_path / "second"
    tolevo(
        "gap",
        out / "corrected.toml",
        tmp_path / "data.csv",
        "--out",
        second,
        "--quiet",
        "--set",
        "settings.simulations=200",
        "--set",
        'effects.consider=["drift", "load"]',
    )
    said = json.loads((second / "gap.json").read_text(encoding="utf-8"))
    assert said["verdict"] == "no_gap"
    again = tomllib.loads((second / "corrected.toml").read_text(encoding="utf-8"))
    assert again["zero"] == {output: pytest.approx(zero[output], abs=0.02)}
    assert again["effect"][0]["parameters"] == pytest.approx(plan.active[0].values)


def test_a_zero_is_an_outputs_and_has_its_unit(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text('model = "rv_transmission"\n[zero]\nte_arcsec = "0.1 arcmin"\n', "utf-8")
    assert read(path).settings.zero == {"te_arcsec": pytest.approx(6.0)}
    path.write_text('model = "rv_transmission"\n[zero]\nte_arcsc = 1.0\n', "utf-8")
    with pytest.raises(InputError, match=r"zero\.te_arcsc: is not an output .*mean `te_arcsec`"):
        read(path)


def test_a_run_ignores_a_zero_with_a_word(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text('problem = "rv_transmission_error"\nmodel = "rv_transmission"\n'
                    "[zero]\nte_arcsec = 2.0\n", "utf-8")  # fmt: skip
    found = read(path)
    assert found.problem is not None
    assert "zero of te_arcsec" in found.problem.effect_notes()[-1]
    path.write_text(found.toml(), "utf-8")
    assert read(path).toml() == found.toml()


@pytest.mark.slow
def test_merged_with_a_run_it_is_analysed_again(tmp_path: Path) -> None:
    run = tmp_path / "run.toml"
    run.write_text((CONFIGS / "rv40e_document.toml").read_text("utf-8"), "utf-8")
    n = 60
    units = pd.DataFrame({"unit": [f"u{at}" for at in range(n)]})
    (tmp_path / "truth.toml").write_text('model = "rv_batch"\nseed = 3\n', "utf-8")
    units.to_csv(tmp_path / "units.csv", index=False)
    data = tmp_path / "data.csv"
    tolevo("simulate", tmp_path / "truth.toml", tmp_path / "units.csv", "--out", data, "--quiet")
    frame = pd.read_csv(data)
    frame.assign(backlash_arcmin=frame["backlash_arcmin"] + 1.0).to_csv(data, index=False)
    text = 'model = "rv_batch"\nrun = "run.toml"\n[effects]\nconsider = ["process_mean_shift"]\n'
    (tmp_path / "gap.toml").write_text(text + "[settings]\nsimulations = 200\n", "utf-8")
    tolevo("gap", tmp_path / "gap.toml", data, "--out", tmp_path / "one", "--quiet")
    corrected = tmp_path / "one" / "corrected.toml"
    assert tomllib.loads(corrected.read_text("utf-8"))["problem"] == "rv_backlash"
    tolevo(
        "gap",
        corrected,
        data,
        "--out",
        tmp_path / "two",
        "--quiet",
        "--set",
        "settings.simulations=200",
        "--set",
        'effects.consider=["population"]',
    )
    said = json.loads((tmp_path / "two" / "gap.json").read_text("utf-8"))
    assert said["verdict"] == "no_gap"
    again = tmp_path / "two" / "corrected.toml"
    assert len(tomllib.loads(again.read_text("utf-8"))["effect"]) == 1
    assert read(again).toml() == read(corrected).toml()


@pytest.mark.parametrize(
    ("model", "problem", "fits"),
    [
        ("rv_batch", "rv_backlash", True),
        ("rv_lost_motion", "rv_backlash", True),
        ("rv_batch", "rv_reducer", True),
        ("rv_lost_motion", "rv_reducer", True),
        ("rv_transmission", "rv_transmission_error", True),
        ("assembly", "rv_transmission_error", True),
        ("manipulator_pose", "pose_accuracy", True),
        ("rv_batch", "pose_accuracy", False),
        ("rv_lost_motion", "rv_transmission_error", False),
        ("rv_transmission", "rv_backlash", False),
        ("assembly", "pose_accuracy", False),
        ("manipulator_pose", "rv_backlash", False),
    ],
)
def test_a_run_belongs_to_its_model(tmp_path: Path, model: str, problem: str, fits: bool) -> None:
    (tmp_path / "run.toml").write_text(f'problem = "{problem}"\n', "utf-8")
    (tmp_path / "gap.toml").write_text(f'model = "{model}"\nrun = "run.toml"\n', "utf-8")
    (tmp_path / "both.toml").write_text(f'model = "{model}"\nproblem = "{problem}"\n', "utf-8")
    if fits:
        assert read_gap(tmp_path / "gap.toml").run["problem"] == problem
        assert read(tmp_path / "both.toml").problem is not None
        return
    said = f'the model {model} does not belong to the problem "{problem}": it corrects'
    with pytest.raises(InputError, match=f"^run: {said}"):
        read_gap(tmp_path / "gap.toml")
    with pytest.raises(InputError, match=f"^model: {said}"):
        read(tmp_path / "both.toml")


def test_a_table_has_no_run(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text('problem = "rv_backlash"\n', "utf-8")
    (tmp_path / "gap.toml").write_text(TABLE.replace("[columns]", 'run = "run.toml"\n[columns]'))
    with pytest.raises(InputError, match=r"run: .*corrects no problem"):
        read_gap(tmp_path / "gap.toml")


class Mine(RvBatch):
    """A model of a plugin, that says which problem it corrects."""

    corrects = ("my_problem",)


class MyProblem(RvBacklash):
    """A problem of a plugin, that says which model it is of."""

    declaration = replace(RvBacklash.declaration, model="my_model")


def test_either_side_of_a_plugin_may_say_that_they_belong() -> None:
    assert model_belongs("my_problem", RvBacklash.declaration.model, "mine", Mine)
    assert model_belongs("other", MyProblem.declaration.model, "my_model", RvBatch)
    assert not model_belongs("other", RvBacklash.declaration.model, "mine", Mine)
    assert 'corrects "my_problem"' in foreign_model_message("other", "mine", Mine)

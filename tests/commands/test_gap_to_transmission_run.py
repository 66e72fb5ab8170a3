"""From tables of assemblies and of a turning unit to a new allocation of the transmission error."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import output_of as tolevo
from tolevo.problems.rv_transmission_error import declared

pytestmark = [pytest.mark.long, pytest.mark.usefixtures("without_figures"), pytest.mark.usefixtures("units_once")]

RUN = Path(str(files("tolevo.configs") / "rv_transmission_error.toml"))
SMALL = (
    "references=none",
    "algorithm.population=30",
    "algorithm.generations=8",
    "propagation.samples=512",
    "limits.adjustment_effort=40",
    "limits.peak_mesh_force_N=4000",
)


@dataclass(frozen=True)
class Case:
    """A model with a hidden effect, the noise of its readings and what the run says of it."""

    model: str
    effect: str
    hidden: dict[str, float]
    family: str
    noise: float
    told: str


CASES = (
    Case("assembly", "springback", {"springback": 0.2}, "assembly", 0.01,
         "of the total adjustment returns"),
    Case("rv_transmission", "eccentric_error", {"cos_40_arcsec": 6.0, "sin_40_arcsec": -8.0},
         "geometry by angle", 1.0, "arcsec of order 40"),
)  # fmt: skip


def inputs(model: str) -> pd.DataFrame:
    rng = np.random.default_rng(3)
    if model == "assembly":
        table = {f"dtheta_{at}_mrad": rng.normal(0.0, 2.0, 240) for at in range(1, 5)}
        units = [f"u{at}" for at in range(240)]
        return pd.DataFrame({"unit": units, **table, "precision_weight": 5.0})
    angle = 0.75 * np.arange(480) + rng.uniform(0.0, 0.7, 480)
    return pd.DataFrame({"output_angle_deg": angle, "torque_Nm": 412.0, "output_speed_rpm": 15.0})


def measured(case: Case, folder: Path) -> Path:
    """A table of the model with its effect hidden in it, and noise."""
    values = ", ".join(f"{name} = {value}" for name, value in case.hidden.items())
    truth = f'model = "{case.model}"\n[[effect]]\nname = "{case.effect}"\nparameters = {{ {values} }}'
    (folder / "truth.toml").write_text(truth, encoding="utf-8")
    table = inputs(case.model)
    table.to_csv(folder / "inputs.csv", index=False)
    data = folder / "measured.csv"
    tolevo("simulate", folder / "truth.toml", folder / "inputs.csv", "--out", data, "--quiet")
    frame, rng = pd.read_csv(data), np.random.default_rng(0)
    for name in frame.columns.difference(table.columns):
        frame[name] += rng.normal(0.0, case.noise, len(frame))
    frame.to_csv(data, index=False)
    return data


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.model)
def test_corrected_configuration_is_simulated_evaluated_and_run(case: Case, tmp_path: Path) -> None:
    data, out = measured(case, tmp_path), tmp_path / "gap"
    (tmp_path / "gap.toml").write_text(
        f'model = "{case.model}"\nseed = 1\nrun = {json.dumps(str(RUN))}\n'
        f'[effects]\nconsider = ["{case.family}"]\n[settings]\nsimulations = 200\n',
        encoding="utf-8",
    )
    tolevo("gap", tmp_path / "gap.toml", data, "--out", out, "--quiet")
    found = json.loads((out / "gap.json").read_text())
    assert [one["name"] for one in found["effects"]] == [case.effect]
    corrected = out / "corrected.toml"

    again = tmp_path / "again.csv"
    tolevo("simulate", corrected, tmp_path / "inputs.csv", "--out", again, "--quiet")
    outputs = pd.read_csv(again).columns.difference(inputs(case.model).columns)
    left = pd.read_csv(data)[outputs] - pd.read_csv(again)[outputs]
    assert float(left.to_numpy().std()) == pytest.approx(case.noise, rel=0.1)

    designs = pd.DataFrame([{**declared.DOCUMENT_MRAD, "precision_weight": 5.0}])
    designs.to_csv(tmp_path / "designs.csv", index=False)
    te = {}
    for name, path in (("with", corrected), ("without", RUN)):
        values = tmp_path / f"{name}.csv"
        words = ["evaluate", path, tmp_path / "designs.csv", "--out", values, "--quiet"]
        tolevo(*words, "--set", "propagation.samples=512")
        te[name] = float(pd.read_csv(values)["te_amplitude_arcsec"][0])
    assert te["with"] > te["without"] + 1.0

    sets = [word for one in SMALL for word in ("--set", one)]
    ran = tolevo("run", corrected, "--out", tmp_path / "run", "--quiet", "--workers", "1", *sets)
    assert case.told in ran
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert case.told in summary["effects"][0]["counterpart"]
    assert (tmp_path / "run" / "front_without_effects.csv").is_file()
    front = pd.read_csv(tmp_path / "run" / "front.csv")
    assert np.all(front["te_error_percent"].abs() < 20.0)
    assert np.any(front["te_error_percent"] != 0.0), "what is reported is verified"

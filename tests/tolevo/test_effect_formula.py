"""`[[effect]]` with a formula: parsed, fitted by gap, written into the corrected model, taken by simulate."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo
from tolevo.commands.gap.configuration import gap_plan
from tolevo.errors import InputError

COLUMNS = """
model = "table"
[settings]
bootstrap = 0
[columns]
torque_Nm = { role = "torque", unit = "Nm" }
temp_C = { role = "temperature", unit = "degC" }
y_arcsec = { role = "measured", unit = "arcsec" }
y_sim = { role = "predicted", unit = "arcsec" }
"""
MINE = '[[effect]]\nname = "mine"\nformula = "a * torque_Nm * temp_C"\n'


def places(more: str, folder: Path) -> list[str]:
    """The faults of a configuration with these tables, as text."""
    path = folder / "gap.toml"
    path.write_text(COLUMNS + more, encoding="utf-8")
    return [f"{fault.place}: {fault.message}" for fault in gap_plan(path)[1]]


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("a * torque_Nm * tmp_C", "tmp_C is no column of numbers"),
        ("a * torque_Nm + 3", "has a part that no letter multiplies"),
        ("torque_Nm", "has a part that no letter multiplies"),
        ("a * abs(torque_Nm) ** b", "b is not linear"),
        ("a * torque_Nm *", "column"),
        ("__import__('os')", "column"),
    ],
)
def test_faults_have_their_place(formula: str, said: str, tmp_path: Path) -> None:
    (found,) = places(f'[[effect]]\nname = "mine"\nformula = "{formula}"\n', tmp_path)
    assert found.startswith("effect[0].") and said in found


def test_a_name_of_the_library_and_faulty_bounds_are_refused(tmp_path: Path) -> None:
    (found,) = places('[[effect]]\nname = "drift"\nformula = "a * torque_Nm"\n', tmp_path)
    assert found.startswith("effect[0].name: ")
    bounds = "bounds = { b = [3.0, 0.5] }\n"
    (found,) = places(f'[[effect]]\nname = "mine"\nformula = "a * abs(torque_Nm) ** b"\n{bounds}', tmp_path)
    assert found.startswith("effect[0].bounds: ")


def test_what_is_linear_is_told_from_what_is_not(tmp_path: Path) -> None:
    path = tmp_path / "gap.toml"
    text = '[[effect]]\nname = "mine"\nformula = "a * abs(torque_Nm) ** b + c * temp_C"\nbounds = { b = [0.2, 3.0] }\n'
    path.write_text(COLUMNS + text, encoding="utf-8")
    plan, faults = gap_plan(path)
    assert not faults and plan is not None
    (effect,) = plan.own
    assert [number.linear for number in effect.own_parameters(None)] == [True, False, True]  # type: ignore[arg-type]


def test_a_formula_is_fitted_and_simulated(tmp_path: Path) -> None:
    rng, n = np.random.default_rng(5), 300
    torque, temperature = rng.uniform(-50.0, 50.0, n), rng.uniform(15.0, 45.0, n)
    simulated = 0.1 * torque
    measured = simulated + 0.03 * torque * temperature + rng.normal(0.0, 0.5, n)
    table = {"torque_Nm": torque, "temp_C": temperature, "y_arcsec": measured, "y_sim": simulated}
    pd.DataFrame(table).to_csv(tmp_path / "record.csv", index=False)
    tolevo.gap(tomllib.loads(COLUMNS + MINE), tmp_path / "record.csv", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    (effect,) = [entry for entry in found["effects"] if entry["name"] == "mine"]
    low, high = effect["parameters"]["a"]["interval"]
    assert low <= 0.03 <= high
    corrected = tomllib.loads((tmp_path / "out" / "corrected.toml").read_text(encoding="utf-8"))
    (own,) = [entry for entry in corrected["effect"] if entry["name"] == "mine"]
    assert own["formula"] == "a * torque_Nm * temp_C"
    assert own["parameters"]["a"] == pytest.approx(0.03, rel=0.02)


def test_simulate_needs_the_numbers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does nothing without parameters"):
        tolevo.simulate(tomllib.loads(COLUMNS.replace("[settings]\nbootstrap = 0\n", "") + MINE), tmp_path / "no.csv")

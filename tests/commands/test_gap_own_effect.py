"""From a remainder to an effect of one's own: the offered texts, pasted and run again."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.page import gap_page
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult

HEAD = """model = "table"
[columns]
time_s = { role = "time", unit = "s" }
speed_rpm = { role = "speed", unit = "rpm" }
temp_C = { role = "temperature", unit = "C" }
drag_Nm = { role = "measured", unit = "N m" }
drag_Nm_predicted = { role = "predicted", unit = "N m" }
[settings]
simulations = 300
bootstrap = 0
"""
N, SIGMA = 600, 0.2


def record(folder: Path) -> Path:
    """A drag with a maximum at one speed, as an oil splashes, that no effect of the library has."""
    rng = np.random.default_rng(8)
    speed, temperature = rng.uniform(50.0, 1500.0, N), rng.uniform(20.0, 60.0, N)
    drag = 1.0 + 3.0 * np.exp(-(((speed - 700.0) / 450.0) ** 2)) + rng.normal(0.0, SIGMA, N)
    columns = {"time_s": np.arange(N) * 2.0, "speed_rpm": speed, "temp_C": temperature}
    pd.DataFrame(columns | {"drag_Nm": drag, "drag_Nm_predicted": 1.0}).to_csv(folder / "record.csv", index=False)
    return folder / "record.csv"


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[GapResult, Path]:
    folder = tmp_path_factory.mktemp("first")
    record(folder)
    return analysed(folder, HEAD), folder


def analysed(folder: Path, configuration: str) -> GapResult:
    (folder / "gap.toml").write_text(configuration, encoding="utf-8")
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "record.csv"))


def named_gap(folder: Path, configuration: str) -> GapResult:
    """The gap with no term without a name, so that names alone close it."""
    return analysed(folder, configuration + "terms_at_most = 0\n")


def test_the_page_shows_the_remainder_and_both_texts(first: tuple[GapResult, Path]) -> None:
    result, _ = first
    part = result.remainder[0]
    assert part.against[0] == "speed_rpm" and len(part.against) == 2
    page = gap_page(result)
    assert "what the named effects leave" in page and "formula = &quot;" in page
    assert "class DragNmOfSpeedRpm" in page and part.shape in page
    left = result.residuals["drag_Nm_remainder"]
    speed = result.residuals["speed_rpm"]
    bump = np.exp(-(((speed - 700.0) / 450.0) ** 2))
    assert np.corrcoef(left, bump)[0, 1] > 0.95  # rms of the bump is five times the noise
    assert abs(np.corrcoef(result.residuals["drag_Nm_after"], bump)[0, 1]) < 0.15


def test_the_formula_pasted_closes_the_gap_under_its_name(first: tuple[GapResult, Path]) -> None:
    result, folder = first
    part = result.remainder[0]
    without = named_gap(folder, HEAD)
    again = named_gap(folder, HEAD.replace("[columns]", part.formula + "[columns]"))
    name = tomllib.loads(part.formula)["effect"][0]["name"]
    assert name not in without.names and name in again.names
    (size,) = next(effect for effect in again.effects if effect.name == name).parameters
    assert size.low < 1.0 < size.high
    assert again.gap_after["drag_Nm"] < 1.1 * SIGMA < 0.3 * without.gap_after["drag_Nm"]


def test_the_plugin_installed_closes_the_gap_under_its_name(
    first: tuple[GapResult, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    result, folder = first
    part = result.remainder[0]
    (title,) = re.findall(r"class (\w+)\(", part.plugin)
    (name,) = re.findall(r'name, family, needs = "(\w+)"', part.plugin)
    site = folder / "site"
    (site / "own_effect-1.0.dist-info").mkdir(parents=True)
    (site / "own_effect.py").write_text(part.plugin, encoding="utf-8")
    metadata = {"METADATA": "Name: own-effect\nVersion: 1.0\n"}
    metadata["entry_points.txt"] = f"[tolevo.effects]\n{name} = own_effect:{title}\n"
    for file, text in metadata.items():
        (site / "own_effect-1.0.dist-info" / file).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(site))
    again = named_gap(folder, HEAD)
    assert again.names == (name,)
    assert again.gap_after["drag_Nm"] < 1.1 * SIGMA
    (size,) = again.effects[0].parameters
    assert size.low < 1.0 < size.high

"""A formula for what has no name: the one that made the data, and none that a spline beats."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.models.effects.empirical import Curve, empirical

pytestmark = pytest.mark.usefixtures("unrendered")

Array = np.ndarray
N = 400
HEAD = """
model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"clock" = { role = "time", unit = "s" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
"""


def made(values: Array, x: Array, period: float = 0.0) -> str:
    """The formula of values with noise of 1."""
    y = values + np.random.default_rng(1).normal(size=len(x))
    labels = np.arange(len(x)) * 10 // len(x)
    return empirical(Curve(x, y, np.ones(len(x)), labels, period), "x")


def drawn() -> Array:
    return np.random.default_rng(0).uniform(-400.0, 400.0, N)


def test_bump_is_found_where_it_is() -> None:
    x = drawn()
    found = re.fullmatch(r"(\S+) \+ (\S+) exp\(-\(\(x - (\S+)\)/(\S+)\)\^2\)",
                         made(4.0 * np.exp(-(((x - 200.0) / 60.0) ** 2)), x))  # fmt: skip
    assert found is not None
    level, height, middle, width = map(float, found.groups())
    assert level == pytest.approx(0.0, abs=0.2)
    assert height == pytest.approx(4.0, abs=0.7)
    assert middle == pytest.approx(200.0, abs=20.0)
    assert width == pytest.approx(60.0, abs=20.0)


def test_saturation_is_odd() -> None:
    x = drawn()
    found = made(4.0 * np.sign(x) * (1.0 - np.exp(-np.abs(x) / 80.0)), x)
    size = re.fullmatch(r"\S+ \+ \S+ sgn\(x\) \(1 - exp\(-\|x\|/(\S+)\)\)", found)
    assert size is not None
    assert float(size.group(1)) == pytest.approx(80.0, rel=0.4)


def test_wave_over_its_phase() -> None:
    x = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, N)
    found = re.fullmatch(r"\S+ \+ (\S+) cos\(x\) \+ (\S+) sin\(x\)",
                         made(2.0 * np.cos(x - 1.0), x, 2.0 * np.pi))  # fmt: skip
    assert found is not None
    error = 4.0 * np.sqrt(2.0 / N)
    assert float(found.group(1)) == pytest.approx(2.0 * np.cos(1.0), abs=error)
    assert float(found.group(2)) == pytest.approx(2.0 * np.sin(1.0), abs=error)


def test_no_formula_where_a_spline_is_better() -> None:
    x = drawn()
    assert made(3.0 * np.sin(x / 40.0) * np.cos(x / 97.0), x) == ""


def analysed(folder: Path, text: str = "") -> GapResult:
    rng = np.random.default_rng(6)
    frame = pd.DataFrame({"torque": drawn(), "clock": np.arange(N) * 2.0})
    frame["te_predicted"] = 0.2 * frame["torque"]
    frame["te"] = frame["te_predicted"] + rng.normal(size=N)
    frame["te"] += 4.0 * np.exp(-(((frame["torque"] - 200.0) / 60.0) ** 2))
    (folder / "gap.toml").write_text(HEAD + text, encoding="utf-8")
    frame.to_csv(folder / "bench.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "bench.csv"))


def test_only_where_it_is_asked_for(tmp_path: Path) -> None:
    plain = analysed(tmp_path)
    assert plain.verdict == "unnamed"
    assert {one.empirical for one in plain.shapes} == {""}
    asked = analysed(tmp_path, "[settings]\nempirical = true\n")
    assert asked.verdict == "unnamed"
    first = asked.shapes[0]
    assert first.variable == "torque"
    assert re.search(r"exp\(-\(\(torque - (1[89]|20|21)\d", first.empirical), first.empirical

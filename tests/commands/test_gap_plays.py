"""A memory that no effect has: plays over a driving column, from records made by a loop of their own."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from benchmarks.gap.generator.records import record
from benchmarks.gap.namers.workflow import read_as_files
from tests.commands.gap_toy import directions, readings, toy
from tolevo.cli import app
from tolevo.commands.gap import ending_records, gap
from tolevo.commands.gap.configuration import gap_plan, read_gap
from tolevo.commands.gap.fit import Member
from tolevo.commands.gap.library import Candidate
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import FoundEffect, GapResult, Remainder
from tolevo.models.effects import EffectParameter, Target
from tolevo.models.effects.memory import SHORTEST, Dahl, LuGre
from tolevo.models.measurable import Role
from tolevo.section import Output

HEAD = """model = "table"
[columns]
time_s = { role = "time", unit = "s" }
voltage_V = { role = "input", unit = "V" }
pos_um = { role = "measured", unit = "um" }
pos_um_predicted = { role = "predicted", unit = "um" }
"""
N, SIGMA = 900, 0.05
TIME = 0.05 * np.arange(N)


def voltage(time: np.ndarray) -> np.ndarray:
    """A voltage that turns back at many levels."""
    return np.asarray(60.0 * np.sin(0.5 * time) * np.exp(-0.02 * time) + 25.0 * np.sin(1.7 * time + 1.0) + 70.0)


def sum_of_plays(x: np.ndarray, widths: Sequence[float], weights: Sequence[float]) -> np.ndarray:
    """A piston between two walls for each play, moved row by row."""
    total = np.zeros(len(x))
    for width, weight in zip(widths, weights, strict=True):
        piston = x[0]
        for row, here in enumerate(x):
            if here - piston > width:
                piston = here - width
            if piston - here > width:
                piston = here + width
            total[row] += weight * piston
    return total


def analysed(folder: Path, measured: np.ndarray, predicted: np.ndarray) -> GapResult:
    noise = np.random.default_rng(5).normal(0.0, SIGMA, N)
    columns = {"time_s": TIME, "voltage_V": voltage(TIME), "pos_um": measured + noise, "pos_um_predicted": predicted}
    pd.DataFrame(columns).to_csv(folder / "piezo.csv", index=False)
    (folder / "gap.toml").write_text(HEAD + "[settings]\nsimulations = 300\n", "utf-8")
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "piezo.csv"))


def test_four_plays_are_a_memory_without_a_name_that_simulate_repeats(tmp_path: Path) -> None:
    """The half-widths are on no grid. The weights add up to 0.1 um/V, the slope of the prediction."""
    drive, weights = voltage(TIME), [0.02, 0.03, 0.03, 0.02]
    result = analysed(tmp_path, sum_of_plays(drive, [3.0, 9.0, 20.0, 40.0], weights), 0.1 * drive)
    assert result.verdict == "unnamed" and result.effects == ()
    remainder, *smaller = result.remainder
    assert all(part.ratio < 0.3 for part in smaller)  # the half-widths of the term are on a grid
    assert remainder.shape.startswith("a memory of ") and remainder.shape.endswith("over voltage_V, without a name")
    (term,) = tomllib.loads(result.corrected)["unresolved"]
    assert f"a memory of {len(term['radii'])} plays" in remainder.shape and len(term["radii"]) <= 6
    assert min(term["coefficients"]) > 0.0 and term["scale"] > 0.0
    assert result.gap_after["pos_um"] < 1.1 * SIGMA < 0.05 * result.gap_before["pos_um"]
    # stiffness of the loop right after a reversal and far from one: no play moves, all do
    assert sum(term["coefficients"]) / term["scale"] == pytest.approx(sum(weights), rel=0.1)
    (tmp_path / "corrected.toml").write_text(result.corrected, encoding="utf-8")
    arguments = ["simulate", str(tmp_path / "corrected.toml"), str(tmp_path / "piezo.csv"), "--quiet"]
    ran = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "again.csv")])
    assert ran.exit_code == 0, ran.output
    left = pd.read_csv(tmp_path / "piezo.csv")["pos_um"] - pd.read_csv(tmp_path / "again.csv")["pos_um"]
    assert left.std() == pytest.approx(SIGMA, rel=0.1)  # four standard errors of 900 rows


def test_a_memory_that_the_library_has_keeps_its_name(tmp_path: Path) -> None:
    drive = voltage(TIME)

    def slope(time: float, z: np.ndarray) -> np.ndarray:
        rate = (voltage(np.array([time + 1e-6])) - voltage(np.array([time - 1e-6]))) / 2e-6
        return np.asarray(rate / 15.0 * (1.0 - (0.6 * np.sign(rate * z) + 0.4) * np.abs(z) ** 2))

    loop = solve_ivp(slope, (0.0, TIME[-1]), [0.0], t_eval=TIME, rtol=1e-7, atol=1e-8, max_step=0.02).y[0]
    result = analysed(tmp_path, 0.1 * drive - 1.5 * loop, 0.1 * drive)
    assert result.names == ("bouc_wen_hysteresis",)
    (size,) = (number for number in result.effects[0].parameters if number.name.startswith("amplitude"))
    assert size.low <= -1.5 <= size.high


def test_a_sum_of_plays_that_a_law_nearly_fits_only_resembles_it(tmp_path: Path) -> None:
    """Two laws fitted together would close as much; neither of them is in the record."""
    found, truth = record("plays", 31_004)
    assert [hidden.name for hidden in truth.hidden] == ["prandtl_ishlinskii"]
    fewer = f"{found.configuration}[settings]\nsimulations = 300\n"
    plan, data = read_as_files(replace(found, configuration=fewer), tmp_path)
    result = gap.analysis_result(plan, data)
    (effect,), plays = result.effects, result.remainder[0]
    assert result.verdict == "partial" and effect.family == "memory" and effect.explains_percent > 90.0
    assert plays.shape.startswith("a memory of ") and effect.form_error >= plays.rms > 0.0
    assert effect.explained.endswith("; the memory of this record only resembles it")


@pytest.mark.parametrize(
    ("shapes", "resembles"),
    [
        (("a smooth curve over speed",), False),
        (("a smooth curve over speed", "a memory of 3 plays over speed, without a name"), False),
        (("a memory of 3 plays over speed, without a name", "a smooth curve over speed"), True),
        (("a memory of the path of speed",), True),
        ((), False),
    ],
)
def test_a_law_only_resembles_a_memory_that_it_leaves(
    shapes: tuple[str, ...], resembles: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first remainder is the largest; a curve beside a loop says nothing about the loop."""
    column = directions(1)
    law = Member(Candidate(LuGre(), (EffectParameter("size", "", ""),), ()))
    data = readings(speed=np.linspace(1.0, 9.0, len(column)))
    search = toy([law], {law.name: column}, 20.0 * column[:, 0], data=data)
    parts = [Remainder("te", ("speed",), shape, 2.0 - at, "arcsec", 1.0, 0.1) for at, shape in enumerate(shapes)]
    monkeypatch.setattr(ending_records, "remainder_of", lambda end: tuple(parts))
    end: Any = SimpleNamespace(
        analysis=SimpleNamespace(search=search), fit=search.fitter.fit([law]), setup=SimpleNamespace(data=data)
    )
    found = FoundEffect(law.name, "memory", "", (), 1.0, 1.0, 1.0, 1.0)
    (effect,) = ending_records._explained(end, [found])
    ending = "; the memory of this record only resembles it" if resembles else ""
    assert effect.form == (shapes[0] if shapes else "") + ending


def test_a_memory_of_no_reach_is_none() -> None:
    way = {Role.ANGLE: 2.0}
    target = Target("table", (Output("torque_Nm", "N m", ""),), (), largest=way, paths=way, units={Role.ANGLE: "rad"})
    dahl = Candidate(Dahl(), (), Dahl().shape_parameters(target))
    (length,) = dahl.shape
    assert length.low == 2.0 * SHORTEST
    assert Member(dahl, {length.name: length.low}).forgets and not Member(dahl, {length.name: 1.2 * length.low}).forgets


@pytest.mark.parametrize(
    ("keys", "place", "text"),
    [
        ('shape = "plays"\ncoefficients = [1.0]', "radii", "positive numbers, one for each"),
        ('shape = "plays"\nradii = [-1.0]\ncoefficients = [1.0]', "radii", "positive numbers"),
        ('shape = "power"\nradii = [1.0]\ncoefficients = [1.0]', "radii", "none for another shape"),
        ('shape = "plays"\nradii = [1.0, 2.0]\ncoefficients = [1.0]', "coefficients", "a plays like this has 2"),
        ('shape = "plays"\nradii = ["a"]\ncoefficients = [1.0]', "radii", "must be a list of numbers"),
        ('shape = "plays"\nscale = 0.0\nradii = [1.0]\ncoefficients = [1.0]', "scale", "must not be 0"),
    ],
)
def test_plays_that_cannot_be(keys: str, place: str, text: str, tmp_path: Path) -> None:
    term = f'[[unresolved]]\noutput = "pos_um"\nvariable = "voltage_V"\n{keys}\n'
    (tmp_path / "gap.toml").write_text(HEAD + term, encoding="utf-8")
    faults = {fault.place: fault.message for fault in gap_plan(tmp_path / "gap.toml")[1]}
    assert text in faults[f"unresolved[0].{place}"]

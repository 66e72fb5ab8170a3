"""Terms without a name: levels of sessions, and the curve that a name was which is the form of a
larger one.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import gap_plan, read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.models.effects.effect import Measurements
from tolevo.models.effects.unresolved import EVEN, FROM_LEAST, FROM_ZERO, ODD, Form, Term, broken_line
from tolevo.models.measurable import Role

HEAD = (
    'model = "table"\n[columns]\ntorque = { role = "torque", unit = "N m" }\n'
    'te = { role = "measured", unit = "arcsec" }\n'
    'te_predicted = { role = "predicted", unit = "arcsec" }\n'
)
N = 400
SIGMA = 0.5


def bench(te: np.ndarray, torque: np.ndarray) -> pd.DataFrame:
    noise = np.random.default_rng(1).normal(0.0, SIGMA, len(te))
    return pd.DataFrame({"torque": torque, "te": te + noise, "te_predicted": 0.0})


def found(folder: Path, frame: pd.DataFrame, more: str = "") -> GapResult:
    (folder / "gap.toml").write_text(HEAD + more + "[settings]\nsimulations = 300\n", "utf-8")
    frame.to_csv(folder / "bench.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "bench.csv"))


def test_columns_of_levels_add_up_to_nothing_and_other_labels_have_none() -> None:
    term = Term("te", "session", "levels", labels=("a", "b", "c"))
    labels = np.array(["a", "b", "c", "d"])
    columns = term.columns(Measurements({"session": labels}, {Role.UNIT: labels}))
    np.testing.assert_array_equal(columns, [[-1, -1], [1, 0], [0, 1], [0, 0]])
    nowhere = Measurements({"torque": np.zeros(4)}, {Role.UNIT: labels})
    np.testing.assert_array_equal(term.columns(nowhere), np.zeros((4, 2)))


def test_words_tell_axes_and_powers_apart() -> None:
    """Of two shafts, or of two powers, no two forms read alike."""
    waves = [Form("order", axis, order=2.0) for axis in ("input_angle", "output_angle")]
    assert [form.words for form in waves] == [
        ["a wave of order 2 of input_angle"],
        ["a wave of order 2 of output_angle"],
    ]
    terms = [Term("te", axis, "wave", order=2.0).words for axis in ("input_angle", "output_angle")]
    assert [[words] for words in terms] == [form.words for form in waves]
    powers = [Form("power", "torque", order=1.0 / 3.0, shape=shape) for shape in (ODD, EVEN, FROM_ZERO, FROM_LEAST)]
    assert [", ".join(form.words) for form in powers] == [
        f"a dependence on torque, about its power 0.333, {how}"
        for how in ("odd", "even", "from zero", "from its least")
    ]


def test_a_step_of_a_session_is_a_term_beside_the_name(tmp_path: Path) -> None:
    """A twist of 0.02 arcsec/(N m) in four sessions that are off by 2, -1, 0 and -1 arcsec: the
    levels are within five of their standard errors (sigma / 10), and `simulate` has them.
    """
    torque = np.random.default_rng(0).uniform(-400.0, 400.0, N)
    off = np.repeat([2.0, -1.0, 0.0, -1.0], N // 4)
    frame = bench(0.02 * torque + off, torque)
    frame["session"] = np.repeat(["mon", "tue", "wed", "thu"], N // 4)
    said = found(tmp_path, frame)
    assert said.verdict == "partial" and said.names == ("torsional_compliance",)
    (number,) = said.effects[0].parameters
    assert number.low < 0.02 < number.high
    assert [one.shape for one in said.remainder] == ["a separate level for each session"]
    (term,) = tomllib.loads(said.corrected)["unresolved"]
    levels = dict(zip(term["labels"][1:], term["coefficients"], strict=True))
    levels[term["labels"][0]] = -sum(levels.values())
    wanted = {"mon": 2.0, "tue": -1.0, "wed": 0.0, "thu": -1.0}
    assert all(abs(levels[name] - wanted[name]) < 5.0 * SIGMA / 10.0 for name in wanted)
    (tmp_path / "corrected.toml").write_text(said.corrected, encoding="utf-8")
    ran = CliRunner().invoke(app, ["simulate", str(tmp_path / "corrected.toml"), "--quiet",
                                   str(tmp_path / "bench.csv"), "--out",
                                   str(tmp_path / "again.csv")])  # fmt: skip
    assert ran.exit_code == 0, ran.output
    left = frame["te"] - pd.read_csv(tmp_path / "again.csv")["te"]
    assert left.std() == pytest.approx(SIGMA, rel=0.15)  # four standard errors of 400 rows


def test_what_a_formula_leaves_of_its_own_mechanism_is_no_second_name(tmp_path: Path) -> None:
    """A lost motion at 60 noise levels that the load widens by some per cent, as a compliance does.
    The half width is that of the formula alone, by least squares.
    """
    torque = np.random.default_rng(0).uniform(-400.0, 400.0, N)
    te = 30.0 * np.sign(torque) * (1.0 + 0.06 * np.abs(torque) / 400.0)
    said = found(tmp_path, bench(te, torque))
    assert said.verdict == "partial" and said.names == ("lost_motion",)
    (number,) = said.effects[0].parameters
    x = np.column_stack([np.ones(N), np.sign(torque)])
    alone = float(np.linalg.lstsq(x, te, rcond=None)[0][1])
    assert number.low < alone < number.high
    assert number.high - number.low < 0.05 * alone  # 4 standard errors are 0.1 arcsec
    assert said.remainder[0].variables == ("torque",)
    assert said.gap_after["te"] < 1.1 * SIGMA


def test_a_broken_line_goes_through_what_is_a_function_and_not_through_what_is_none() -> None:
    x = np.linspace(-1.0, 1.0, 501)
    knots, heights, off = broken_line(x, np.clip(x / 0.3, -1.0, 1.0))
    assert off < 1e-3 and len(knots) == len(heights) < 10
    assert broken_line(x, np.random.default_rng(0).normal(size=501))[2] > 0.5


def test_lists_of_a_term_that_do_not_fit(tmp_path: Path) -> None:
    (tmp_path / "gap.toml").write_text(
        HEAD + '[[unresolved]]\noutput = "te"\nvariable = "torque"\nshape = "curve"\n'
        "knots = [0.0, 1.0]\nheights = [1.0]\ncoefficients = [1.0]\n"
        '[[unresolved]]\noutput = "te"\nvariable = "session"\nshape = "levels"\n'
        'labels = [1, 2]\ncoefficients = [1.0]\n',
        encoding="utf-8",
    )  # fmt: skip
    faults = {one.place: one.message for one in gap_plan(tmp_path / "gap.toml")[1]}
    assert "as many numbers as a curve has knots" in faults["unresolved[0].heights"]
    assert "must be a list of texts" in faults["unresolved[1].labels"]

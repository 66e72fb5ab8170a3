"""`[variables.NAME.measured]`: distributions and standard deviations from measured parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tomli_w
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.errors import InputError

VALUES = np.random.default_rng(7).normal(0.6, 1.1, 40).round(3)
"""Deviations from the nominal [um]."""
SAMPLE = {"values": VALUES.tolist(), "made_to": "4 um"}
PIN = "pin_radius_um"
ARM = "joint_line_1_mrad"
"""A standard deviation of the default grouping of `pose_accuracy`."""


def table_of(problem: str, name: str, measured: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"problem": problem, "variables": {name: {"measured": measured} | more}}


def problem_of(folder: Path, table: dict[str, Any]) -> Any:
    (folder / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    return read(folder / "c.toml").problem


def stated(folder: Path, cp: float, mid: float, **more: Any) -> Any:
    """The same problem with the distribution and the mean written by hand."""
    own = {"distribution": "normal", "cp": cp, "mid": mid} | more
    return problem_of(folder, {"problem": "rv_backlash", "variables": {PIN: own}})


def outputs(problem: Any, at: float) -> pd.DataFrame:
    designs = np.array([[float(v.document) for v in problem.variables]])
    designs[:, problem.names.index(PIN)] = at
    found: pd.DataFrame = problem.frame(designs)
    return found


@pytest.mark.parametrize("mean", ["corrected", "as_found"])
def test_a_half_width_has_the_scatter_and_mean_of_its_parts(mean: str, tmp_path: Path) -> None:
    """Equal to a normal law with Cp = made_to/(3 s) about the mean of the parts, but for rounding
    of the mean, which the convolution carries on.
    """
    measured = problem_of(tmp_path, table_of("rv_backlash", PIN, SAMPLE | {"mean": mean}))
    cp = 4.0 / (3.0 * VALUES.std(ddof=1))
    middle = -1.0 if mean == "corrected" else float(VALUES.mean())
    by_hand = stated(tmp_path, cp, middle)
    for at in (1.0, 4.0):
        one, other = outputs(measured, at), outputs(by_hand, at)
        np.testing.assert_allclose(one["backlash_arcmin"], other["backlash_arcmin"], rtol=1e-9)
        np.testing.assert_allclose(one["interference_probability"],
                                   other["interference_probability"], rtol=1e-9)  # fmt: skip
    assert measured.zone(PIN) == (None, -1.0)  # the drawing keeps its zone
    form, other_form = measured.form(), by_hand.form()
    assert form is not None
    assert form.outputs == other_form.outputs


def test_a_fixed_half_width_needs_no_half_width_of_the_parts(tmp_path: Path) -> None:
    """`made_to = "fixed"`: the standard deviation is that of the parts, whatever the zone."""
    given = {"values": VALUES.tolist(), "made_to": "fixed", "mean": "corrected"}
    for value in (2.0, 5.0):
        problem = problem_of(tmp_path, table_of("rv_backlash", PIN, given, value=value))
        law = problem.settings.variables[PIN].distribution
        assert value * law.sigma == pytest.approx(VALUES.std(ddof=1), rel=1e-12)


def test_the_exact_contact_and_a_model_take_it_too(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, table_of("rv_reducer", PIN, SAMPLE))
    assert problem.settings.variables[PIN].centre == pytest.approx(float(VALUES.mean()))
    table = {"model": "rv_batch", "variables": {PIN: {"measured": SAMPLE, "value": 3.0}}}
    (tmp_path / "m.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    setting = read(tmp_path / "m.toml").settings.variables[PIN]
    assert setting.centre == pytest.approx(float(VALUES.mean()))


def test_a_standard_deviation_is_that_of_the_parts(tmp_path: Path) -> None:
    values = (VALUES / 100.0).tolist()
    for name, variable in (("pose_accuracy", ARM), ("robot_joint", None), ("serial_arm", None)):
        variable = variable or sigma_of(tmp_path, name)
        given = {"values": values, "mean": "corrected"}
        problem = problem_of(tmp_path, table_of(name, variable, given))
        assert problem.fixed[variable] == pytest.approx(VALUES.std(ddof=1) / 100.0, rel=1e-12)


def sigma_of(folder: Path, problem: str) -> str:
    """A link's standard deviation of a robot."""
    free = problem_of(folder, {"problem": problem}).free
    return next(str(v.name) for v in free if v.kind == "standard deviation" and v.name.endswith("mrad"))


def test_errors_without_a_mid_limit_are_centred(tmp_path: Path) -> None:
    name = "gear_1_z_mrad"
    given = {"values": (VALUES - VALUES.mean()).tolist(), "made_to": 4.0, "mean": "corrected"}
    problem = problem_of(tmp_path, table_of("rv_transmission_error", name, given))
    sigma = problem.settings.variables[name].distribution.sigma
    assert 4.0 * sigma == pytest.approx(VALUES.std(ddof=1), rel=1e-12)
    for where in ("rv_transmission_error", "pose_accuracy"):
        variable = name if where.startswith("rv") else ARM
        text = faults(tmp_path, table_of(where, variable, SAMPLE | {"made_to": 4.0}))
        assert f'variables.{variable}.measured.mean: must be "corrected"' in text


def test_a_semicolon_file_is_read_said_and_stored(tmp_path: Path) -> None:
    """Sizes in a German file; what is known stands in the check, capability.csv and on the page."""
    rows = [f"{at};{3.0 + value / 1000.0:.6f}".replace(".", ",") for at, value in enumerate(VALUES)]
    text = "\n".join(["Stück;Radius [mm]", *rows])
    (tmp_path / "pins.csv").write_text(text, encoding="cp1252")
    measured = {"file": "pins.csv", "characteristic": "Radius", "nominal": 3.0,
                "made_to": "4 um", "mean": "as_found"}  # fmt: skip
    table = table_of("rv_backlash", PIN, measured)
    for name, value in (("dr_rp_mm", -0.04), ("dr_p_mm", -0.07), ("stagger_arcmin", 0.0)):
        table["variables"][name] = {"value": value}
    table |= {"objectives": {"minimise": ["cost"]}, "references": "none",
              "algorithm": {"name": "ga", "population": 8, "evaluations": 16}}  # fmt: skip
    (tmp_path / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    cli = CliRunner()
    checked = cli.invoke(app, ["check", str(tmp_path / "c.toml")])
    assert checked.exit_code == 0, checked.output
    assert f"variables.{PIN}.measured = 40 parts: mean " in checked.output
    assert "distribution A1 (ISO 22514-2)" in checked.output
    done = cli.invoke(app, ["run", str(tmp_path / "c.toml"), "--out", str(tmp_path / "o")])
    assert done.exit_code == 0, done.output
    known = pd.read_csv(tmp_path / "o" / "capability.csv")
    assert known["part"].unique().tolist() == [PIN]
    found = dict(zip(known["index"], known["value"], strict=True))
    assert found["Cp"] == pytest.approx(4.0 / (3.0 * VALUES.std(ddof=1)), rel=1e-6)
    off = abs(float(VALUES.mean()) + 1.0)
    assert found["Cpk"] == pytest.approx((4.0 - off) / (3.0 * VALUES.std(ddof=1)), rel=1e-6)
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    assert "Measured parts" in page
    assert "Control charts" in page
    again = read(tmp_path / "o" / "config.toml")
    assert again.toml() == read(tmp_path / "c.toml").toml()


def faults(folder: Path, table: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        problem_of(folder, table)
    return "\n".join(map(str, caught.value.faults))


WRONG: list[tuple[dict[str, Any], dict[str, Any], list[str]]] = [
    ({"values": [1.0], "made_to": 4.0}, {}, ["measured.values: has 1 values; at least 5"]),
    ({"values": [1.0] * 9, "made_to": 4.0}, {}, ["measured.values: has 9 equal values"]),
    (SAMPLE | {"gauge": {"sigma": 3.0}}, {}, ["the gauge is unfit for these parts"]),
    ({"values": (VALUES * 1000.0).tolist(), "made_to": 4.0}, {}, ["lie up to", "their unit"]),
    ({"values": (VALUES / 1000.0).tolist(), "made_to": 4.0}, {}, ["scatter by", "was mm meant?"]),
    ({"values": VALUES.tolist()}, {}, ["measured.made_to: is missing"]),
    ({"values": VALUES.tolist(), "made_to": "fixed"}, {}, ["measured.made_to: cannot be fixed"]),
    ({"file": "none.csv", "made_to": 4.0}, {}, ["measured.file: none.csv does not exist"]),
    (SAMPLE | {"uint": "um"}, {"distribution": "uniform", "cp": 1.0},
     ["distribution: is stated in addition to measured", "measured.uint"]),
    (SAMPLE, {"machine": [{"name": "a", "price": 1.0, "sigma": 1.0}]},
     ["measured: is stated in addition to machines"]),
]  # fmt: skip


@pytest.mark.parametrize(("measured", "more", "words"), WRONG)
def test_what_is_wrong_is_placed(
    measured: dict[str, Any], more: dict[str, Any], words: list[str], tmp_path: Path
) -> None:
    text = faults(tmp_path, table_of("rv_backlash", PIN, measured, **more))
    assert f"variables.{PIN}." in text
    for word in words:
        assert word in text


def test_variables_without_a_distribution_take_none(tmp_path: Path) -> None:
    for name in ("dr_p_mm", "crank_bearing_um", "involute_grade"):
        text = faults(tmp_path, table_of("rv_backlash", name, SAMPLE))
        assert f"variables.{name}.measured: {name} (" in text
        assert "takes no measured parts" in text

"""What the shop floor sends and gets: long tables, cavities, gauge studies, Q-DAS there and back."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tomli_w
from typer.testing import CliRunner

import tolevo
from tolevo.cli import app

pytestmark = pytest.mark.usefixtures("unrendered")

BASE = """
problem = "stack"
currency = "EUR"
[objectives]
minimise = ["cost"]
[limits]
yield_percent = 99.0
[algorithm]
name = "exact"
[requirement]
name = "gap"
unit = "mm"
lower = 9.9
upper = 10.1
[[part]]
name = "insert"
nominal = 10.0
sensitivity = 1.0
t_min = 0.01
t_max = 0.2
characteristic = "17"
cost = { model = "reciprocal", a = 1.0, b = 0.2 }
[part.measured]
file = "parts.csv"
characteristic = "d"
made_to = 0.05
mean = "as_found"
"""
CAVITIES = np.random.default_rng(7).normal(10.0, 0.004, 80) + 0.03 * (np.arange(80) % 4 == 1)


def config(folder: Path, **measured: object) -> Path:
    table = tomllib.loads(BASE)
    table["part"][0]["measured"] |= measured
    (folder / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    rows = pd.DataFrame({"d [mm]": CAVITIES.round(5), "Nest": np.arange(80) % 4 + 1})
    rows.to_csv(folder / "parts.csv", index=False)
    return folder / "c.toml"


def sigma_of(path: Path) -> tuple[float, float]:
    """Standard deviation and degrees of freedom of the part in the problem of a configuration."""
    run = tolevo.run(path)
    assert run.record.capability is not None
    return float(run.record.capability["std"].iloc[0]), float(run.record.capability["df"].iloc[0])


def test_cavities_as_found_corrected_or_one(tmp_path: Path) -> None:
    groups = [CAVITIES.round(5)[at::4] for at in range(4)]
    within = np.sqrt(np.mean([group.var(ddof=1) for group in groups]))
    found, df = sigma_of(config(tmp_path))
    assert found == pytest.approx(CAVITIES.round(5).std(ddof=1), rel=1e-9)
    assert df > 79.0  # cavities that stay: their means are known better than the scatter of lots
    assert sigma_of(config(tmp_path, subgroups="corrected")) == pytest.approx((within, 76.0), rel=1e-9)
    alone = sigma_of(config(tmp_path, subgroups={"cavity": "2"}))
    assert alone == pytest.approx((groups[1].std(ddof=1), 19.0), rel=1e-9)


def test_what_a_correction_gives_and_is_worth(tmp_path: Path) -> None:
    run = tolevo.run(config(tmp_path))
    text = "\n".join(run.lines)
    assert "cavity 2 is 0.0301 mm high: correcting it gives Cpk 4.61 instead of 1.06" in text
    worth = float(run.summary["answers"]["corrections"].split("is worth ")[1].split()[0])
    corrected = tolevo.run(config(tmp_path, subgroups="corrected"))
    saved = float(run.front["cost"].iloc[0] - corrected.front["cost"].iloc[0])
    assert worth == pytest.approx(saved, rel=0.02)
    assert worth > 0.1


def test_one_cavity_that_stands_out_has_a_worth_of_its_own(tmp_path: Path) -> None:
    """The worth of setting one cavity right is that of the run on the parts with that cavity set right."""
    run = tolevo.run(config(tmp_path))
    text = run.summary["answers"]["corrections"]
    assert text.startswith(
        "Of insert, cavity 2 is 0.0301 mm high: correcting it gives Cpk 4.61 instead of 1.06, and is"
    )
    moved = CAVITIES.round(5) - 0.0301 * (np.arange(80) % 4 == 1)
    path = config(tmp_path)
    pd.DataFrame({"d [mm]": moved}).to_csv(tmp_path / "parts.csv", index=False)
    saved = float(run.front["cost"].iloc[0] - tolevo.run(path).front["cost"].iloc[0])
    assert float(text.split("is worth ")[1].split()[0]) == pytest.approx(saved, rel=0.03)


def test_a_mixture_has_the_yield_of_its_cavities(tmp_path: Path) -> None:
    """The yield of a given tolerance by the exact sum over the cavities, not by one normal law."""
    from scipy import stats

    design = pd.DataFrame({"insert_t": [0.13]})
    found = tolevo.evaluate(config(tmp_path), design)["yield_percent"].iloc[0]
    groups = [CAVITIES.round(5)[at::4] for at in range(4)]
    within = np.sqrt(np.mean([group.var(ddof=1) for group in groups]))
    mean, total = CAVITIES.round(5).mean(), CAVITIES.round(5).std(ddof=1)
    centres = np.array([group.mean() for group in groups]) - mean
    scale = total / np.hypot(within, np.sqrt(np.mean(centres**2))) * 0.13 / 0.05
    law = stats.norm(mean + scale * centres, scale * within)
    expected = 100.0 * np.mean(law.cdf(10.1) - law.cdf(9.9))
    assert found == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("subgroups", "words"),
    [
        ({"cavity": "9"}, "names cavity 9, and the measured parts have cavity 1, 2, 3, 4"),
        ({"machine": "9"}, "names machine 9, and the measured parts have cavity"),
        ("mixed", 'must be "as_found", "corrected" or one group'),
    ],
)
def test_faults_of_subgroups(tmp_path: Path, subgroups: object, words: str) -> None:
    with pytest.raises(tolevo.ConfigurationError, match=words):
        tolevo.check(config(tmp_path, subgroups=subgroups))


def study_of(folder: Path, kind: int, operators: int, trials: int, values: np.ndarray) -> Path:
    """A configuration whose gauge is a Q-DAS study with values in the order of operators, parts, trials."""
    keys = {"K0100": 1, "K2002": "d", "K2142": "mm", "K2202": kind, "K2205": 10, "K2220": operators, "K2221": trials}
    lines = [f"{key} {value}" for key, value in keys.items()] + [f"K0001/1 {value:.5f}" for value in values.ravel()]
    (folder / "study.dfq").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return config(folder, gauge={"file": "study.dfq"}, subgroups="corrected")


def test_a_study_of_qdas_counts_its_operators_parts_and_trials(tmp_path: Path) -> None:
    """Parts that differ by far more than the gauge scatters leave its scatter as it is."""
    rng = np.random.default_rng(12)
    values = 10.0 + 0.01 * np.arange(10)[None, :, None] + rng.normal(0.0, 0.002, (3, 10, 3))
    within = np.sqrt(values.var(axis=2, ddof=1).mean())
    text = tolevo.check(study_of(tmp_path, 2, 3, 3, values))
    assert "gauge study of type 2" in text
    assert float(text.split("repeatability ")[1].split(",")[0]) == pytest.approx(within, rel=0.1)
    assert "gauge study of type 3" in tolevo.check(study_of(tmp_path, 3, 1, 9, values.swapaxes(0, 1)))
    with pytest.raises(tolevo.ConfigurationError, match=r"3 operators \(K2220\), 10 parts .* and has 60 values"):
        tolevo.check(study_of(tmp_path, 2, 3, 3, values[:2]))
    study_of(tmp_path, 2, 3, 3, values)
    with pytest.raises(tolevo.ConfigurationError, match="is a gauge study"):
        tolevo.check(config(tmp_path, file="study.dfq"))
    study = study_of(tmp_path, 1, 1, 90, values).with_name("study.dfq")  # of type 1, with its reference
    study.write_text(study.read_text(encoding="utf-8").replace("K2202", "K2213 10.0\nK2202"), encoding="utf-8")
    with pytest.raises(tolevo.ConfigurationError, match="is a gauge study"):
        tolevo.check(config(tmp_path, file="study.dfq"))


def test_trials_in_columns_are_one_study(tmp_path: Path) -> None:
    rng = np.random.default_rng(13)
    values = 10.0 + 0.01 * np.repeat(np.arange(10), 2)[:, None] + rng.normal(0.0, 0.002, (20, 3)).round(5)
    table = pd.DataFrame(values, columns=["Trial1 [mm]", "Trial2 [mm]", "Trial3 [mm]"])
    table.insert(0, "Part", np.repeat(np.arange(10), 2))
    table.insert(1, "Operator", ["A", "B"] * 10)
    table.to_csv(tmp_path / "study.csv", index=False)
    text = tolevo.check(config(tmp_path, gauge={"file": "study.csv"}, subgroups="corrected"))
    repeatability = float(text.split("repeatability ")[1].split(",")[0])
    assert repeatability == pytest.approx(np.sqrt(values.var(axis=1, ddof=1).mean()), rel=0.1)


def test_a_gauge_study_is_the_gauge_of_measured_parts(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    rows = [{"part": p, "operator": o, "d [mm]": round(10.0 + 0.01 * p + value, 5)}
            for p in range(10) for o in "AB" for value in rng.normal(0.0, 0.002, 3)]  # fmt: skip
    pd.DataFrame(rows).to_csv(tmp_path / "study.csv", index=False)
    plain = sigma_of(config(tmp_path, subgroups="corrected"))[0]
    path = config(tmp_path, gauge={"file": "study.csv"}, subgroups="corrected")
    studied = sigma_of(path)[0]
    assert np.sqrt(plain**2 - studied**2) == pytest.approx(0.002, rel=0.2)
    assert "gauge study of type 2" in tolevo.check(path)
    pd.DataFrame(rows[:20]).to_csv(tmp_path / "study.csv", index=False)
    with pytest.raises(tolevo.ConfigurationError, match=r"gauge\.values: has between 0 and 3 measurements"):
        tolevo.check(path)


def test_a_long_table_states_nominal_and_limits(tmp_path: Path) -> None:
    rng = np.random.default_rng(10)
    rows = [f"{p};{name};{10.0 + rng.normal(0, 0.01):.5f};10.0;0.05;-0.05\n" for p in range(30) for name in ("d", "e")]
    (tmp_path / "long.csv").write_text("part;id;actual;nominal;uppertol;lowertol\n" + "".join(rows), encoding="utf-8")
    table = tomllib.loads(BASE)
    table["part"][0]["measured"] = {"file": "long.csv", "characteristic": "d", "mean": "as_found"}
    (tmp_path / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    run = tolevo.run(tmp_path / "c.toml")
    assert run.record.capability is not None
    assert run.record.capability["made_to"].iloc[0] == pytest.approx(0.05, rel=1e-12)
    assert run.record.capability["parts"].iloc[0] == 30
    table["part"][0]["nominal"] = 10.5
    (tmp_path / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    with pytest.raises(tolevo.ConfigurationError, match=r"is of a nominal of 10 mm, the part has 10\.5 mm"):
        tolevo.check(tmp_path / "c.toml")


def test_limits_about_another_middle_are_asked_about(tmp_path: Path) -> None:
    """10 +0.06/-0.05 in the file: Cpk refers to 9.95 and 10.06, by the middle 10.005 or not at all."""
    values = np.random.default_rng(10).normal(10.01, 0.012, 30).round(4)

    def write(name: str, upper: float, lower: float) -> None:
        rows = [f"{at};d;{value};10.0;{upper};{lower}\n" for at, value in enumerate(values)]
        (tmp_path / name).write_text("part;id;actual;nominal;uppertol;lowertol\n" + "".join(rows), encoding="utf-8")

    write("off.csv", 0.06, -0.05)
    write("a.csv", 0.055, -0.055)
    table = tomllib.loads(BASE)
    part = table["part"][0]

    def checked(**measured: object) -> None:
        part["measured"] = {"characteristic": "d", "mean": "as_found", **measured}
        (tmp_path / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
        tolevo.check(tmp_path / "c.toml")

    with pytest.raises(tolevo.ConfigurationError, match=r"is 10\.005 mm, the middle of the limits of these parts"):
        checked(file="off.csv")
    with pytest.raises(tolevo.ConfigurationError, match="mixes files of different middles of the limits"):
        checked(file=["a.csv", "off.csv"])
    checked(file="off.csv", made_to=0.05)  # the limits of the drawing have changed since
    part["nominal"] = 10.005
    checked(file="off.csv", nominal=10.005)
    sigma, mean = values.std(ddof=1), values.mean()
    cpk = min(10.06 - mean, mean - 9.95) / (3.0 * sigma)
    assert f"Cpk {cpk:.2f} (" in invoked("check", tmp_path / "c.toml")


def invoked(*arguments: object) -> str:
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == 0, done.output
    return done.output


def test_q_das_there_and_back(tmp_path: Path) -> None:
    """Limits are those of the drawing to the last digit; results come back by their number alone."""
    invoked("run", config(tmp_path), "--out", tmp_path / "o", "--quiet")
    invoked("template", "qdas", "--run", tmp_path / "o", "--out", tmp_path / "plan.dfq")
    (described,) = tolevo.read_aqdef(tmp_path / "plan.dfq")
    drawing = pd.read_csv(tmp_path / "o" / "allocation.csv").iloc[0]
    limits = (described.nominal, described.lower, described.upper, described.unit)
    assert limits == (drawing["nominal"], drawing["lower_limit"], drawing["upper_limit"], "mm")
    assert (described.number, described.name) == ("17", "insert")
    values = np.random.default_rng(4).normal(10.002, 0.02, 40).round(4)
    renamed = (tmp_path / "plan.dfq").read_text().replace("K2002/1 insert", "K2002/1 Merkmal 0815")
    back = renamed + "".join(f"K0001/1 {value}\n" for value in values)
    (tmp_path / "back.dfq").write_text(back, encoding="utf-8")
    pd.DataFrame({"insert [mm]": values}).to_csv(tmp_path / "back.csv", index=False)
    by_number, by_name = (invoked("review", tmp_path / "o", tmp_path / f) for f in ("back.dfq", "back.csv"))
    assert by_number == by_name
    other = back.replace("K2001/1 17", "K2001/1 18")
    (tmp_path / "back.dfq").write_text(other, encoding="utf-8")
    done = CliRunner().invoke(app, ["review", str(tmp_path / "o"), str(tmp_path / "back.dfq")])
    assert done.exit_code == 2
    assert "hold no characteristic of the run" in done.output


def test_a_template_of_limits_needs_a_run(tmp_path: Path) -> None:
    for arguments in (["qdas"], ["designs", "--run", str(tmp_path)], ["qdas", "--run", str(tmp_path)]):
        assert CliRunner().invoke(app, ["template", *arguments]).exit_code == 2


MIXED = """problem = "stack"
[objectives]
minimise = ["cost"]
[limits]
yield_percent = 99.0
[requirement]
name = "gap"
unit = "{of_gap}"
lower = {lower}
upper = {upper}
[[part]]
name = "housing"
unit = "{unit}"
nominal = {housing}
sensitivity = {a}
t_min = {low}
t_max = {high}
cost = {{ model = "reciprocal", a = 1.0, b = {low} }}
[[part]]
name = "shaft"
nominal = {shaft}
sensitivity = -1.0
t_min = {t}
t_max = {t_max}
cost = {{ model = "reciprocal", a = 1.0, b = {t} }}
[[part]]
name = "seat"
nominal = 0.0
sensitivity = -1.0
limits = "+{seat}/0"
geometry = "concentricity"
"""
UNITS: dict[str, dict[str, object]] = {
    "mm": {
        "of_gap": "mm",
        "lower": 0.3,
        "upper": 0.7,
        "unit": "mm",
        "housing": 30.5,
        "a": 1,
        "low": 0.02,
        "high": 0.3,
        "shaft": 30.0,
        "t": 0.03,
        "t_max": 0.3,
        "seat": 0.04,
    },
    "um and mm": {
        "of_gap": "um",
        "lower": 300,
        "upper": 700,
        "unit": "mm",
        "housing": 30.5,
        "a": 1000,
        "low": 0.02,
        "high": 0.3,
        "shaft": 30000.0,
        "t": 30,
        "t_max": 300,
        "seat": 40,
    },
    "inch": {
        "of_gap": "inch",
        "lower": 0.012,
        "upper": 0.028,
        "unit": "inch",
        "housing": 1.27,
        "a": 1,
        "low": 0.001,
        "high": 0.01,
        "shaft": 1.25,
        "t": 0.001,
        "t_max": 0.01,
        "seat": 0.002,
    },
}


@pytest.mark.parametrize("units", UNITS)
def test_q_das_of_several_units_and_a_natural_limit(tmp_path: Path, units: str) -> None:
    """The keys are taken from the text by hand; files in the drawing's and in another unit give one review."""
    (tmp_path / "c.toml").write_text(MIXED.format(**UNITS[units]), encoding="utf-8")
    invoked("run", tmp_path / "c.toml", "--out", tmp_path / "o", "--quiet")
    text = invoked("template", "qdas", "--run", tmp_path / "o")
    keys = [dict(re.findall(rf"(K\d+)/{at} (.*)", text)) for at in (1, 2, 3)]
    drawing = pd.read_csv(tmp_path / "o" / "allocation.csv")
    rows: list[Any] = list(drawing.itertuples())
    for row, stated in zip(rows, keys, strict=True):
        limits = [float(stated[key]) for key in ("K2101", "K2110", "K2111")]
        assert limits == [row.nominal, row.lower_limit, row.upper_limit]
        assert limits[1:] == pytest.approx([row.nominal + row.mid - row.rounded, row.nominal + row.mid + row.rounded])
        assert stated["K2142"] == row.unit
    assert [stated["K2120"] for stated in keys] == ["1", "1", "2"]
    rng, numbered, in_um = np.random.default_rng(7), text, {}
    for at, (row, stated) in enumerate(zip(rows, keys, strict=True), 1):
        values = row.nominal + row.mid + rng.normal(0.0, row.rounded / 4.0, 25).round(6)
        numbered = numbered.replace(f"K2002/{at} {stated['K2002']}", f"K2002/{at} feature {at}")
        numbered += "".join(f"K0001/{at} {value:.9g}\n" for value in values)
        factor = {"mm": 1e3, "inch": 25.4e3, "um": 1.0}[row.unit]
        in_um[f"{stated['K2002']} [um]"] = [float(f"{value:.9g}") * factor for value in values]
    (tmp_path / "back.dfq").write_text(numbered, encoding="utf-8")
    pd.DataFrame(in_um).to_csv(tmp_path / "back.csv", index=False)
    by_number, by_name = (invoked("review", tmp_path / "o", tmp_path / f) for f in ("back.dfq", "back.csv"))
    assert by_number == by_name
    assert all(name in by_number for name in ("housing", "shaft", "seat"))

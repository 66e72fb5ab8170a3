"""Bad stacks: every fault at once, named and placed; the configuration is that of a user."""

from __future__ import annotations

from pathlib import Path

import pytest

from tolevo.configuration.reader import read
from tolevo.errors import InputError

HEAD = """
problem = "stack"
[requirement]
unit = "mm"
formula = "sqrt(a) + b/c"
lower = 7.0
upper = 9.0
"""
PARTS = """
[[part]]
name = "a"
unit = "mm"
nominal = 25.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "b"
unit = "mm"
nominal = 30.0
t_min = 0.01
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.2 }
[[part]]
name = "c"
unit = "mm"
nominal = 10.0
tolerance = 0.1
"""
WHOLE = HEAD + PARTS


def faults(text: str, folder: Path) -> list[str]:
    path = folder / "c.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read(path)
    return [str(fault) for fault in caught.value.faults]


def test_the_whole_is_read(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(WHOLE, encoding="utf-8")
    assert read(path).problem is not None


CASES = [
    ("b/c", "b/cc", "requirement.formula", 'column 13: "cc" is not a part'),
    ("b/c", "b", "part[2].name", "does not appear in the formula"),
    ("b/c", "b/(c - 10)", "requirement.formula", "at the nominal values, column 12: division by"),
    ("b/c", "b/(c - 9.95)", "requirement.formula", "tightest tolerances, column 12: division"),
    ("sqrt(a)", "acos(a/25)", "requirement.formula", "tightest tolerances, column 1: acos"),
    ("sqrt(a)", "0*a", "part[0].name", "does not depend on a anywhere within the tolerances"),
    ("sqrt(a)", "__import__('os').system('true')", "requirement.formula", "column"),
    ("sqrt(a)", "a.real", "requirement.formula", "attributes are not part of a formula"),
    ("sqrt(a)", "open(a)", "requirement.formula", "`open` is not a function of formulas"),
    ("sqrt(a)", "(" * 5000 + "a" + ")" * 5000, "requirement.formula", "at most 4000 characters"),
    ("sqrt(a)", "sqrt(a - 25)", "requirement.formula", "sqrt needs a value of at least 0"),
    ("lower = 7.0", "lower = 9.0", "requirement.lower", "must be below upper (9), got 9"),
    ("lower = 7.0", "lowr = 7.0", "requirement.lowr", "did you mean `lower`"),
    ("lower = 7.0", "nominal = 8.1", "requirement.nominal", "formula gives 8 mm"),
    ("lower = 7.0", 'method = "rs"', "requirement.method", "did you mean `rss`"),
    ('unit = "mm"\nformula', 'unit = "zorks"\nformula', "requirement.unit", "not a unit"),
    ('unit = "mm"\nformula', 'unit = "degC"\nformula', "requirement.unit", "zero of its own"),
    ('formula = "sqrt(a) + b/c"', "", "requirement.formula", "or a sensitivity for every part"),
    ('name = "b"', 'name = "a"', "part", "already a name of part a"),
    ('name = "b"', 'name = "2b"', "part[1].name", "begin with a letter"),
    ('name = "b"', 'name = "pi"', "part[1].name", "means something in formulas"),
    ('name = "b"\n', "", "part[1].name", "is missing"),
    ('"b"\nunit = "mm"', '"b"\nunit = "mmm"', "part[1].unit", "(part b)"),
    ("nominal = 30.0\n", "", "part[1].nominal", "the formula needs it (part b)"),
    ("nominal = 30.0", 'nominal = "3 deg"', "part[1].nominal", "unit of mm"),
    ("nominal = 30.0", "nominal = 30.0\ncount = 0", "part[1].count", "got 0 (part b)"),
    ("nominal = 30.0", "nominal = 30.0\ncount = 2", "requirement.formula", "write b_1, b_2"),
    ("nominal = 30.0", "nominal = 30.0\nsensitivity = 1.0", "part[1].sensitivity", "keep only one"),
    ("b = 0.2", "b = -0.2", "part[1].cost.b", "rise with the tolerance), got -0.2 (part b)"),
    ('"reciprocal", a = 1.0, b = 0.2', '"recip", a = 1.0, b = 0.2', "part[1].cost.model",
     "did you mean `reciprocal`"),
    ("a = 1.0, b = 0.2", "b = 0.2", "part[1].cost.a", "is missing"),
    ('cost = { model = "reciprocal", a = 1.0, b = 0.2 }', "", "part[1].cost", "is missing"),
    ('"reciprocal", a = 1.0, b = 0.2', '"table", t = [0.5, 0.9], cost_at = [3.0, 1.0]',
     "part[1].t_min", "must have a finite cost"),
    ("tolerance = 0.1", "", "part[2]", "needs one statement of its tolerance and has none"),
    ("tolerance = 0.1", 'tolerance = 0.1\ngrade = "IT6"', "part[2]", "has too many"),
    ("tolerance = 0.1", "tolerance = -0.1", "part[2].tolerance", "at least 0"),
    ("tolerance = 0.1", 'tolerance = "1 rad"', "part[2].tolerance", "unit of mm"),
    ("tolerance = 0.1", "t_min = 0.3\nt_max = 0.1\ncost = { model = 'reciprocal', a = 1, b = 1 }",
     "part[2].t_min", "must be below t_max (0.1), got 0.3"),
    ("tolerance = 0.1", "t_min = 0.1\ncost = { model = 'reciprocal', a = 1, b = 1 }",
     "part[2].t_max", "is missing"),
    ("tolerance = 0.1", "t_min = -0.1\nt_max = 0.1\ncost = { model = 'reciprocal', a = 1, b = 1 }",
     "part[2].t_min", "above 0"),
    ("tolerance = 0.1", 'limits = "0.1"', "part[2].limits", "+0.02/-0.01"),
    ("tolerance = 0.1", 'limits = "+0.1/+0.1"', "part[2].limits", "must be below"),
    ("tolerance = 0.1", 'grade = "IT20"', "part[2].grade", "is not a grade"),
    ("tolerance = 0.1", 'fit = "10 w6"', "part[2].fit", "not a letter of a fundamental deviation"),
    ("tolerance = 0.1", 'fit = "10 H7/g6"', "part[2].fit", "[[fit]]"),
    ("tolerance = 0.1", 'general = "x"', "part[2].general", "must be one of f, m, c, v"),
    ("tolerance = 0.1", 'general = "m"\nfeature = "hole"', "part[2].feature",
     "one of length, radius"),
    ("tolerance = 0.1", 'general = "H"\ngeometry = "position"', "part[2].general", "got position"),
    ("tolerance = 0.1", 'tolerance = 0.1\ngeometry = "round"', "part[2].geometry",
     "must be one of"),
    ("tolerance = 0.1", 'tolerance = 0.1\ndrawing = 1.5', "part[2].drawing", "must be a string"),
    ("tolerance = 0.1", 'grade = ["IT8", "IT5"]\nprice = { IT5 = 2 }', "part[2].grade",
     "the finer one first"),
    ("tolerance = 0.1", 'grade = ["IT5", "IT20"]\nprice = { IT5 = 2 }', "part[2].grade",
     '"IT20" is not a grade'),
    ("tolerance = 0.1", 'grade = ["IT5", "IT6"]\nprice = { IT5 = 2 }', "part[2].price.IT6",
     "needs its price"),
    ("tolerance = 0.1", 'grade = ["IT5", "IT6"]\nprice = { IT5 = 2, IT6 = 1, IT7 = 1 }',
     "part[2].price.IT7", "not a known key"),
    ("tolerance = 0.1", 'grade = ["IT5", "IT6"]', "part[2].cost", "by grade"),
    ("tolerance = 0.1", 'fit = "12 H7"', "part[2].fit", "nominal is 10 mm"),
    ("nominal = 10.0\ntolerance = 0.1", 'nominal = 600.0\ngrade = "IT6"', "part[2].grade",
     "up to 500 mm"),
    ("tolerance = 0.1", 'tolerance = 0.1\ndistribution = "normel"', "part[2].distribution",
     "did you mean `normal`"),
    ("tolerance = 0.1", "tolerance = 0.1\ncp = 0.0", "part[2].cp", "above 0"),
    ("tolerance = 0.1", "tolerance = 0.1\ncp = 1.1\ncpk = 1.3", "part[2].cpk", "must not be above"),
    ("tolerance = 0.1", "tolerance = 0.1\ncpk = 0.9\nshift = 0.1", "part[2].cpk", "shift"),
    ("tolerance = 0.1", "tolerance = 0.1\ncolour = 1", "part[2].colour", "not a known key"),
    ("tolerance = 0.1", "process = []", "part[2].process", "at least one"),
    ("tolerance = 0.1", "process = [{ name = 'x', t_min = 1, t_max = 2 }]",
     "part[2].process[0].cost", "is missing"),
    ("tolerance = 0.1", "[[part.process]]\nt_min = 1", "part[2].process[0].name", "is missing"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "place", "words"), CASES)
def test_fault(old: str, new: str, place: str, words: str, tmp_path: Path) -> None:
    assert old in WHOLE
    found = faults(WHOLE.replace(old, new, 1), tmp_path)
    assert any(one.startswith(f"{place}: ") and words in one for one in found), found


@pytest.mark.parametrize(
    ("table", "place", "words"),
    [
        ('[[correlation]]\nparts = ["a", "b"]\ncoefficient = 1.5',
         "correlation[0].coefficient", "must lie in [-1, 1]"),
        ('[[correlation]]\nparts = ["a", "x"]\ncoefficient = 0.5', "correlation[0].parts",
         "is not a part"),
        ('[[correlation]]\nparts = ["a"]\ncoefficient = 0.5', "correlation[0].parts", "two"),
        ('[[correlation]]\nparts = ["a", "b"]', "correlation[0].coefficient", "missing"),
        ('[[correlation]]\nparts = ["a", "b"]\ncoefficient = 0.9\n[[correlation]]\n'
         'parts = ["c", "b"]\ncoefficient = 0.9\n[[correlation]]\nparts = ["a", "c"]\n'
         "coefficient = -0.9", "correlation", "not positive semidefinite"),
        ('[[correlation]]\nparts = ["a", "b"]\ncoefficient = 0.9\n[[correlation]]\n'
         'parts = ["b", "a"]\ncoefficient = 0.9', "correlation[1].parts", "already"),
        ("[variables.a_t]\nvalue = 0.1", "variables", "[[part]]"),
        ("[costs.a_t]\nb = 0.1", "costs", "[[part]]"),
        ('[propagation]\nmethod = "moments"', "propagation.method", "requirement.method"),
        ("[limits]\nvariation = 0.001", "limits.variation", "too much"),
        ("[limits]\nyield_percent = 101", "limits.yield_percent", "[0, 100]"),
        ("[limits]\nvariatoin = 1", "limits.variatoin", "did you mean `variation`"),
        ('[objectives]\nminimise = ["yield_percent"]', "objectives.minimise", "limit it"),
        ('[parameters]\nx = 1', "parameters", "no parameters"),
    ],
)  # fmt: skip
def test_fault_of_another_table(table: str, place: str, words: str, tmp_path: Path) -> None:
    found = faults(f"{WHOLE}\n{table}\n", tmp_path)
    assert any(one.startswith(f"{place}: ") and words in one for one in found), found


def test_correlated_parts_are_normal(tmp_path: Path) -> None:
    text = WHOLE.replace("tolerance = 0.1", 'tolerance = 0.1\ndistribution = "uniform"')
    text += '[[correlation]]\nparts = ["a", "c"]\ncoefficient = 0.5\n'
    assert "correlation[0].parts: c is not normal" in faults(text, tmp_path)[0]


def test_an_impossible_limit_says_by_how_much(tmp_path: Path) -> None:
    """Tightest worst case: 0.01/(2 sqrt 25) + 0.01/10 + 0.1 * 30/100 = 0.032 mm."""
    text = WHOLE.replace("lower = 7.0", 'method = "worst_case"')
    (found,) = faults(f"{text}\n[limits]\nvariation = 0.03\n", tmp_path)
    assert "0.032 mm, 0.002 mm too much" in found


def test_a_yield_needs_limits(tmp_path: Path) -> None:
    text = WHOLE.replace("lower = 7.0\nupper = 9.0", "")
    (found,) = faults(f"{text}\n[limits]\nyield_percent = 99\n", tmp_path)
    assert found.startswith("limits.yield_percent: needs requirement.lower")


@pytest.mark.parametrize("value", ['"x"', "[1]", "{}", "[]"])
def test_part_is_a_list_of_tables(value: str, tmp_path: Path) -> None:
    found = faults(f"part = {value}\n{HEAD}", tmp_path)
    assert any(one.startswith("part: ") for one in found), found


def test_every_fault_at_once(tmp_path: Path) -> None:
    text = WHOLE.replace("b = 0.1", "b = -0.1").replace("t_max = 0.2", "t_max = 0.001")
    text = text.replace("tolerance = 0.1", "tolerance = -1").replace("lower = 7.0", "lower = 10.0")
    found = faults(f"{text}\n[algorithm]\npopulation = 1\n[limits]\nvariatoin = 1\n", tmp_path)
    places = {one.split(":")[0] for one in found}
    assert places >= {"part[0].cost.b", "part[0].t_min", "part[1].t_min", "part[2].tolerance",
                      "requirement.lower", "algorithm.population", "limits.variatoin"}  # fmt: skip


EVERYWHERE = """
problem = "stack"
[objectives]
minimise = ["cost"]
[limits]
"gap.yield_percent" = 120
[rounding]
a_t = [3.0]
[[requirement]]
name = "gap"
unit = "mm"
formula = "a - b - c +"
[[requirement]]
name = "tilt"
unit = "mrad"
formula = "(a - d)/20"
[[part]]
name = "a"
nominal = 20
unit = "mm"
t_min = 0.01
t_max = 0.05
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "b"
nominal = 10
unit = "mm"
tolerance = -0.1
[[feature]]
name = "at"
kind = "position"
zone = 0.1
of = "bb"
[[let]]
name = "s"
formula = "a + b + at_x + zz"
[[condition]]
name = "hot"
temperature_C = "warm"
"""


def test_faults_of_formulas_features_and_rounding_come_with_those_of_parts(tmp_path: Path) -> None:
    places = [fault.split(": ")[0] for fault in faults(EVERYWHERE, tmp_path)]
    assert sorted(places) == [
        "condition[0].temperature_C", "feature[0].of", "let[0].formula", "limits.gap.yield_percent",
        "part[1].tolerance", "requirement[0].formula", "requirement[1].formula", "rounding.a_t",
    ]  # fmt: skip


def test_sensitivities_are_given_for_all(tmp_path: Path) -> None:
    text = WHOLE.replace('formula = "sqrt(a) + b/c"\n', "")
    text = text.replace('name = "a"', 'name = "a"\nsensitivity = 0.0')
    found = faults(text, tmp_path)
    assert any("part[0].sensitivity: must not be 0" in one for one in found)
    assert any("part[2].sensitivity: is missing" in one and "(part c)" in one for one in found)


@pytest.mark.parametrize("nominal", ["8.0", "8", '"8 mm"', '"0.8 cm"', '"8.000 mm"'])
def test_a_stated_nominal_may_be_rounded(nominal: str, tmp_path: Path) -> None:
    """sqrt(25.01) + 3 = 8.001: what is stated is right up to its last digit, and 0.1 %."""
    path = tmp_path / "c.toml"
    text = WHOLE.replace("lower = 7.0", f"nominal = {nominal}").replace("25.0\n", "25.01\n")
    path.write_text(text, encoding="utf-8")
    if nominal == '"8.000 mm"':
        assert "requirement.nominal" in faults(text, tmp_path)[0]
    else:
        assert read(path).problem is not None

"""`[[let]]`: intermediate quantities against the same formulas written out, by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import tolevo
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.expressions import Formula, Let, domain_margin
from tolevo.problems.stack import Stack

COST = {"model": "reciprocal", "a": 1.0, "b": 0.1}
CLUTCH: dict[str, Any] = {
    "problem": "stack",
    "requirement": {"unit": "rad", "formula": "acos(ratio)", "lower": 0.087, "upper": 0.157},
    "let": [
        {"name": "ratio", "formula": "(hub + r) / (cage - r)"},  # stands before what it depends on
        {"name": "r", "formula": "(roller_1 + roller_2)/2"},
    ],
    "part": [
        {"name": "hub", "nominal": 55.29, "unit": "mm", "t_min": 0.01, "t_max": 0.25, "cost": COST},
        {"name": "roller", "count": 2, "nominal": 22.86, "unit": "mm", "tolerance": 0.0127},
        {"name": "cage", "nominal": 101.6, "unit": "mm", "t_min": 0.15, "t_max": 0.4, "cost": COST},
    ],
}
WHOLE = "acos((hub + (roller_1 + roller_2)/2) / (cage - (roller_1 + roller_2)/2))"


def stack(tables: dict[str, Any], folder: Path) -> Stack:
    (folder / "c.toml").write_text(tomli_w.dumps(tables), encoding="utf-8")
    problem = read(folder / "c.toml").problem
    assert isinstance(problem, Stack)
    return problem


def faults(tables: dict[str, Any], folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        stack(tables, folder)
    return str(caught.value)


def test_a_let_is_the_formula_written_out(tmp_path: Path) -> None:
    own = stack(CLUTCH, tmp_path)
    whole = {key: value for key, value in CLUTCH.items() if key != "let"}
    other = stack(whole | {"requirement": CLUTCH["requirement"] | {"formula": WHOLE}}, tmp_path)
    x = np.random.default_rng(0).uniform(own.xl, own.xu, (20, own.n_var))
    found, expected = (problem.outputs_of(problem.complete(x)) for problem in (own, other))
    assert {name for name, value in expected.items() if np.any(np.isfinite(value))} > {"rss", "domain_margin"}
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-12, err_msg=name)
    np.testing.assert_allclose(own.measured[0].mechanism.sensitivities, other.measured[0].mechanism.sensitivities)


def test_what_is_written_back_reads_the_same(tmp_path: Path) -> None:
    own = stack(CLUTCH, tmp_path)
    tables = own.tables()
    assert tables["let"] == CLUTCH["let"]
    again = stack({"problem": "stack"} | tables, tmp_path)
    assert again.definition.intermediate == own.definition.intermediate
    assert "(roller_1 + roller_2)/2" in str(tolevo.check(tmp_path / "c.toml"))


def chain() -> Formula:
    """y = s*c + 3*s with s = a*b, c = cos(s) + a and a constant of 2 in s."""
    steps = Let("two", Formula("2")), Let("s", Formula("a*b + two")), Let("c", Formula("cos(s) + a"))
    return Formula("s*c + 3*s", (*steps, Let("unused", Formula("d"))))


def test_names_values_and_slopes_go_through_every_quantity() -> None:
    formula = chain()
    assert set(formula.names) == {"a", "b"} and set(formula.written) == {"s", "c"}
    a, b = np.array([0.3, -1.2]), np.array([2.0, 0.7])
    s = a * b + 2.0
    c = np.cos(s) + a
    np.testing.assert_allclose(formula.value({"a": a, "b": b}), s * c + 3.0 * s, rtol=1e-15)
    by_s = c + 3.0 - s * np.sin(s)
    slopes = formula.gradient({"a": a, "b": b})
    np.testing.assert_allclose(slopes["a"], by_s * b + s, rtol=1e-13)
    np.testing.assert_allclose(slopes["b"], by_s * a, rtol=1e-13)
    assert set(slopes) == {"a", "b"}
    assert set(formula.gradient({"a": a, "b": b}, by={"b"})) == {"b"}


@pytest.mark.parametrize(
    ("text", "step", "linear", "kinked"),
    [("2*s + a", "a/3 - b", True, False), ("s*a", "b", False, False), ("s*a", "7", True, False),
     ("s + b", "a*b", False, False), ("s/b", "a", False, False), ("s", "abs(a) + b", False, True)],
)  # fmt: skip
def test_what_a_formula_is_hangs_on_its_quantities(text: str, step: str, linear: bool, kinked: bool) -> None:
    formula = Formula(text, (Let("s", Formula(step)),))
    assert (formula.linear, formula.kinked) == (linear, kinked)


def test_the_domain_is_that_of_every_quantity() -> None:
    """sqrt(a - 1) at a = 1.75, the middle at a = 4: (1.75 - 1)/(4 - 1); 1/(r - 0.5) has r = sqrt(0.75)."""
    formula = Formula("1/(r - 0.5)", (Let("r", Formula("sqrt(a - 1)"), "let[0]"),))
    x, middle = {"a": np.array([1.75, 5.0])}, {"a": np.asarray(4.0)}
    near = min(0.75 / 3.0, (np.sqrt(0.75) - 0.5) / (np.sqrt(3.0) - 0.5))
    np.testing.assert_allclose(domain_margin(formula, x, middle), [near, 1.5 / (np.sqrt(3.0) - 0.5)], rtol=1e-12)
    assert formula.trouble({"a": np.array([0.5, 4.0])}).startswith("let[0]: column 1: sqrt needs a value of at least 0")
    assert formula.trouble({"a": np.array([1.1, 4.0])}).startswith("column 2: division by zero")
    assert formula.trouble({"a": np.array([1.5, 4.0])}) == ""


@pytest.mark.parametrize(
    ("lets", "message"),
    [
        ([{"name": "ratio", "formula": "hub/cage + r"}, {"name": "r", "formula": "roller_1 + roller_2 + ratio"}],
         "depends on itself: "),
        ([{"name": "ratio", "formula": "ratio + hub"}], "let[0]: depends on itself: ratio -> ratio; write one"),
        ([{"name": "ratio", "formula": "hub/cag"}], 'let[0].formula: column 5: "cag" is not a part'),
        ([{"name": "ratio", "formula": "hub/roller"}], "roller is built in 2 times: write roller_1, roller_2"),
        ([{"name": "hub", "formula": "cage"}], 'let[0]: "hub" is already a name of part hub; rename one'),
        ([{"name": "ratio", "formula": "hub"}, {"name": "ratio", "formula": "cage"}],
         'let[1]: "ratio" is already a name of let[0]'),
        ([*CLUTCH["let"], {"name": "spare", "formula": "hub/2"}], "let[2]: no requirement depends on spare"),
        ([{"name": "2r", "formula": "hub"}], "let[0].name: must be letters, digits and _"),
        ([{"name": "sin", "formula": "hub"}], "let[0].name: sin means something in formulas"),
        ([{"formula": "hub"}], "let[0].name: is missing"),
        ([{"name": "ratio"}], "let[0].formula: is missing"),
        ([{"name": "ratio", "formula": "hub +"}], "let[0].formula: column 6: ends too early"),
        ([{"name": "ratio", "formula": "hub", "unit": "mm"}], "let[0].unit: is not a known key"),
        ("hub", "let: must be a list of tables: write [[let]]"),
    ],
)  # fmt: skip
def test_faults_of_a_let_say_where_and_why(lets: object, message: str, tmp_path: Path) -> None:
    assert message in faults(CLUTCH | {"let": lets}, tmp_path)


def test_faults_of_several_lets_come_at_once(tmp_path: Path) -> None:
    lets = [{"name": "ratio", "formula": "hub +"}, {"name": "pi", "formula": "cage"}, {"formula": "hub"}]
    found = faults(CLUTCH | {"let": lets}, tmp_path)
    for place in ("let[0].formula", "let[1].name", "let[2].name"):
        assert place in found


def test_a_let_in_two_units_is_refused(tmp_path: Path) -> None:
    """Its 10 would be 10 mm in one requirement and 10 um in the other."""
    requirements = [
        {"name": name, "unit": unit, "formula": f"s {sign} cage"}
        for name, unit, sign in (("a", "mm", "+"), ("b", "um", "-"))
    ]
    lets = [{"name": "s", "formula": "hub - 10 + roller_1 - roller_2"}]
    found = faults(CLUTCH | {"requirement": requirements, "let": lets}, tmp_path)
    assert "let[0]: is used by requirement[0] and requirement[1], whose formulas count in different units" in found
    requirements[1]["unit"] = "mm"
    both = stack(CLUTCH | {"requirement": requirements, "let": lets, "objectives": {"minimise": ["cost"]},
                           "limits": {"a.variation": 0.2}}, tmp_path)  # fmt: skip
    assert [measured.mechanism.centre for measured in both.measured] == pytest.approx([146.89, -56.31])

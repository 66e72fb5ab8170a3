"""Formulas: values and slopes against Python and complex steps, and everything that is refused."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tolevo.models.expressions import DEEPEST, FUNCTIONS, Formula, FormulaError

POINT = {"a": 0.31, "b": 0.47, "c": 1.9}
SMOOTH = [
    "sin(a)", "cos(a*b)", "tan(a)", "asin(a*b)", "acos(a - b)", "atan(a/b)", "sqrt(a + c)",
    "exp(-a*c)", "log(c)", "a**2", "c**a", "a**-1.5", "-a**2", "2**-a", "a/b/c", "a - b - c",
    "(a + b)*(c - a)/(1 + a*b)", "pi*a**2/4", "max(a*c, b*c)", "min(a, b*c, c)", "+a*+b",
    "acos((a + (b + c)/2) / (3*c - (b + c)/2))", "1.5e-1*a + .5*b - 2.*c",
]  # fmt: skip


def python(text: str, **names: complex) -> Any:
    """The value by another route: numpy, on complex numbers as well."""
    known: dict[str, Any] = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "max": largest, "min": least}
    known |= {name: getattr(np, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "log")}
    return eval(text, {"__builtins__": {}}, known | {"pi": math.pi} | names)


def largest(*values: complex) -> complex:
    return max(values, key=lambda value: value.real)


def least(*values: complex) -> complex:
    return min(values, key=lambda value: value.real)


@pytest.mark.parametrize("text", SMOOTH)
def test_value_against_python(text: str) -> None:
    found = Formula(text).value({name: np.asarray(x) for name, x in POINT.items()})
    np.testing.assert_allclose(found, python(text, **POINT), rtol=1e-14)


@pytest.mark.parametrize("text", SMOOTH)
def test_slopes_against_complex_steps(text: str) -> None:
    formula = Formula(text)
    slopes = formula.gradient({name: np.asarray(x) for name, x in POINT.items()})
    assert set(slopes) == set(formula.names)
    for name in formula.names:
        moved = {key: complex(x, 1e-30 * (key == name)) for key, x in POINT.items()}
        step = complex(python(text, **moved)).imag / 1e-30
        np.testing.assert_allclose(slopes[name], step, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("text", ["abs(a - b)", "atan2(a, -c)", "atan2(-b, a)", "abs(c)"])
def test_slopes_against_central_differences(text: str) -> None:
    formula, step = Formula(text), 1e-6
    slopes = formula.gradient({name: np.asarray(x) for name, x in POINT.items()})
    for name in formula.names:
        ends = {k: np.array([x, x]) for k, x in POINT.items()}
        ends[name] += [-step, step]
        low, high = formula.value(ends)
        np.testing.assert_allclose(slopes[name], (high - low) / (2.0 * step), rtol=1e-8)


def test_batches_are_vectorised() -> None:
    formula = Formula("a*sin(b) + c")
    rng = np.random.default_rng(0)
    x = {"a": rng.random((4, 1)), "b": rng.random((4, 7)), "c": np.asarray(2.0)}
    np.testing.assert_allclose(formula.value(x), x["a"] * np.sin(x["b"]) + 2.0)
    assert {name: slope.shape for name, slope in formula.gradient(x).items()} == {"a": (4, 7), "b": (4, 7), "c": (4, 7)}


@given(st.recursive(
    st.sampled_from(["a", "b", "2", "0.5"]),
    lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda t: f"({''.join(t)})"),
    max_leaves=12,
))  # fmt: skip
def test_precedence_is_that_of_python(text: str) -> None:
    bare = text.replace("(", "").replace(")", "")
    for one in (text, bare):
        found = Formula(one).value({"a": np.asarray(1.3), "b": np.asarray(-0.7)})
        np.testing.assert_allclose(found, python(one, a=1.3, b=-0.7), rtol=1e-12, atol=1e-12)


def test_names_come_with_their_columns() -> None:
    assert Formula("sin(hub) + cage_1 - hub").names == {"hub": 5, "cage_1": 12}


def test_picklable() -> None:
    formula = Formula("a/(b + 1)")
    again = pickle.loads(pickle.dumps(formula))
    assert again == formula
    assert again.value({"a": np.asarray(3.0), "b": np.asarray(2.0)}) == 1.0


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("__import__('os')", 12, "text is not part"),
        ("__import__(os)", 1, "not a function"),
        ("eval(a)", 1, "not a function"),
        ("a.real", 2, "attributes"),
        ("lambda a: a", 9, "unexpected `:`"),
        ("a if b else c", 3, "an operator or the end"),
        ("[a for a in b]", 1, "indices"),
        ("a[0]", 2, "indices"),
        ("a^2", 2, "write a power as **"),
        ("a \u2212 2", 3, "write minus as -"),
        ("a\u00b72", 2, "write times as *"),
        ("a = 2", 3, "right-hand side"),
        ("a // 2", 4, "unexpected `/`"),
        ("sim(a)", 1, "did you mean `sin`"),
        ("sin", 1, "write sin(...)"),
        ("sin()", 5, "unexpected `)`"),
        ("atan2(a)", 1, "takes 2 arguments, got 1"),
        ("max(a)", 1, "2 to 16"),
        ("2mm", 2, "unexpected `mm`"),
        ("a b", 3, "unexpected `b`"),
        ("a,b", 2, "unexpected `,`"),
        ("", 1, "ends too early"),
        ("a +", 4, "ends too early"),
        ("(a + b", 1, "never closed"),
        ("a)", 2, "unexpected `)`"),
        ("1e999", 1, "too large"),
        ("ä + 1", 1, "unexpected `ä`"),
        ("a\x00", 2, "unexpected"),
    ],
)
def test_what_is_no_formula(text: str, column: int, words: str) -> None:
    with pytest.raises(FormulaError) as caught:
        Formula(text)
    assert caught.value.column == column
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "text",
    ["(" * 10_000 + "a" + ")" * 10_000, "(" * 500 + "a" + ")" * 500, "-" * 3000 + "a",
     "a" + "**a" * 900, "a" + "+a" * 1500, "sin(" * 400 + "a" + ")" * 400, "a" + "*(a" * 900,
     "a" + "+a" * 10_000],
)  # fmt: skip
def test_hostile_depth_is_refused(text: str) -> None:
    with pytest.raises(FormulaError):
        Formula(text)


def test_long_sums_and_nests_are_taken() -> None:
    names = [f"x{at}" for at in range(150)]
    formula = Formula(" + ".join(names))
    assert formula.value({name: np.asarray(1.0) for name in names}) == 150.0
    assert Formula("(" * 50 + "a" + ")" * 50).value({"a": np.asarray(2.0)}) == 2.0


@pytest.mark.parametrize(
    ("text", "low", "high", "words"),
    [
        ("1/a", -0.1, 0.3, "division by zero"),
        ("1/a", 0.0, 0.0, "division by zero"),
        ("acos(a)", 0.9, 1.02, "[-1, 1]"),
        ("asin(-a)", 0.9, 1.02, "[-1, 1]"),
        ("sqrt(a)", -0.1, 1.0, "at least 0"),
        ("log(a)", 0.0, 1.0, "above 0"),
        ("a**0.5", -1.0, 1.0, "fractional exponent"),
        ("a**-2", -1.0, 1.0, "division by zero"),
        ("tan(a)", 1.5, 1.7, "pole"),
        ("atan2(a, -1)", -0.1, 0.1, "jumps"),
        ("exp(a)", 0.0, 1000.0, "not finite"),
    ],
)
def test_trouble_within_a_range(text: str, low: float, high: float, words: str) -> None:
    """Even samples that miss the singular point show that it is between them."""
    assert words in Formula(text).trouble({"a": np.array([low, high])})


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [("1/a", 0.1, 0.3), ("a**3", -1.0, 1.0), ("a**-2", -2.0, -1.0), ("tan(a)", 1.6, 1.7),
     ("atan2(a, 1)", -0.1, 0.1), ("acos(a)", -1.0, 1.0), ("0*a", -1.0, 1.0),
     ("log(a)", 0.1, 2.0), ("sqrt(a)", 0.0, 2.0), ("a**0.5", 0.0, 2.0), ("1/a", -0.3, -0.1)],
)  # fmt: skip
def test_no_trouble(text: str, low: float, high: float) -> None:
    assert Formula(text).trouble({"a": np.array([low, high])}) == ""


def test_one_sample_on_the_cut_is_trouble_and_beside_it_none() -> None:
    formula = Formula("atan2(a, -1)")
    assert "jumps" in formula.trouble({"a": np.zeros(1)})
    assert formula.trouble({"a": np.array([1e-9])}) == ""


def test_trouble_names_one_value_or_a_span() -> None:
    formula = Formula("1/a")
    assert formula.trouble({"a": np.array([0.0, 0.0])}).endswith("the divisor is 0")
    assert formula.trouble({"a": np.array([-1.5, 2.0])}).endswith("the divisor is -1.5 to 2")


@pytest.mark.parametrize(
    ("text", "linear"),
    [("a", True), ("3", True), ("-a/4 + 2*b - pi", True), ("sqrt(2)*a", True), ("a*2**3", True),
     ("(a - b)/cos(1)", True), ("a*b", False), ("a/b", False), ("1/a", False), ("sin(a)", False),
     ("a**2", False), ("2**a", False), ("abs(a)", False)],
)  # fmt: skip
def test_linear_by_second_differences(text: str, linear: bool) -> None:
    """A linear formula has no second difference along any line, the others here have one."""
    formula, t = Formula(text), np.linspace(-1.0, 1.0, 9)
    values = formula.value({"a": 0.3 + t, "b": 1.7 - 0.4 * t}) + np.zeros(9)
    assert np.allclose(np.diff(values, n=2), 0.0, atol=1e-12) == linear
    assert formula.linear == linear


def test_a_sum_of_exactly_the_most_terms() -> None:
    """`DEEPEST` is the number of terms that a sum or a product may have."""
    for sign, value in (("+", 200.0), ("*", 1.0)):
        text = f" {sign} ".join(["a"] * DEEPEST)
        assert Formula(text).value({"a": np.asarray(1.0)}) == value
        with pytest.raises(FormulaError, match="in a row"):
            Formula(f"{text} {sign} a")


def test_every_function_is_tried_here() -> None:
    tried = " ".join([*SMOOTH, "abs(a) atan2(a, b)"])
    assert [name for name in FUNCTIONS if f"{name}(" not in tried] == []

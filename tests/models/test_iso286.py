"""ISO 286 grades and fits: values of the standard's table, and what is refused."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tolevo.models.iso286 import GRADES, UNVERIFIED, Fit, grade_um, zone


@pytest.mark.parametrize(
    ("grade", "size", "width"),
    [("IT7", 25.0, 21.0), ("IT6", 25.0, 13.0), ("IT7", 30.0, 21.0), ("IT7", 30.001, 25.0),
     ("IT8", 3.0, 14.0), ("IT1", 0.5, 0.8), ("IT12", 500.0, 630.0), ("IT5", 120.0, 15.0)],
)  # fmt: skip
def test_grades_of_iso_286_1(grade: str, size: float, width: float) -> None:
    assert grade_um(grade, size) == width


def test_widths_rise_with_grade_and_size() -> None:
    sizes = [1.0, 5.0, 8.0, 15.0, 25.0, 40.0, 70.0, 100.0, 150.0, 200.0, 300.0, 350.0, 450.0]
    table = [[grade_um(grade, size) for size in sizes] for grade in GRADES]
    assert all(a <= b for row in table for a, b in pairwise(row))
    assert all(a < b for low, high in pairwise(table)
               for a, b in zip(low, high, strict=True))  # fmt: skip


def test_grades_follow_the_formula_of_the_standard() -> None:
    """IT5 = 7 i, IT6 = 10 i, ... with i = 0.45 D^(1/3) + 0.001 D, up to the standard's rounding."""
    for size, low, high in ((25.0, 18.0, 30.0), (100.0, 80.0, 120.0), (450.0, 400.0, 500.0)):
        mean = (low * high) ** 0.5
        unit = 0.45 * mean ** (1.0 / 3.0) + 0.001 * mean
        for grade, factor in (("IT5", 7), ("IT6", 10), ("IT7", 16), ("IT8", 25), ("IT9", 40)):
            assert grade_um(grade, size) == pytest.approx(factor * unit, rel=0.04)


@pytest.mark.parametrize("size", [0.0, -1.0, 500.001, float("nan")])
def test_sizes_outside_the_table(size: float) -> None:
    with pytest.raises(ValueError, match="up to 500 mm"):
        grade_um("IT7", size)


def test_unknown_grade() -> None:
    with pytest.raises(ValueError, match="is not a grade"):
        grade_um("IT19", 25.0)
    assert "IT7" not in UNVERIFIED and {"IT01", "IT0", "IT13", "IT18"} <= UNVERIFIED


@pytest.mark.parametrize(
    ("text", "lower", "upper"),
    [("25 H7", 0.0, 0.021), ("25h6", -0.013, 0.0), ("JS7", -0.0105, 0.0105),
     ("25 js6", -0.0065, 0.0065)],
)  # fmt: skip
def test_zones_of_fits(text: str, lower: float, upper: float) -> None:
    found = zone(Fit.of_text(text), 25.0)
    assert (found.lower, found.upper) == pytest.approx((lower, upper))


@pytest.mark.parametrize(
    ("text", "words"),
    [("25 g6", "the letter g is not available"), ("25 P7", "letter P"), ("25 Js7", "letter Js"),
     ("H", "write a fit"), ("", "write a fit")],
)  # fmt: skip
def test_fits_that_are_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Fit.of_text(text)

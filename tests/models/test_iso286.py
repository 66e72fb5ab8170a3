"""ISO 286 grades and fits: values of the standard's table, and what is refused."""

from __future__ import annotations

import csv
from collections.abc import Callable
from itertools import pairwise
from math import degrees
from pathlib import Path

import pytest

from tolevo.models.iso286 import (
    GRADES,
    UNVERIFIED,
    Fit,
    angle_rad,
    geometrical_mm,
    grade_um,
    linear_mm,
    pair_of_text,
    zone,
)
from tolevo.models.iso286.fits import deviations_um

DATA = Path(__file__).parents[1] / "data" / "iso286"


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
    [("25 H7", 0.0, 21.0), ("25h6", -13.0, 0.0), ("25 JS7", -10.5, 10.5), ("25 js6", -6.5, 6.5),
     ("25g6", -20.0, -7.0), ("25k6", 2.0, 15.0), ("25f7", -41.0, -20.0), ("25P7", -35.0, -14.0),
     ("50n6", 17.0, 33.0), ("80s6", 59.0, 78.0), ("50K6", -13.0, 3.0), ("30N6", -24.0, -11.0),
     ("30U7", -61.0, -40.0), ("300M6", -41.0, -9.0), ("6G6", 4.0, 12.0), ("150f6", -68.0, -43.0),
     ("25N9", -52.0, 0.0), ("Ø25 J7", -9.0, 12.0)],
)  # fmt: skip
def test_tolerance_classes(text: str, lower: float, upper: float) -> None:
    """Limit deviations [um] of ISO 286-2, from tables of manufacturers."""
    fit = Fit.of_text(text)
    assert fit.size is not None
    found = zone(fit, fit.size)
    assert (1000.0 * found.lower, 1000.0 * found.upper) == pytest.approx((lower, upper))


ERRORS_OF_THE_SOURCE = {
    ("E7", "315", "355"): (125.0, 182.0),  # E has 125 there as e has, and IT7 is 57
    ("E7", "355", "400"): (125.0, 182.0),
    ("K6", "6", "10"): (-7.0, 2.0),  # -1 + Delta, with Delta = IT6 - IT5 = 3
    ("f6", "120", "140"): (-68.0, -43.0),  # f has -43 and IT6 is 25
    ("f6", "140", "160"): (-68.0, -43.0),
    ("f6", "160", "180"): (-68.0, -43.0),
}
"""Where the second source is wrong, and limit deviations [um] by the rules of ISO 286-1."""


def test_limit_deviations_of_a_second_source() -> None:
    """1480 classes and ranges of sizes of an independent table (isofits, MIT licence)."""
    with (DATA / "limit_deviations_um.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 1400
    differing = {}
    for row in rows:
        fit = Fit.of_text(row["class"])
        found = deviations_um(fit.letter, fit.grade, float(row["up_to_mm"]))
        if found != pytest.approx((float(row["lower_um"]), float(row["upper_um"]))):
            differing[row["class"], row["over_mm"], row["up_to_mm"]] = found
    assert differing == ERRORS_OF_THE_SOURCE


def test_holes_fit_as_tightly_as_shafts() -> None:
    """Clause 4.3.2.2 of ISO 286-1: a hole of grade n with a shaft of grade n - 1 of the letter h
    fits as the hole H of that grade with the shaft of the same letter (25 H7/p6 as 25 P7/h6).
    """
    for letter in ("P", "R", "S", "T", "U", "X"):
        for size in (28.0, 60.0, 110.0, 300.0, 480.0):
            hole, shaft = zone(Fit("H", "IT7"), size), zone(Fit(letter.lower(), "IT6"), size)
            turned, basic = zone(Fit(letter, "IT7"), size), zone(Fit("h", "IT6"), size)
            assert turned.upper - basic.lower == pytest.approx(hole.upper - shaft.lower)
            assert turned.lower - basic.upper == pytest.approx(hole.lower - shaft.upper)


@pytest.mark.parametrize(
    ("text", "words"),
    [("25 Js7", "mixes the cases: JS is a hole, js a shaft"), ("25 w6", '"w" is not a letter'),
     ("H", "write a fit"), ("", "write a fit"), ("25 H7/g6", r"of two parts: \[\[fit\]\]")],
)  # fmt: skip
def test_classes_that_are_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Fit.of_text(text)


@pytest.mark.parametrize(
    ("text", "size", "words"),
    [("K9", 25.0, "letter K up to IT8 only"), ("J9", 25.0, "J for IT6, IT7 and IT8 only"),
     ("a9", 0.8, "not used up to 1 mm"), ("t6", 10.0, "no fundamental deviation t"),
     ("cd6", 25.0, "no fundamental deviation cd"), ("H7", 600.0, "up to 500 mm"),
     ("H19", 25.0, "is not a grade")],
)  # fmt: skip
def test_classes_that_the_standard_does_not_have(text: str, size: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        zone(Fit.of_text(text), size)


def test_fits_of_two_parts() -> None:
    assert pair_of_text("25 H7/g6") == (Fit("H", "IT7", 25.0), Fit("g", "IT6", 25.0))
    assert [str(one) for one in pair_of_text("H8/f7")] == ["H8", "f7"]
    for text, words in (("25 g6/H7", "hole first, in capitals"), ("25 H7", "of two parts")):
        with pytest.raises(ValueError, match=words):
            pair_of_text(text)


def test_general_tolerances_of_iso_2768() -> None:
    """Tables 1 to 3 of part 1 and 1 to 4 of part 2."""
    assert linear_mm("m", 25.0) == 0.2
    assert (linear_mm("f", 6.0), linear_mm("c", 6.001), linear_mm("v", 4000.0)) == (0.05, 0.5, 8.0)
    assert (linear_mm("m", 10.0, radius=True), linear_mm("c", 3.0, radius=True)) == (1.0, 0.4)
    assert degrees(angle_rad("m", 50.0)) == pytest.approx(0.5)
    assert degrees(angle_rad("v", 500.0)) == pytest.approx(20.0 / 60.0)
    assert geometrical_mm("flatness", "H", 100.0) == 0.1
    assert geometrical_mm("perpendicularity", "K", 101.0) == 0.6
    assert geometrical_mm("symmetry", "L", 100.0) == 0.6
    assert geometrical_mm("circular_runout", "K", 800.0) == 0.2
    refused: list[tuple[Callable[[], float], str]] = [
        (lambda: linear_mm("f", 2500.0), "no tolerance of class f"),
        (lambda: linear_mm("m", 0.4), "no tolerance"),
        (lambda: linear_mm("x", 10.0), "must be one of f, m, c, v"),
        (lambda: geometrical_mm("position", "H", 10.0), "only, got position"),
        (lambda: angle_rad("m", 0.0), "above 0 mm"),
    ]
    for call, words in refused:
        with pytest.raises(ValueError, match=words):
            call()

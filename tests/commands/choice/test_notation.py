"""Tolerances as drawings state them."""

from __future__ import annotations

import pytest

from tolevo.commands.run.tolerances import allocation, inspection, notation
from tolevo.files import csv_text
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_reducer import RvReducer
from tolevo.section import Kind, Variable
from tolevo.units import drawing_number


@pytest.mark.parametrize(
    ("kind", "nominal", "mid", "t", "grade", "text"),
    [
        (Kind.HALF_WIDTH, 36.05, -0.0005, 0.0125, "", "36.05 +0.012/-0.013 mm"),
        (Kind.HALF_WIDTH, 25.0, 0.0, 0.0065, "IT6", "25 ±0.0065 mm (IT6)"),
        (Kind.HALF_WIDTH, 25.0, 0.0105, 0.0105, "H7", "25 +0.021/0 mm (H7)"),
        (Kind.HALF_WIDTH, None, 0.0, 0.1 + 0.2, "", "±0.3 mm"),
        (Kind.FULL_CLEARANCE, None, 0.0, 5.0, "", "0 to 5 mm"),
        (Kind.STANDARD_DEVIATION, None, 0.0, 2.0, "", "standard deviation at most 2 mm"),
        (Kind.GRADE, None, 0.0, 5.0, "grade 5", "grade 5"),
        (Kind.NOMINAL, None, 0.0, -0.04, "", "\N{MINUS SIGN}0.04 mm"),
        (Kind.HALF_WIDTH, None, -1.0, 2.0, "", "\N{MINUS SIGN}3 to 1 mm"),
    ],
)
def test_notation(kind: Kind, nominal: float | None, mid: float, t: float, grade: str, text: str) -> None:
    variable = Variable("a_t", "mm", kind, 0.0, 1.0, "a part")
    assert notation(variable, nominal, mid, t, grade) == text


@pytest.mark.parametrize(
    ("unit", "kind", "nominal", "t", "shape", "text"),
    [
        ("mm", Kind.HALF_WIDTH, 25.0, 0.0065, "diameter", "⌀25 ±0.0065 mm"),
        ("mm", Kind.HALF_WIDTH, 12.5, 0.0065, "radius", "R12.5 ±0.0065 mm (⌀25 ±0.013 mm)"),
        ("mrad", Kind.HALF_WIDTH, None, 0.5, "", "±0.5 mrad (±103.1″)"),  # 0.5e-3 * 180 * 3600 / pi
        ("arcmin", Kind.NOMINAL, None, -0.5, "", "\N{MINUS SIGN}0.5 arcmin (\N{MINUS SIGN}30″)"),
        ("deg", Kind.HALF_WIDTH, 60.0, 0.5, "", "60 ±0.5 deg"),
        ("mrad", Kind.HALF_WIDTH, None, 0.5, "at 2.5 cm", "±0.5 mrad (±103.1″, ±12.5 um at R25 mm)"),
        ("deg", Kind.HALF_WIDTH, 30.0, 0.18, "at 25 mm", "30 ±0.18 deg (±78.54 um at R25 mm)"),
    ],
)
def test_diameters_and_angles(unit: str, kind: Kind, nominal: float | None, t: float, shape: str, text: str) -> None:
    assert notation(Variable("a_t", unit, kind, 0.0, 1.0, "a part"), nominal, 0.0, t, "", shape) == text


def test_the_phase_of_a_journal_is_a_place_at_the_radius_of_the_eccentricity() -> None:
    """2/1.3 mrad at 1.3 mm are the 2 um that a journal has."""
    problem = RvReducer()
    variable = next(v for v in problem.variables if v.name == "crank_phase_mrad")
    shape = problem.drawn("crank_phase_mrad")["drawn_as"]
    assert notation(variable, None, 0.0, 2.0 / 1.3, "", shape).endswith("±2 um at R1.3 mm)")


def test_a_radius_of_the_reducer_is_written_with_its_diameter_in_one_unit() -> None:
    """Pins of 3 mm radius with a zone of -1 +- 2 um: 6 +0.002/-0.006 mm in diameter."""
    problem = RvBacklash()
    rows = allocation(problem, {0: "only"}, {0: (problem.complete(problem.xl[None])[0],) * 2}, {}, {})
    rows = rows.set_index("variable")
    notations = dict(rows["notation"])
    assert rows["nominal"]["pin_radius_um"] == 3000.0
    t, mid = rows["rounded"]["pin_radius_um"], rows["mid"]["pin_radius_um"]
    ends = [f"{1e-3 * (mid + side * t) * times:+g}" for times in (1, 2) for side in (1, -1)]
    assert notations["pin_radius_um"] == f"R3 {ends[0]}/{ends[1]} mm (⌀6 {ends[2]}/{ends[3]} mm)"
    assert notations["eccentricity_um"].startswith("1.3 ±")
    assert notations["pin_hole_radius_um"].startswith("R3 +")
    assert csv_text(rows).count(",'") == 0  # no cell would begin like a formula


def test_sums_lose_their_last_digits() -> None:
    assert drawing_number(36.050000000000004) == "36.05"


def test_an_inspector_reads_what_the_model_counts_on() -> None:
    """Cp = t / (3 sigma)."""
    variable = Variable("a_t", "mm", Kind.HALF_WIDTH, 0.0, 1.0, "a part")
    assert "at most 0.002 mm" in inspection(variable, 0.012, 2.0)
    assert "ISO 14253-1" in inspection(variable, 0.012, None)

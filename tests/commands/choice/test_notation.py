"""Tolerances as drawings state them."""

from __future__ import annotations

import pytest

from tolevo.commands.run.tolerances import inspection, notation
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
        (Kind.NOMINAL, None, 0.0, -0.04, "", "-0.04 mm"),
    ],
)
def test_notation(kind: Kind, nominal: float | None, mid: float, t: float, grade: str, text: str) -> None:
    variable = Variable("a_t", "mm", kind, 0.0, 1.0, "a part")
    assert notation(variable, nominal, mid, t, grade) == text


def test_sums_lose_their_last_digits() -> None:
    assert drawing_number(36.050000000000004) == "36.05"


def test_an_inspector_reads_what_the_model_counts_on() -> None:
    """Cp = t / (3 sigma)."""
    variable = Variable("a_t", "mm", Kind.HALF_WIDTH, 0.0, 1.0, "a part")
    assert "at most 0.002 mm" in inspection(variable, 0.012, 2.0)
    assert "ISO 14253-1" in inspection(variable, 0.012, None)

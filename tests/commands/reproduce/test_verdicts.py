"""Verdicts from printed and computed values; every expectation is worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from tolevo.commands.reproduce.claims import Claim, ClaimTask, Interpretation, Word, check, outcome, verdict
from tolevo.commands.reproduce.recipes import Constant, Quantity
from tolevo.errors import ModelError

PLAIN = Claim("a", "page 1", "length", "mm", (2.0,), tolerance=0.05)


def judged(claim: Claim, *values: float, states: tuple[str, ...] = ("", "half", "third")) -> str:
    """The verdict where readings compute these values."""
    outcomes = [
        outcome(claim, Interpretation(Constant(value, "mm"), said), [Quantity(value, "mm")])
        for value, said in zip(values, states, strict=False)
    ]
    return verdict(claim, outcomes).word


@pytest.mark.parametrize(
    ("relation", "printed", "value", "holds"),
    [
        ("equal", (2.0,), 2.05, True),
        ("equal", (2.0,), 1.95, True),
        ("equal", (2.0,), 2.0501, False),
        ("at_least", (2.0,), 1.95, True),
        ("at_least", (2.0,), 1.94, False),
        ("at_least", (2.0,), 9.0, True),
        ("at_most", (2.0,), 2.05, True),
        ("at_most", (2.0,), 2.06, False),
        ("at_most", (2.0,), -9.0, True),
        ("above", (2.0,), 2.001, True),
        ("above", (2.0,), 2.0, False),
        ("below", (2.0,), 1.999, True),
        ("below", (2.0,), 2.0, False),
        ("within", (1.0, 2.0), 1.5, True),
        ("within", (1.0, 2.0), 2.05, True),
        ("within", (1.0, 2.0), 0.94, False),
    ],
)
def test_relations(relation: str, printed: tuple[float, ...], value: float, holds: bool) -> None:
    claim = replace(PLAIN, relation=relation, printed=printed)
    if relation in ("above", "below"):
        claim = replace(claim, tolerance=0.0)
    assert judged(claim, value) == (Word.REPRODUCED if holds else Word.NOT_REPRODUCED)


def test_rounding_of_the_last_binary_digit_is_no_deviation() -> None:
    claim = replace(PLAIN, printed=(0.3,), tolerance=0.0)
    assert judged(claim, 0.1 + 0.2) == Word.REPRODUCED


def test_first_reading_that_holds_decides() -> None:
    assert judged(PLAIN, 2.0, 7.0) == Word.REPRODUCED
    assert judged(PLAIN, 7.0, 2.0) == Word.UNDER_READING
    assert judged(PLAIN, 7.0, 8.0) == Word.NOT_REPRODUCED
    assert judged(PLAIN, 2.0, states=("stated",)) == Word.UNDER_READING


def test_reason_names_the_facts() -> None:
    claim = replace(PLAIN, why="a wrong bracket")
    outcomes = [
        outcome(claim, Interpretation(Constant(1.0, "mm"), said), [Quantity(value, "mm")])
        for value, said in ((4.0, ""), (2.01, "it is halved"))
    ]
    found = verdict(claim, outcomes)
    assert found.outcome is not None
    assert found.outcome.states == "it is halved"
    assert found.reason == (
        "with the reading that it is halved, 2.01 mm differs from 2 mm by 0.01 mm, within the "
        "tolerance of 0.05 mm; read literally it does not hold: 4 mm differs from 2 mm by 2 mm, "
        "beyond the tolerance of 0.05 mm; a wrong bracket"
    )


def test_all_values_of_a_pair_have_to_hold() -> None:
    claim = replace(PLAIN, printed=(2.0, 3.0))
    recipe = Constant(0.0, "mm")
    for values, holds in (((2.0, 3.0), True), ((2.0, 3.2), False)):
        found = outcome(claim, Interpretation(recipe), [Quantity(one, "mm") for one in values])
        assert found.holds is holds
        np.testing.assert_allclose(found.deviation, np.subtract(values, (2.0, 3.0)))


@pytest.mark.parametrize(("error", "told"), [(0.0, False), (0.02, False), (0.04, True)])
def test_chance_is_told_where_it_may_turn_the_verdict(error: float, told: bool) -> None:
    """2.11 misses 2.05 by 0.06: three standard errors of 0.02, less than two of 0.04."""
    found = outcome(PLAIN, Interpretation(Constant(0.0, "mm")), [Quantity(2.11, "mm", error)])
    assert ("another draw" in verdict(PLAIN, [found]).reason) is told


@pytest.mark.parametrize(("error", "word"), [(0.04, Word.REPRODUCED), (0.06, Word.NOT_REPRODUCED)])
def test_above_is_above_by_more_than_chance(error: float, word: Word) -> None:
    """2.1 is above 2 by 0.1: more than two standard errors of 0.04, less than two of 0.06."""
    claim = replace(PLAIN, printed=(2.0,), relation="above", tolerance=0.0)
    found = outcome(claim, Interpretation(Constant(0.0, "mm")), [Quantity(2.1, "mm", error)])
    reached = verdict(claim, [found])
    assert reached.word == word
    assert ("less than two standard errors (0.06 mm)" in reached.reason) is not found.holds


def test_lost_data_cannot_be_checked() -> None:
    claim = replace(PLAIN, lost="the table is cut off", why="a copy")
    found = check(ClaimTask("k", 0, 0, claim, 0)).verdict
    assert (found.word, found.outcome) == (Word.CANNOT_BE_CHECKED, None)
    assert found.reason == "the table is cut off; nothing can be recomputed; a copy"


def test_values_are_brought_to_the_unit_of_the_claim() -> None:
    claim = replace(PLAIN, interpretations=(Interpretation(Constant(2000.0, "um")),))
    found = check(ClaimTask("k", 0, 0, claim, 0)).verdict
    assert found.word == Word.REPRODUCED
    assert found.outcome is not None
    np.testing.assert_allclose(found.outcome.computed, 2.0)


def test_a_value_that_is_not_finite_is_an_error_that_names_the_claim() -> None:
    claim = replace(PLAIN, interpretations=(Interpretation(Constant(float("nan"), "mm")),))
    with pytest.raises(ModelError, match="claim a, printed numbers: the value is nan"):
        check(ClaimTask("k", 0, 0, claim, 0))

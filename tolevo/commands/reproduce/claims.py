"""Claims as records: what a document prints, and how it is recomputed."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite, nan

import numpy as np

from ...errors import InputError, ModelError
from ...execution import pinned
from ...records import CommandOutcome
from ...units import converted
from .recipes import Quantity, Recipe
from .records import ClaimsResult, ComputedTable, Document

RELATIONS = ("equal", "at_least", "at_most", "above", "below", "within")
"""How a computed value stands to the printed one where the claim holds; `within` [low, high]."""


@dataclass(frozen=True, slots=True)
class Interpretation:
    """A recipe for a claim; `states` is how it interprets the document (empty: literally)."""

    recipe: Recipe
    states: str = ""


@dataclass(frozen=True, slots=True)
class Claim:
    """A printed figure or statement.

    `printed` holds one number, as many as the interpretations compute, or the two ends of a range.
    Where data are lost, `lost` names them and there are no interpretations. `why` adds what the
    record knows of the cause. All values are in `unit`.
    """

    id: str
    place: str
    quantity: str
    unit: str
    printed: tuple[float, ...] = ()
    printed_as: str = ""
    """As the document writes it."""
    relation: str = "equal"
    tolerance: float = 0.0
    tolerance_reason: str = ""
    ambiguous: str = ""
    lost: str = ""
    why: str = ""
    interpretations: tuple[Interpretation, ...] = ()


@dataclass(frozen=True, slots=True)
class ClaimsFile:
    """The claims of one document; `seed` seeds all that is drawn for them."""

    document: Document
    seed: int
    claims: tuple[Claim, ...]


# What `reproduce` needs and what it returns.


@dataclass(frozen=True, slots=True)
class Source:
    """A claims file that has been read; `tables` is all its content, as JSON."""

    file: ClaimsFile
    tables: str


@dataclass(frozen=True, slots=True)
class ReproducePlan:
    """The claims of one or more documents."""

    sources: tuple[Source, ...]

    @property
    def total(self) -> int:
        """Number of claims."""
        return sum(len(source.file.claims) for source in self.sources)


ReproduceOutcome = CommandOutcome[ClaimsResult | None]


@dataclass(frozen=True, slots=True)
class ClaimsProgress:
    """State of the work: claims done of all, the time since it began [s], those done `before`."""

    done: int
    total: int
    seconds: float
    note: str = ""
    before: int = 0

    @property
    def remaining(self) -> float | None:
        """Remaining time [s] if all claims take as long as those so far; None before the first."""
        checked_now = self.done - self.before
        return self.seconds * (self.total - self.done) / checked_now if checked_now else None


# Verdicts: computed from printed and recomputed values, never stated in a record.


ROUNDING = 1e-9
"""Relative slack of a comparison: the rounding of the last binary digits."""
DOUBT = 2.0
"""Standard errors by which a sampled value has to clear its tolerance."""


class Word(StrEnum):
    """The four verdicts."""

    REPRODUCED = "reproduced"
    UNDER_READING = "reproduced under the stated reading"
    NOT_REPRODUCED = "not reproduced"
    CANNOT_BE_CHECKED = "cannot be checked"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The values by one interpretation, in the unit of its claim; `by` names the computation."""

    states: str
    by: str
    computed: tuple[float, ...]
    standard_error: tuple[float, ...]
    deviation: tuple[float, ...]
    holds: bool


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on a claim, its reason in a sentence, and the values by every interpretation.

    `shown` is the number of the outcome that stands for the claim, -1 where nothing is computed.
    """

    word: Word
    reason: str
    outcomes: tuple[Outcome, ...] = ()
    shown: int = -1

    @property
    def outcome(self) -> Outcome | None:
        """The interpretation that holds, else the first."""
        return self.outcomes[self.shown] if self.shown >= 0 else None


def outcome(claim: Claim, interpretation: Interpretation, quantities: Sequence[Quantity]) -> Outcome:
    """The values by an interpretation; `quantities` are in the unit of the claim."""
    computed = tuple(quantity.value for quantity in quantities)
    deviation = _deviations(claim, computed)
    return Outcome(
        interpretation.states,
        interpretation.recipe.by,
        computed,
        tuple(quantity.standard_error for quantity in quantities),
        deviation,
        all(
            _excess(claim, value, difference) <= 0.0 and _is_beyond_chance(claim, difference, quantity.standard_error)
            for value, difference, quantity in zip(computed, deviation, quantities, strict=True)
        ),
    )


def verdict(claim: Claim, outcomes: Sequence[Outcome]) -> Verdict:
    """The verdict: the first interpretation that holds decides; the literal one states nothing."""
    if not outcomes:
        parts = [claim.lost, "nothing can be recomputed", *filter(None, [claim.why])]
        return Verdict(Word.CANNOT_BE_CHECKED, "; ".join(parts))
    shown = next((at for at, computed in enumerate(outcomes) if computed.holds), None)
    if shown is None:
        word, shown = Word.NOT_REPRODUCED, 0
    else:
        word = Word.UNDER_READING if outcomes[shown].states else Word.REPRODUCED
    stated = f"with the reading that {outcomes[shown].states}, " if outcomes[shown].states else ""
    parts = [stated + _comparison(claim, outcomes[shown])]
    if word is Word.UNDER_READING and not outcomes[0].states:
        parts.append(f"read literally it does not hold: {_comparison(claim, outcomes[0])}")
    if word is Word.NOT_REPRODUCED and len(outcomes) > 1:
        count = len(outcomes) - 1
        parts.append(f"nor does it hold under {count} other reading{'s' if count > 1 else ''}")
    if any(_is_decided_by_chance(claim, outcomes[shown])):
        parts.append("another draw may change the verdict: the value lies within two standard errors of the limit")
    if claim.why:
        parts.append(claim.why)
    return Verdict(word, "; ".join(parts), tuple(outcomes), shown)


def _deviations(claim: Claim, computed: Sequence[float]) -> tuple[float, ...]:
    """Computed less printed; of a range the distance to its nearer end, 0 inside."""
    if claim.relation == "within":
        low, high = claim.printed
        return tuple(min(value - low, 0.0) + max(value - high, 0.0) for value in computed)
    return tuple(
        0.0 if abs(value - printed) <= ROUNDING * abs(printed) else value - printed
        for value, printed in zip(computed, claim.printed, strict=True)
    )


def _excess(claim: Claim, value: float, difference: float) -> float:
    """By how much a value misses its relation, tolerance included; at most 0 where it holds."""
    slack = claim.tolerance + ROUNDING * max(abs(value), abs(value - difference))
    match claim.relation:
        case "at_least":
            return -difference - slack
        case "at_most":
            return difference - slack
        case "above":
            return -difference if difference != 0.0 else nan
        case "below":
            return difference if difference != 0.0 else nan
        case _:
            return abs(difference) - slack


def _is_beyond_chance(claim: Claim, difference: float, error: float) -> bool:
    """Whether a sampled value is above or below by more than chance; other relations do not ask."""
    return claim.relation not in ("above", "below") or abs(difference) >= DOUBT * error


def _is_decided_by_chance(claim: Claim, result: Outcome) -> list[bool]:
    """Whether each value lies so near to its limit that chance decides."""
    return [
        error > 0.0 and abs(_excess(claim, value, difference)) < DOUBT * error
        for value, difference, error in zip(result.computed, result.deviation, result.standard_error, strict=True)
    ]


def _comparison(claim: Claim, result: Outcome) -> str:
    """The facts in words."""
    computed = with_unit(result.computed, claim.unit)
    if claim.relation == "within":
        ends = f"{claim.printed[0]:.4g} to {with_unit(claim.printed[1:], claim.unit)}"
        place = "lies within" if result.holds else "lies outside of"
        return f"{computed} {place} {ends}"
    printed = with_unit(claim.printed, claim.unit)
    if claim.printed_as:
        printed += f' ("{claim.printed_as}")'
    difference = with_unit(result.deviation, claim.unit)
    if claim.relation == "equal":
        if not any(result.deviation):
            return f"{computed} equals {printed}"
        near = "within" if result.holds else "beyond"
        limit = with_unit((claim.tolerance,), claim.unit)
        return f"{computed} differs from {printed} by {difference}, {near} the tolerance of {limit}"
    words = claim.relation.replace("_", " ")
    if not result.holds and all(
        _excess(claim, value, deviation) <= 0.0
        for value, deviation in zip(result.computed, result.deviation, strict=True)
    ):
        errors = with_unit(result.standard_error, claim.unit)
        return f"{computed} is {words} {printed} by {difference}, which is less than two standard errors ({errors})"
    return f"{computed} is {'' if result.holds else 'not '}{words} {printed} (by {difference})"


def with_unit(values: Sequence[float], unit: str) -> str:
    """Numbers with their unit, in brackets where there are several."""
    text = ", ".join(f"{value:.4g}" for value in values)
    text = f"({text})" if len(values) > 1 else text
    return text if unit == "1" else f"{text} {unit}"


# Claims as tasks: pure functions of their inputs, which run in any process.


@dataclass(frozen=True, slots=True)
class ClaimTask:
    """One claim of the document that is number `document`; `key` names all that it depends on."""

    key: str
    document: int
    number: int
    claim: Claim
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """A claim that has been checked, with the tables of its calculations."""

    verdict: Verdict
    tables: Mapping[str, ComputedTable]


def check(task: ClaimTask) -> Checked:
    """Recompute a claim by all of its interpretations, on one thread.

    Of tables of one name that of the interpretation that decides is kept.

    Raises ModelError, with the claim named, where an interpretation has no finite value.
    """
    with pinned():
        results = [_recompute(task, interpretation) for interpretation in task.claim.interpretations]
    decided = verdict(task.claim, [computed for computed, _ in results])
    tables: dict[str, ComputedTable] = {}
    for _, more in results:
        tables = more | tables
    return Checked(decided, tables | results[decided.shown][1] if results else tables)


def generator(seed: int, name: str) -> np.random.Generator:
    """The generator of a claim: it depends on the seed of its file and its id alone."""
    words = np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(map(int, words))))


def _recompute(task: ClaimTask, interpretation: Interpretation) -> tuple[Outcome, dict[str, ComputedTable]]:
    claim = task.claim
    try:
        computed = interpretation.recipe.recomputed(generator(task.seed, claim.id))
        quantities = [_convert_quantity(quantity, claim.unit) for quantity in computed.quantities]
    except (ArithmeticError, ModelError, ValueError) as error:
        raise ModelError(f"claim {claim.id}, {interpretation.recipe.by}: {error}") from error
    except InputError as error:
        raise InputError(
            [type(fault)(f"claim {claim.id}: {fault.place}", fault.message) for fault in error.faults]
        ) from error
    return outcome(claim, interpretation, quantities), dict(computed.tables)


def _convert_quantity(quantity: Quantity, unit: str) -> Quantity:
    """A quantity in the unit of its claim. Raises ValueError where it cannot be, or not finite."""
    source, target = ("" if text == "1" else text for text in (quantity.unit, unit))
    value = float(converted(quantity.value, source, target))
    if not isfinite(value):
        raise ValueError(f"the value is {value}")
    error = converted(quantity.standard_error, source, target) - converted(0.0, source, target)
    return Quantity(value, unit, abs(float(error)))

"""Claims as tasks: pure functions of their inputs, which run in any process."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

import numpy as np

from ...claim_records import ComputedTable
from ...errors import InputError, ModelError
from ...units import converted
from ..execution import pinned
from .calculation import Quantity
from .claims import Claim, Interpretation
from .verdict import Outcome, Verdict, outcome, verdict


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
        results = [_recomputed(task, interpretation) for interpretation in task.claim.interpretations]
    decided = verdict(task.claim, [computed for computed, _ in results])
    tables: dict[str, ComputedTable] = {}
    for _, more in results:
        tables = more | tables
    return Checked(decided, tables | results[decided.shown][1] if results else tables)


def generator(seed: int, name: str) -> np.random.Generator:
    """The generator of a claim: it depends on the seed of its file and its id alone."""
    words = np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(map(int, words))))


def _recomputed(task: ClaimTask, interpretation: Interpretation) -> tuple[Outcome, dict[str, ComputedTable]]:
    claim = task.claim
    try:
        computed = interpretation.recipe.recomputed(generator(task.seed, claim.id))
        quantities = [_in_unit(quantity, claim.unit) for quantity in computed.quantities]
    except (ArithmeticError, ModelError, ValueError) as error:
        raise ModelError(f"claim {claim.id}, {interpretation.recipe.by}: {error}") from error
    except InputError as error:
        raise InputError(
            [type(fault)(f"claim {claim.id}: {fault.place}", fault.message) for fault in error.faults]
        ) from error
    return outcome(claim, interpretation, quantities), dict(computed.tables)


def _in_unit(quantity: Quantity, unit: str) -> Quantity:
    """A quantity in the unit of its claim. Raises ValueError where it cannot be, or not finite."""
    source, target = ("" if text == "1" else text for text in (quantity.unit, unit))
    value = float(converted(quantity.value, source, target))
    if not isfinite(value):
        raise ValueError(f"the value is {value}")
    error = converted(quantity.standard_error, source, target) - converted(0.0, source, target)
    return Quantity(value, unit, abs(float(error)))

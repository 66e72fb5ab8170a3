"""The assumptions of `rv_reducer` that no document settles, changed one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ...declarations import Value
from ..interfaces import Variant
from ..settings import Bound, VariableSetting
from .declared import DISC_TO_DISC

if TYPE_CHECKING:
    from .problem import RvReducer

FEW = {"report_units": 64}
"""Fresh units of a problem that is searched and not reported."""
SHARES = {
    "share_pins": ("share of the variance of pins and holes common to a unit", (0.0, 0.5, 1.0)),
    "share_discs": ("share of the variance of the discs common to a unit", (0.0, 0.5, 1.0)),
    "planet_share": ("share of the variance of the planets' clearances common to a unit", (0.0, 1.0)),
}
COUNTED = ("turn_mean", "share_of_turn", "overlap")
"""Definitions of interference that rigid units show."""


def variants(problem: RvReducer) -> tuple[Variant, ...]:
    """The problem as it is, then with one assumption changed at a time."""
    same = Variant("as it is", "", _with(problem))
    return (same, *_fractions(problem), *_interference(problem), *_disc_to_disc(problem))


def _with(problem: RvReducer, **parameters: Value) -> RvReducer:
    given = problem.given
    return type(problem)(replace(given, parameters={**given.parameters, **FEW, **parameters}))


def _fractions(problem: RvReducer) -> Iterator[Variant]:
    parameters = problem.settings.parameters
    for name, (words, values) in SHARES.items():
        for value in values:
            if name in parameters and parameters[name] != value:
                yield Variant(words, f"{value:g}", _with(problem, **{name: value}))


def _interference(problem: RvReducer) -> Iterator[Variant]:
    """Other definitions, with the same limit on their probability."""
    parameters = problem.settings.parameters
    bound = problem.settings.limits.get("interference_probability", Bound())
    if not bound.high < 1.0:
        return
    for kind in COUNTED:
        if kind != parameters["interference"]:
            more = f", beyond {parameters['overlap_arcmin']:g} arcmin" if kind == "overlap" else ""
            words = f"{kind.replace('_', ' ')}{more}, in at most {100.0 * bound.high:g} %"
            yield Variant("what counts as interference", words, _with(problem, interference=kind))


def _disc_to_disc(problem: RvReducer) -> Iterator[Variant]:
    """Without the errors between discs, where they are fixed at other values."""
    fixed = [name for name in DISC_TO_DISC if problem.fixed.get(name, 0.0) > 0.0]
    if len(fixed) < len(DISC_TO_DISC):
        return
    few = _with(problem).given
    nil = {name: VariableSetting(value=0.0) for name in fixed}
    changed = type(problem)(replace(few, variables={**few.variables, **nil}))
    yield Variant("errors between discs (pin circle, bores, journals)", "0", changed)

"""The registered rules of choice, and what they choose from a front."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...errors import InputError
from ...registry import PLUGIN_FAULTS, Kinds, origin
from .rule import ChoiceRule, Points

RULES: Kinds[ChoiceRule] = Kinds("rules")
"""The rules by name: entry points of `tolevo.rules`."""
ONLY = "only"
"""Name of the choice where there is but one objective."""
FIRST = (
    "knee",
    "knee_plane",
    "knee_bend",
    "knee_tradeoff",
    "nash",
    "pseudo_weights",
    "topsis",
    "cheapest_within_limits",
    "best_for_budget",
)
"""The order of the rules of tolevo; those of plugins follow in the order of the alphabet."""


def meaning_of(name: str) -> str:
    """What a rule chooses, in a few words."""
    return "the one point of the front" if name == ONLY else RULES[name].meaning


def chosen(points: Points, notes: list[str] | None = None) -> dict[str, int]:
    """The row that each rule chooses; rules that do not apply, or choose none, are left out.

    A rule that fails is left out as well, with its name and its reason in `notes`.
    """
    values = points.objectives
    if not len(values):
        return {}
    if values.shape[1] == 1:
        return {ONLY: int(np.argmin(values[:, 0]))}
    rows: dict[str, int] = {}
    for name in _names():
        try:
            at = RULES[name]().row(points)
            if at is not None and not 0 <= (at := int(at)) < len(values):
                raise ValueError(f"chose row {at} of a front of {len(values)} points")
        except (InputError, *PLUGIN_FAULTS) as error:
            if notes is not None:
                notes.append(f'the choice rule "{name}" of {origin("rules", name)} is left out: {_reason(error)}')
            continue
        if at is not None:
            rows[name] = at
    return rows


def _names() -> Iterator[str]:
    """The rules of tolevo in their order, then those of plugins."""
    yield from (name for name in FIRST if name in RULES)
    yield from (name for name in RULES if name not in FIRST)


def _reason(error: Exception | SystemExit) -> str:
    if isinstance(error, InputError):
        return "; ".join(fault.message for fault in error.faults)
    return f"{type(error).__name__}: {error}"

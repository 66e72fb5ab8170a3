"""Units and positions that are too many together."""

from __future__ import annotations

from collections.abc import Callable

from ...counts import too_many
from ...errors import Fault
from .declared import READINGS


def size_faults(count: Callable[[str], int], kept: int) -> list[Fault]:
    """A fault of every number of units whose readings would not be held.

    `count` gives a parameter by name, `kept` the evaluations that a search keeps.
    """
    positions = count("positions")
    searched = count("search_positions") or positions
    per = {"search_units": (kept + 1) * searched, "report_units": positions, "elastic_units": count("te_positions")}
    messages = {name: too_many(count(name), READINGS, number, "units x positions") for name, number in per.items()}
    return [Fault(f"parameters.{name}", text) for name, text in messages.items() if text]

"""Faults of numbers of units and positions that are too large together."""

from __future__ import annotations

from collections.abc import Callable

from ...counts import too_many
from ...errors import Fault
from .declared import MEASUREMENTS


def size_faults(count: Callable[[str], int], stored: int) -> list[Fault]:
    """A fault of every number of units whose measurements do not fit into memory.

    `count` gives a parameter by name, `stored` the evaluations that a search stores.
    """
    positions = count("positions")
    searched = count("search_positions") or positions
    per = {"search_units": (stored + 1) * searched, "report_units": positions, "elastic_units": count("te_positions")}
    messages = {name: too_many(count(name), MEASUREMENTS, number, "units x positions") for name, number in per.items()}
    return [Fault(f"parameters.{name}", text) for name, text in messages.items() if text]

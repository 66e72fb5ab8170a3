"""Algorithms of pymoo that are not offered, and what to use instead."""

from __future__ import annotations

from types import MappingProxyType

UNSEEDED = "its survival draws from a generator without a seed, so that no run can be repeated"
SHARED = (
    "its runs share one normalisation, so that a second run in a process differs from the first under the same seed"
)

REFUSED = MappingProxyType(
    {"cmopso": (UNSEEDED, "gde3"), "isres": (UNSEEDED, "ga"), "spea2": (SHARED, "nsga2"), "sres": (UNSEEDED, "ga")}
)
"""Reason, measured on pymoo 0.6.2, and replacement, by name."""

"""Refused before a search: settings under which the cheapest design is not meant."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ...declarations import Value
from ...errors import Fault
from ..settings import Bound
from .declared import DISC_TO_DISC

HOLD_INTERFERENCE = {
    "interference_probability": 1.0,
    "interference_share_of_turn": 1.0,
    "overlap_p95_arcmin": np.inf,
    "preload_torque_Nm": np.inf,
    "preload_torque_Nm_max": np.inf,
    "preload_torque_Nm_mean": np.inf,
}
"""Outputs, a limit on any of which below these values holds interference."""


def priceless(searched: Collection[str], costs: Collection[str]) -> list[Fault]:
    """Errors between discs that are searched without a cost: the tightest would be free."""
    return [
        Fault(
            f"costs.{name}",
            f"is missing: {name} is searched, but a tight tolerance of it has no cost; give a curve, or fix it "
            f"(variables.{name}.value = {value:.4g})",
        )
        for name, value in DISC_TO_DISC.items()
        if name in searched and name not in costs
    ]


def unlimited(limits: Mapping[str, Bound], parameters: Mapping[str, Value]) -> list[Fault]:
    """No limit that holds the interference down, unless that is allowed."""
    held = [n for n in HOLD_INTERFERENCE if n in limits and limits[n].high < HOLD_INTERFERENCE[n]]
    if held or parameters["allow_interference"]:
        return []
    text = (
        "is missing: without a limit on interference or preload all of the cheapest units interfere (cost 7 with "
        "99.9 % of the units preloaded); set, for example, 0.05, or parameters.allow_interference = true"
    )
    return [Fault("limits.interference_probability", text)]

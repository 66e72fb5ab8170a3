"""Interpretation of document B's formula: its corrections, each by one parameter."""

from __future__ import annotations

from dataclasses import replace
from math import inf

from ...declarations import READING, Parameter, Value

CONSISTENT, PRINTED = "consistent", "printed"


def _corrected(name: str, default: Value, printed: Value, meaning: str, source: str, high: float = inf) -> Parameter:
    """A parameter whose default differs from the printed interpretation of document B."""
    return Parameter(name, default, "", meaning, source, assumed=True, low=0.0, high=high, readings={PRINTED: printed})


READINGS: tuple[Parameter, ...] = (
    Parameter(
        READING,
        CONSISTENT,
        "",
        "consistent: document B's formula with its errors corrected; "
        "printed: the formula as printed, and as in version 0.1. It sets the defaults of eccentricity_factor, "
        "position_mids_count, sun_held, involute_cosine and planets",
        choices=(CONSISTENT, PRINTED),
    ),
    _corrected(
        "eccentricity_factor",
        1.0,
        2.0,
        "factor on the law of the eccentricity, factor/(e z_c) times the polynomial",
        "exact 40-pin geometry: 1",
        100.0,
    ),
    _corrected(
        "position_mids_count",
        False,
        True,
        "whether the mid-limits of pin position and pitch move the mean backlash",
        "a turn common to all pins causes no backlash",
    ),
    _corrected(
        "sun_held",
        True,
        False,
        "whether backlash is measured at the carrier with the sun held: the cranks then turn "
        "with the carrier, and phi_2 and phi_3 are 117/121 of the turn of the discs (derived "
        "from the teeth); otherwise they are the turn of the discs",
        "kinematics",
    ),
    _corrected(
        "involute_cosine",
        True,
        False,
        "whether phi_1 is j_n/(i r_1 cos(alpha)), because j_n is normal to the flanks; otherwise j_n/(i r_1)",
        "geometry of the involute",
    ),
    replace(
        _corrected(
            "planets", 2, 1, "number of planets; phi_1 is the least of their clearances", "as in document A", 12
        ),
        low=1,
    ),
    Parameter(
        "planet_share",
        0.5,
        "",
        "fraction of the variance of the planets' clearances (as normal scores) that is common to all",
        "all planets mesh with the same sun",
        assumed=True,
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "stagger_gain",
        2.0,
        "",
        "phi_2 decreases by stagger_gain times stagger_arcmin: document B's 4 delta', where delta' is half the stagger",
        "document B",
        low=0.0,
        high=100.0,
    ),
)

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
        "consistent: errors of document B's formula mended; "
        "printed: as version 0.1 had them. It sets the defaults of eccentricity_factor, "
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
        "a turn that all pins share is no backlash",
    ),
    _corrected(
        "sun_held",
        True,
        False,
        "backlash is read at the carrier with the sun held: the "
        "cranks turn along, and phi_2 and phi_3 count 117/121 of what the discs turn "
        "(derived from the teeth); otherwise as the discs turn",
        "kinematics",
    ),
    _corrected(
        "involute_cosine",
        True,
        False,
        "whether phi_1 is j_n/(i r_1 cos(alpha)), j_n being normal to the flanks; otherwise j_n/(i r_1)",
        "geometry of the involute",
    ),
    replace(_corrected("planets", 2, 1, "planets: phi_1 is the least clearance of any", "as in document A", 12), low=1),
    Parameter(
        "planet_share",
        0.5,
        "",
        "share of the variance of the planets' clearances (as normal scores) that they have in common",
        "they mesh with one sun",
        assumed=True,
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "stagger_gain",
        2.0,
        "",
        "phi_2 falls by stagger_gain times stagger_arcmin: document B's 4 delta', delta' being half the turn of a disc",
        "document B",
        low=0.0,
        high=100.0,
    ),
)

"""Limits of validity of the units of `rv_reducer`."""

from __future__ import annotations

from collections.abc import Mapping

from ...declarations import Value


def validity(parameters: Mapping[str, Value], uniform: bool) -> tuple[str, ...]:
    """A sentence for each; `uniform`: every error is uniform over its zone."""
    zones = "Every error is uniform over its zone: skewed or centred processes give other fractions."
    given = "Distributions are those of the configuration, the same for all parts of a kind."
    stage = (
        "The clearances of the planets are centred on each other, and the runout of the involute stage is not "
        "followed along the turn: phi_1 is a single number per unit.",
        "phi_1 does not depend on the torque.",
    )
    return (
        zones if uniform else given,
        "Pitch error and runout of a disc are waves with one period per turn of the disc.",
        *(stage if parameters["involute_stage"] else ()),
        "No friction, no temperature, no wear.",
        "Play of the crank bearings acts about the centre of the disc only; along the load of the bearing it would "
        "count about 1.15 times (an estimate, not tested).",
        "A pin circle that is offset does not centre itself under load: likely pessimistic.",
        "Stiffnesses (contact and series) are assumed; lost motion, transmission error, preload and pin force follow "
        "from them, backlash does not.",
    )

"""One wave per turn of the output."""

from __future__ import annotations

from ..effect import ANGLE
from ..shapes import Orders


class OutputEccentricity(Orders):
    """One wave per turn of the output."""

    name, family = "output_eccentricity", ANGLE
    cause = "The output, or the encoder on it, is mounted off its axis."
    formula = "c cos 1 theta + s sin 1 theta"
    mistaken_for = ("encoder_harmonics",)
    orders = (1,)

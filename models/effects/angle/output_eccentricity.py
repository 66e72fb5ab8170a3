"""One wave per turn of the output."""

from ..shapes import Orders


class OutputEccentricity(Orders):
    """One wave per turn of the output."""

    name = "output_eccentricity"
    family = "geometry by angle"
    cause = "The output, or the encoder on it, is mounted off its axis."
    formula = "c cos 1 theta + s sin 1 theta"
    mistaken_for = ("encoder_harmonics",)
    reference = "Sanchez-Brea and Morlanes, Meas. Sci. Technol. 19, 2008"
    orders = (1,)

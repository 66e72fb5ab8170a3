"""Waves of the encoder."""

from ..shapes import POSITIONS, Orders


class EncoderHarmonics(Orders):
    """Orders 1, 2 and 4: errors of the encoder or resolver."""

    name = "encoder_harmonics"
    family = "instrument"
    dimensions = POSITIONS
    cause = "The scale is eccentric and oval, and the signals of its reading heads differ."
    formula = "orders 1, 2 and 4, as above; without 2 and 4 it is output_eccentricity"
    mistaken_for = ("output_eccentricity",)
    reference = "Sanchez-Brea and Morlanes, Meas. Sci. Technol. 19, 2008"
    orders = (1, 2, 4)

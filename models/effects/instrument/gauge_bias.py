"""An instrument that measures too much or too little."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ..effect import Measurements, Target, Values
from ..shapes import OneColumn, Weight


class GaugeBias(OneColumn):
    """A constant that the instrument adds."""

    name = "gauge_bias"
    family = "instrument"
    cause = "The zero of the instrument deviates."
    formula = "c"
    mistaken_for = ("process_mean_shift", "lot_offset")
    reference = "AIAG, Measurement Systems Analysis, 2010"
    weight = Weight("offset", "c, constant that the instrument adds", low=-inf)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.ones(len(measurements))

"""The contract of a cost curve."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..errors import Fault
from ..models.costs import CURVES, CostCurve
from ..models.costs.reading import curve_table, read_curve
from ..section import Section


class CurveContract:
    """What every `CostCurve` must keep between two tolerances, in the unit of its variable."""

    curve: ClassVar[CostCurve]
    low: ClassVar[float] = 0.01
    high: ClassVar[float] = 1.0

    def _tolerances(self) -> np.ndarray:
        """Tolerances (n,) away from where the slope jumps."""
        whole = np.geomspace(self.low, self.high, 203)[1:-1]
        near = [np.abs(whole - bend) < 1e-3 * bend for bend in self.curve.bends]
        return whole[~np.any(near, axis=0)] if near else whole

    def test_is_registered_and_comes_back_from_its_table(self) -> None:
        assert CURVES.name_of(type(self.curve)) in CURVES
        faults: list[Fault] = []
        assert read_curve(Section(curve_table(self.curve), "costs", faults)) == self.curve
        assert not faults

    def test_coefficients_are_accepted(self) -> None:
        assert self.curve.faults() == []

    def test_cost_is_finite_and_falls(self) -> None:
        cost = self.curve.cost(self._tolerances())
        assert np.all(np.isfinite(cost))
        assert np.all(np.diff(cost) <= 1e-12 * np.abs(cost[:-1]))

    def test_slope_is_that_of_the_cost(self) -> None:
        t = self._tolerances() if self.curve.smooth else np.empty(0)
        h = 1e-6 * t
        slope = (self.curve.cost(t + h) - self.curve.cost(t - h)) / (2.0 * h)
        scale = np.max(np.abs(slope), initial=1e-12)
        np.testing.assert_allclose(self.curve.slope(t), slope, rtol=1e-5, atol=1e-7 * scale)

    def test_best_is_no_dearer_than_a_grid(self) -> None:
        t = np.geomspace(self.low, self.high, 2001)
        for linear, square in ((1.0, 0.0), (0.0, 1.0), (3.0, 2.0), (50.0, 400.0)):
            prices = np.array([linear]), np.array([square])
            best = self.curve.best(*prices, self.low, self.high)
            assert self.low <= best[0] <= self.high
            if not self.curve.priced:
                grid = self.curve.cost(t) + linear * t + square * t**2
                least = self.curve.cost(best) + linear * best + square * best**2
                assert least[0] <= np.min(grid) * (1.0 + 1e-9) + 1e-9

"""The contract of a distribution."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.integrate import quad

from ..models.inputs import DISTRIBUTIONS, Distribution
from ..models.inputs.reading import read_distribution, written
from ..section import Section


class DistributionContract:
    """What every `Distribution` of a standardised deviation must keep."""

    distribution: ClassVar[Distribution]

    def test_is_registered_and_comes_back_from_its_table(self) -> None:
        distribution, faults = self.distribution, list[object]()
        assert DISTRIBUTIONS.name_of(type(distribution)) in DISTRIBUTIONS
        assert read_distribution(Section(written(distribution), "part", faults)) == distribution  # type: ignore[arg-type]
        assert not faults

    def test_parameters_are_accepted(self) -> None:
        assert self.distribution.faults() == []

    def test_quantiles_rise_within_the_support(self) -> None:
        low, high = self.distribution.support
        z = self.distribution.quantile(np.linspace(1e-6, 1.0 - 1e-6, 501))
        assert np.all(np.diff(z) >= 0.0) and low - 1e-9 <= z[0] and z[-1] <= high + 1e-9
        assert not self.distribution.one_sided or z[0] >= 0.0

    def test_partial_moments_are_those_of_the_quantiles(self) -> None:
        p = np.array([0.05, 0.3, 0.5, 0.8, 0.999])
        z = self.distribution.quantile(p)
        moments = self.distribution.partial_moments(z)
        np.testing.assert_allclose(moments[0], p, atol=1e-6)
        for order in (1, 2):
            for at, end in enumerate(p):
                whole = quad(
                    lambda q, k=order: float(self.distribution.quantile(np.array(q)) ** k), 0.0, end, limit=200
                )[0]
                np.testing.assert_allclose(moments[order][at], whole, atol=1e-5)

    def test_moments_are_those_of_the_whole(self) -> None:
        raw = self.distribution.raw_moments(2)
        assert raw.shape == (3,)
        end = np.array([self.distribution.support[1]])
        parts = [values[0] for values in self.distribution.partial_moments(end)]
        np.testing.assert_allclose(raw, parts, atol=1e-9)

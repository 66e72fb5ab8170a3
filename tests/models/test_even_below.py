"""Even laws below skewed ones: order, normalisation and characteristic function, each by quadrature."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.models.inputs import (
    Beta,
    Distribution,
    Empirical,
    Exponential,
    Mixture,
    Rayleigh,
    SkewNormal,
    Triangular,
    Uniform,
)
from tolevo.models.propagation.even_below import LOST, even_law_below
from tolevo.models.rv_reducer.tighter_planet import TighterPlanet

LAWS = (
    TighterPlanet(), TighterPlanet(3, 0.2), Beta(2.0, 5.0), Beta(5.0, 2.0), Beta(0.5, 0.5), Rayleigh(),
    Exponential(), SkewNormal(3.0), Triangular(mode=0.7), Uniform(),
    Empirical((0.5, -1.0, 0.5)), Empirical((0.1, 0.2, 0.9)), Mixture((-0.5, 0.2), (0.1, 0.2)),
)  # fmt: skip


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_law_lies_below_at_every_level(law: Distribution, side: float) -> None:
    """Its distribution function, by quadrature of its density, is not below that of the law, at 20,000 places."""
    centre, below = even_law_below(law, side)
    x = np.linspace(0.0, below.reach, 200_001)
    density = np.exp(np.interp(x, below.knots, np.log(below.heights)))
    half = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(x))])
    assert half[-1] == pytest.approx(0.5, abs=1e-8)
    log = np.log(below.heights)
    assert np.all(np.diff(np.diff(log) / np.diff(below.knots)) <= 1e-9)  # log-concave
    assert np.all(np.diff(log) <= 1e-12)
    z = centre + np.linspace(-1.0, 1.0, 20_000) * below.reach
    own = 0.5 + np.sign(z - centre) * np.interp(np.abs(z - centre), x, half)
    known = law.partial_moments(z)[0] if side > 0.0 else 1.0 - law.partial_moments(-z)[0]
    assert np.all(known <= own + LOST + 1e-8)
    w = np.array([5e-4, 0.01, 0.7, 5.0, 40.0])
    value, slope = below.characteristic(w)
    for at, frequency in enumerate(w):
        assert value[at] == pytest.approx(2.0 * np.trapezoid(density * np.cos(frequency * x), x), abs=1e-8)
        assert slope[at] == pytest.approx(-2.0 * np.trapezoid(density * x * np.sin(frequency * x), x), abs=1e-8)
    assert np.all(np.abs(value) <= below.envelope(w)[0] + 1e-12)
    assert np.all(np.abs(slope) <= below.slope_envelope(w)[0] + 1e-12)
    for level in (0.5, 0.6, 0.99, 0.9999):
        assert np.interp(below.quantile(level), x, 0.5 + half) == pytest.approx(level, abs=1e-7)


def test_upper_half_of_the_tighter_planet_is_kept() -> None:
    """What exceeds a limit comes of the upper half: its quantiles are kept within 0.3 % of the zone."""
    law = TighterPlanet()
    centre, below = even_law_below(law)
    levels = np.linspace(0.55, 0.999, 50)
    assert np.all(np.abs(centre + below.quantiles(levels) - law.quantile(levels)) < 0.006)

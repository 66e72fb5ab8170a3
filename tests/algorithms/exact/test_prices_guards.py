"""Guards of prices: what is priced by its square, and what has no price at all."""

from __future__ import annotations

import numpy as np
import pytest

from tests.algorithms.exact.parts_by_hand import INF, Priced, form, way
from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.combination import Prices, pure_root_rows
from tolevo.models.costs import Reciprocal
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Piece, Quantile, Spread


def test_a_quantile_is_not_priced_by_its_square() -> None:
    """Its S is no root: of two requirements of the same spread the first is one, the second not."""
    quantile = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),) * 2)
    part = way(0.0, 1.0, 0.1, 1.0, (0.0, 0.0), (1.0, 1.0))
    own = form([part], [part], quantiles=(None, quantile))
    assert pure_root_rows(own).tolist() == [True, False]


def test_a_tangent_without_a_bound_costs_nothing_where_its_price_is_nothing() -> None:
    """Received are 2 (3 - 1) for the first sum, and 0 for the second, whose S is only known to be
    above minus infinity; with a price it would be worth infinitely much, and prove nothing.
    """
    own = form([way(0.0, 1.0, 0.1, 1.0, (1.0, 1.0), (1.0, 1.0))])
    spread = Spread(np.ones((1, 2)), np.ones((1, 2, 1)), np.array([[1.0, -INF]]))
    for second, received in ((0.0, 4.0), (1.0, INF)):
        prices = Prices.at(own, np.array([[2.0, second]]), np.full((1, 2), 3.0), spread)
        assert prices.received[0] == received


@pytest.mark.parametrize("many", [1, 1000])
@pytest.mark.parametrize("curve", [Reciprocal, Priced])
def test_without_requirements_every_part_is_made_as_is_cheapest(
    monkeypatch: pytest.MonkeyPatch, many: int, curve: type[Priced] | type[Reciprocal]
) -> None:
    """At t = 2: the least of 0.5, 1.25 and 0.4, and that of 0.5 and 0.3 + 0.1."""
    monkeypatch.setattr(choices, "MAX_UNPRICED_COMBINATIONS", many)
    first = [way(a, b, 0.1, 2.0, (), (), curve) for a, b in ((0.0, 1.0), (1.0, 0.5), (0.2, 0.4))]
    second = [way(a, b, 0.1, 2.0, (), (), curve) for a, b in ((0.0, 1.0), (0.3, 0.2))]
    best = least_cost(form(first, second), np.empty((2, 0)))
    np.testing.assert_allclose(best.cost, 0.8, rtol=1e-12)
    np.testing.assert_allclose(best.bound, 0.8, rtol=1e-12)
    assert best.chosen.tolist() == [[2, 1]] * 2 and np.all(best.t == 2.0)

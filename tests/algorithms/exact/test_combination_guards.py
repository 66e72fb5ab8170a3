"""One combination of ways: offsets that only some ways have, and errors of a quantile's slopes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.algorithms.exact.parts_by_hand import Array, form, way
from tolevo.algorithms.exact.combination import Combination
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.models.propagation.symmetric_sum import Tangent
from tolevo.problems.forms import Piece, Quantile, Quantiles


def test_offsets_are_those_of_the_chosen_ways() -> None:
    """2 t1 + 0.5 t2 at t = (0.2, 0.4), with 0.3 and -0.1 of the first part's ways and none of the
    second part's; a second requirement has an offset of its own alone.
    """
    first = [way(0.0, 1.0, 0.1, 1.0, (2.0, 1.0), (0.0, 0.0))] * 2
    moved = [replace(one, offset=(by, 0.0)) for one, by in zip(first, (0.3, -0.1), strict=True)]
    own = form(moved, [way(0.0, 1.0, 0.1, 1.0, (0.5, 1.0), (0.0, 0.0))])
    own = replace(own, offset=np.array([0.05, 0.7]))
    t = np.array([[0.2, 0.4]])
    for chosen, value in ((0, 0.95), (1, 0.55)):
        values = Combination(own, (chosen, 0)).values(t)
        np.testing.assert_allclose(values, [[value, 1.3]], rtol=1e-14)


def test_errors_of_a_quantiles_slopes_count_up_to_the_largest_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """S of 2 with an error of 0.01, slopes of 1 with errors of 0.1 and 0.2: what is proven at
    parts (0.3, 0.8) is 2 - 1.1 - 0.01, less 0.1 times the 1.5 and 0.2 times the 4 of the widest.
    """

    def tangent(self: Quantiles, s: Array, sure: bool = True) -> Tangent:
        np.testing.assert_allclose(s, [[[0.3, 0.8]]])
        return Tangent(np.full((1, 1), 2.0), np.ones((1, 1, 2)), np.full((1, 1), 0.01),
                       np.array([[[0.1, 0.2]]]))  # fmt: skip

    monkeypatch.setattr(Quantiles, "tangent", tangent)
    quantile = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),) * 2)
    own = form([way(0.0, 1.0, 0.1, 1.5, (0.0,), (1.0,))], [way(0.0, 1.0, 0.1, 2.0, (0.0,), (2.0,))],
               quantiles=(quantile,))  # fmt: skip
    spread = Combination(own, (0, 0)).spread_at(np.array([[0.3, 0.4]]))
    np.testing.assert_allclose(spread.intercept, 2.0 - 1.1 - 0.01 - 0.15 - 0.8, rtol=1e-12)

"""Standard errors of shares, against the binomial distribution of scipy."""

import numpy as np
import pytest
from scipy.stats import binom

from tolevo.commands.reproduce.calculations.manipulator import _fraction
from tolevo.commands.reproduce.recipes import Statistic, share_error


@pytest.mark.parametrize("count", [10, 1000])
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_share_of_none_or_all_is_uncertain(share: float, count: int) -> None:
    """As one success in n + 2; a share two errors away seldom gives none."""
    error = share_error(share, count)
    assert error == pytest.approx(binom.std(count + 2, 1.0 / (count + 2)) / (count + 2))
    assert binom.pmf(0, count, min(2.0 * error, 1.0)) < 0.2


@pytest.mark.parametrize(("hits", "count"), [(1, 10), (5, 10), (999, 1000)])
def test_between_them_it_is_binomial(hits: int, count: int) -> None:
    assert share_error(hits / count, count) == pytest.approx(binom.std(count, hits / count) / count)


@pytest.mark.parametrize("name", ["fraction_above", "fraction_below"])
@pytest.mark.parametrize("limit", [-1.0, 99.0])
def test_shares_of_a_model(name: str, limit: float) -> None:
    assert Statistic(name, limit).error(np.arange(50.0)) == pytest.approx(np.sqrt(51) / 52**1.5)


def test_shares_of_settings() -> None:
    won = np.ones(10, dtype=bool)
    found = _fraction(won, ~won)
    assert found.value == 100.0
    assert found.standard_error == pytest.approx(100.0 * np.sqrt(11) / 12**1.5)

"""Cavities, lots and machines of measured parts: one-way analysis, degrees of freedom, mixtures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tolevo.models.capability import knowledge_of, subpopulations
from tolevo.models.capability.samples import LEVEL, findings
from tolevo.models.inputs import Mixture


def labels(groups: int, parts: int) -> list[str]:
    return [f"C{at % groups}" for at in range(groups * parts)]


def test_the_analysis_is_that_of_scipy_and_of_explicit_sums() -> None:
    rng = np.random.default_rng(1)
    names = [*labels(4, 6), "C0", "C1", "C1"]
    values = rng.normal(size=len(names)) + np.array([0.8 * int(name[1]) for name in names])
    (found,) = subpopulations(values, {"cavity": names})
    groups = [values[[name == f"C{at}" for name in names]] for at in range(4)]
    assert found.probability == pytest.approx(stats.f_oneway(*groups).pvalue, rel=1e-9)
    within = sum(((group - group.mean()) ** 2).sum() for group in groups) / (len(names) - 4)
    between = sum(len(group) * (group.mean() - values.mean()) ** 2 for group in groups) / 3
    assert (found.within, found.between) == pytest.approx((within, between), rel=1e-12)
    assert found.df == (3, len(names) - 4)
    as_found = found.as_found()
    assert as_found.variance == pytest.approx(values.var(ddof=1), rel=1e-12)
    np.testing.assert_allclose(found.centred(values).mean(), values.mean())


def test_alarms_on_clean_samples_and_power_at_two_sigma() -> None:
    """200 samples of eight cavities with eight parts: 1 +- 1 % alarms, at least 95 % found."""
    rng, names = np.random.default_rng(44), labels(8, 8)
    clean, apart = [], []
    for _ in range(200):
        noise, means = rng.normal(size=64), 2.0 * rng.normal(size=8)
        clean.append(any(f.kind == "lots" for f in findings(noise, {"cavity": names})))
        apart.append(any(f.kind == "lots" for f in findings(noise + np.tile(means, 8), {"cavity": names})))
    assert np.mean(clean) <= 0.02
    assert np.mean(apart) >= 0.95


@pytest.mark.parametrize("kind", ["lot", "cavity"])
def test_degrees_of_freedom_fit_the_scatter_of_the_estimate(kind: str) -> None:
    """The variance of the estimate over repeats is 2 V^2/df, lots being drawn anew, cavities staying."""
    rng, names, estimates, degrees = np.random.default_rng(5), labels(10, 8), [], []
    cavities = 1.5 * rng.normal(size=10)
    for _ in range(2000):
        means = 1.5 * rng.normal(size=10) if kind == "lot" else cavities
        (found,) = subpopulations(rng.normal(size=80) + np.tile(means, 8), {kind: names})
        estimates.append(found.as_found().variance)
        degrees.append(found.as_found().df)
    effective = 2.0 * np.mean(estimates) ** 2 / np.var(estimates)
    assert np.median(degrees) == pytest.approx(effective, rel=0.25)
    assert effective < 25.0 if kind == "lot" else effective > 90.0


def test_lots_are_worth_fewer_parts_than_there_are() -> None:
    values = np.random.default_rng(2).normal(size=40) + np.repeat([0.0, 4.0, -3.0, 2.0, 5.0], 8)
    (found,) = subpopulations(values, {"lot": list(np.repeat(list("abcde"), 8))})
    plain, known = knowledge_of(values), knowledge_of(values, scatter=found.as_found())
    assert plain.df == 39.0
    assert 4.0 <= known.df < 8.0
    assert known.n == pytest.approx(5.0, rel=0.3)
    assert known.std > plain.std


def test_the_group_that_is_off_is_named() -> None:
    values = np.random.default_rng(3).normal(0.0, 1.0, 40) - 6.0 * (np.arange(40) % 4 == 2)
    (found,) = subpopulations(values, {"cavity": labels(4, 10)})
    at, off = found.furthest()
    assert found.names[at] == "C2"
    assert off == pytest.approx(-6.0, abs=0.8)
    assert "has cavities whose means differ" in found.text()
    assert "cavity C2 is" in found.text()
    assert "below the others" in found.text()


def test_groups_that_are_none() -> None:
    values = np.arange(6.0)
    assert subpopulations(values, {"lot": ["a"] * 6, "cavity": list("abcdef")}) == []


def test_the_mixture_of_a_sample_has_its_moments() -> None:
    values = np.random.default_rng(3).normal(size=90) + np.tile([0.0, 3.0, -1.0], 30)
    (found,) = subpopulations(values, {"cavity": labels(3, 30)})
    shares, centres, within = found.mixture()
    _, mean, square = Mixture(centres, (within,) * 3, shares).raw_moments(2)
    assert mean == pytest.approx(0.0, abs=1e-12)
    assert square == pytest.approx(values.var(ddof=1), rel=0.05)


@pytest.mark.parametrize(("groups", "parts", "words"), [(8, 5, "of 8 cavities of 5 parts"), (4, 10, "")])
def test_it_is_said_where_a_sample_cannot_show_a_difference(groups: int, parts: int, words: str) -> None:
    """The power of the F test against a count: one of the groups is off by two standard deviations."""
    rng = np.random.default_rng(6)
    off = 2.0 * (np.arange(groups * parts) % groups == 1)
    samples = [rng.normal(0.0, 1.0, groups * parts) + off for _ in range(2000)]
    found = [subpopulations(one, {"cavity": labels(groups, parts)})[0] for one in samples]
    detected = np.mean([one.probability < LEVEL for one in found])
    assert found[0].power(LEVEL) == pytest.approx(detected, abs=4.0 * np.sqrt(0.25 / len(samples)))
    assert words in (text := found[0].blind_text(LEVEL))
    assert bool(text) == bool(words)

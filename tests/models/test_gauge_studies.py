"""Gauge studies against the example of AIAG, Measurement Systems Analysis, 4th ed., and explicit sums."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.models.capability.gauge_studies import gauge_study

TRIALS = {
    "A": "0.29 -0.56 1.34 0.47 -0.80 0.02 0.59 -0.31 2.26 -1.36 0.41 -0.68 1.17 0.50 -0.92 -0.11 0.75 -0.20 1.99 -1.25 "
    "0.64 -0.58 1.27 0.64 -0.84 -0.21 0.66 -0.17 2.01 -1.31",
    "B": "0.08 -0.47 1.19 0.01 -0.56 -0.20 0.47 -0.63 1.80 -1.68 0.25 -1.22 0.94 1.03 -1.20 0.22 0.55 0.08 2.12 -1.62 "
    "0.07 -0.68 1.34 0.20 -1.28 0.06 0.83 -0.34 2.19 -1.50",
    "C": "0.04 -1.38 0.88 0.14 -1.46 -0.29 0.02 -0.46 1.77 -1.49 -0.11 -1.13 1.09 0.20 -1.07 -0.67 0.01 -0.56 1.45 "
    "-1.77 -0.15 -0.96 0.67 0.11 -1.45 -0.49 0.21 -0.49 1.87 -2.16",
}
"""Three trials of ten parts by appraiser: table III-B 6a."""


def test_the_example_of_the_manual() -> None:
    """Appendix A: EV 0.199933, AV 0.226838, GRR 0.302373, PV 1.042327; the interaction is pooled."""
    values = np.array([float(word) for words in TRIALS.values() for word in words.split()])
    parts, operators = [str(at % 10) for at in range(90)], [name for name in TRIALS for _ in range(30)]
    study = gauge_study(values, parts, operators)
    found = study.repeatability, study.reproducibility, study.sigma, study.part
    assert found == pytest.approx((0.199933, 0.226838, 0.302373, 1.042327), abs=2e-6)
    assert study.kind == 2
    shuffled = np.random.default_rng(0).permutation(90)
    again = gauge_study(values[shuffled], [parts[at] for at in shuffled], [operators[at] for at in shuffled])
    assert again.sigma == pytest.approx(study.sigma, rel=1e-12)


def test_type_three_is_the_pooled_scatter_of_the_parts() -> None:
    table = np.random.default_rng(1).normal(size=(12, 3)) + 5.0 * np.arange(12)[:, None]
    study = gauge_study(table.ravel(), [str(at // 3) for at in range(36)])
    assert (study.kind, study.df) == (3, 24.0)
    assert study.sigma == pytest.approx(np.sqrt(table.var(axis=1, ddof=1).mean()), rel=1e-12)


def test_type_one_has_a_bias_against_its_reference() -> None:
    values = np.random.default_rng(2).normal(10.003, 0.001, 50)
    study = gauge_study(values, reference=10.0)
    assert (study.kind, study.df) == (1, 49.0)
    assert study.sigma == pytest.approx(values.std(ddof=1), rel=1e-12)
    assert study.bias == pytest.approx(0.003, abs=5e-4)
    assert study.bias_probability < 1e-6
    assert "bias +0.003" in study.statement("mm")


def test_operators_that_differ_by_part_are_no_chance() -> None:
    """A true interaction counts: sigma^2 of error, interaction and operators, known from the simulation."""
    rng, variances = np.random.default_rng(3), []
    for _ in range(200):
        crossed, operator = rng.normal(0.0, 2.0, (10, 3, 1)), rng.normal(0.0, 1.0, (1, 3, 1))
        table = rng.normal(0.0, 1.0, (10, 3, 3)) + crossed + operator + 10.0 * rng.normal(size=(10, 1, 1))
        names = [(str(p), str(o)) for p in range(10) for o in range(3) for _ in range(3)]
        variances.append(gauge_study(table.ravel(), [p for p, _ in names], [o for _, o in names]).sigma ** 2)
    assert np.mean(variances) == pytest.approx(1.0 + 4.0 + 1.0, rel=0.1)


@pytest.mark.parametrize(
    ("values", "parts", "operators", "words"),
    [
        ([1.0, 2.0, 3.0], ["a", "b", "c"], [], "one measurement of each part"),
        ([1.0, 2.0, 3.0], ["a", "a", "b"], [], "measure each part equally often"),
        ([1.0, 1.0, 2.0, 2.0], ["a", "a", "b", "b"], [], "all equal"),
        ([1.0] * 12, [], [], "all equal"),
        ([1.0, 2.0], [], [], "at least 10"),
        ([1.0, 2.0], ["a", "a"], ["x", "y"], "several parts are needed"),
    ],
)
def test_studies_that_are_none(values: list[float], parts: list[str], operators: list[str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        gauge_study(np.array(values), parts, operators)

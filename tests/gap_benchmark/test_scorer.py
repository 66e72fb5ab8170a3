"""The test of the test: who knows the truth passes every gate, who names badly does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.gap.generator.records import Truth, record
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.scoring.scorer import (
    Figure,
    Scored,
    Told,
    clopper_pearson,
    figures,
    told,
    verdict,
)

Known = list[tuple[Truth, tuple[Told, ...]]]
COUNTS = {"clean": 60, "good": 8, "poor": 8, "pair": 3, "outside": 5, "size": 4, "delay": 3}


def said(
    word: str, names: tuple[str, ...], others: frozenset[str] = frozenset(), after: float = 1.0
) -> dict[str, Any]:
    """What a `gap.json` holds."""
    alternatives = [{"names": sorted(others), "separating_measurement": ""}] if others else []
    effects = [{"name": name} for name in names]
    return {"verdict": word, "effects": effects, "alternatives": alternatives, "gap_after": after}


def who_knows(truth: Truth, kept: tuple[Told, ...]) -> dict[str, Any]:
    """The right answer: every name with all that cannot be told from it."""
    if truth.outside:
        return said("unnamed", ())
    if not truth.hidden:
        return said("no_gap", ())
    others = frozenset[str]().union(*(one.names for one in kept)) - set(truth.names)
    word = "ambiguous" if others else "named"
    return said(word, truth.names, others, 1.01 * truth.noise_rms)


@pytest.fixture(scope="module")
def known() -> Known:
    truths = [record(group, k)[1] for group, count in COUNTS.items() for k in range(count)]
    return [(truth, tuple(told(truth, one) for one in truth.hidden)) for truth in truths]


def by_name(found: list[Figure]) -> Mapping[str, Figure]:
    return {one.name: one for one in found}


def test_who_knows_the_truth_meets_every_figure(
    known: list[tuple[Truth, tuple[Told, ...]]],
) -> None:
    records = [Scored(truth, kept, verdict(who_knows(truth, kept))) for truth, kept in known]
    # Its answers carry no intervals, and bounds of few records are wide.
    shown = [one for one in figures(records) if not one.name.startswith("coverage")]
    assert all(one.count > 0 for one in shown)
    assert [one for one in shown if not one.met and "size of" not in one.name] == []


@pytest.mark.parametrize("name", BASELINES)
def test_poor_namers_fail(name: str, known: Known) -> None:
    """False names of clean records, and of causes outside the library: beyond all doubt."""
    kept = []
    for truth, seen in known:
        if truth.group == "outside" or (truth.group == "clean" and truth.number < 25):
            one = record(truth.group, truth.number)[0]
            kept.append(Scored(truth, seen, verdict(BASELINES[name](one, truth))))
    found = by_name(figures(kept))
    assert found["clean given a name, upper bound"].refuted
    assert found["outside the library, not `unnamed`"].refuted


@pytest.fixture(scope="module")
def lag() -> tuple[Truth, tuple[Told, ...]]:
    truth = record("delay", 0)[1]
    return truth, (told(truth, truth.hidden[0]),)


def test_a_lag_and_viscous_drag_are_twins(lag: tuple[Truth, tuple[Told, ...]]) -> None:
    truth, kept = lag
    assert kept[0].twins == {"read_out_lag", "viscous_friction"}
    twin = frozenset({"read_out_lag"})
    declared = Scored(truth, kept, verdict(said("ambiguous", ("viscous_friction",), twin)))
    silent = Scored(truth, kept, verdict(said("named", ("viscous_friction",))))
    assert declared.all_named and not silent.all_named
    delayed = by_name(figures([replace(declared), silent]))
    assert delayed["noise that changes or delay, physics named"].value == 0.5


def test_a_second_name_is_spurious(lag: tuple[Truth, tuple[Told, ...]]) -> None:
    truth, kept = lag
    twin = frozenset({"viscous_friction"})
    one = Scored(truth, kept, verdict(said("ambiguous", ("read_out_lag", "drift"), twin)))
    assert one.all_named
    assert one.spurious == 1
    both = Scored(truth, kept, verdict(said("named", ("read_out_lag", "viscous_friction"))))
    assert both.spurious == 1


def test_lambda_is_that_of_a_straight_line_by_hand() -> None:
    """A drift over n equal steps: squares about its mean are span^2 n (n+1) / (12 (n-1))."""
    number = next(k for k in range(300) if record("good", k)[1].names == ("drift",))
    truth = record("good", number)[1]
    n, span = len(truth.points), float(np.ptp(truth.hidden[0].added))
    by_hand = span**2 * n * (n + 1) / (12.0 * (n - 1)) / truth.sigma**2
    np.testing.assert_allclose(told(truth, truth.hidden[0]).strength, by_hand, rtol=1e-9)


def test_interval_of_a_proportion_is_the_published_one() -> None:
    """Clopper and Pearson (1934); none of n: 1 - (alpha/2)^(1/n)."""
    low, high = clopper_pearson(0, 20)
    assert low == 0.0
    np.testing.assert_allclose(high, 1.0 - 0.025 ** (1 / 20), rtol=1e-12)
    low, high = clopper_pearson(10, 20)
    np.testing.assert_allclose([low, high], [0.2720, 0.7280], atol=1e-4)

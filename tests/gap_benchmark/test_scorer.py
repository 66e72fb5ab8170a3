"""The test of the test: who knows the truth passes every gate, who names badly does not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from benchmarks.gap.generator.records import Truth, record
from benchmarks.gap.scoring.rivals import first_parameter
from benchmarks.gap.scoring.scorer import Figure, Scored, clopper_pearson, figures, verdict
from benchmarks.gap.scoring.told import Told, told

Known = list[tuple[Truth, tuple[Told, ...]]]
COUNTS = {"clean": 60, "good": 8, "poor": 8, "pair": 3, "outside": 5, "size": 4, "delay": 3}


def said(word: str, names: tuple[str, ...], others: frozenset[str] = frozenset(), after: float = 1.0) -> dict[str, Any]:
    """What a `gap.json` holds."""
    alternatives = [{"names": sorted(others), "separating_measurement": ""}] if others else []
    effects: list[dict[str, Any]] = [{"name": name} for name in names]
    return {"verdict": word, "effects": effects, "alternatives": alternatives, "gap_after": after}


def who_knows(truth: Truth, kept: tuple[Told, ...]) -> dict[str, Any]:
    """The right answer: every name with all that cannot be told from it; of its intervals, one
    in ten is off.
    """
    if truth.outside:
        return said("unnamed", ())
    if not truth.hidden:
        return said("no_gap", ())
    others = frozenset[str]().union(*(one.names for one in kept)) - set(truth.names)
    word = "ambiguous" if others else "named"
    found = said(word, truth.names, others, 1.01 * truth.noise_rms)
    for effect, one in zip(found["effects"], kept, strict=True):
        size = 1.0 + abs(one.value)
        middle = one.value + (5.0 * size if truth.number % 10 == 7 else 0.0)
        interval = [middle - size, middle + size]
        stem = first_parameter(one.name, truth.kind) or "none"
        effect["parameters"] = {f"{stem}_unit": {"value": middle, "interval": interval}}
    return found


@pytest.fixture(scope="module")
def known() -> Known:
    truths = [record(group, k)[1] for group, count in COUNTS.items() for k in range(count)]
    return [(truth, tuple(told(truth, one) for one in truth.hidden)) for truth in truths]


def by_name(found: list[Figure]) -> Mapping[str, Figure]:
    return {one.name: one for one in found}


def judged(known: Known, word: str | None = None) -> Mapping[str, Figure]:
    """The figures of one who knows, or of one who always says the same word."""
    return by_name(figures([
        Scored(truth, kept, verdict(said(word, ()) if word else who_knows(truth, kept)))
        for truth, kept in known
    ]))  # fmt: skip


def test_who_knows_the_truth_meets_every_figure(known: Known) -> None:
    found = judged(known)
    assert {name: one.word for name, one in found.items()} == dict.fromkeys(found, "met")


@pytest.mark.parametrize(("word", "failed"), [("unnamed", set()), ("no_gap", {"outside the library, not `unnamed`"})])
def test_who_never_names_fails(word: str, failed: set[str], known: Known) -> None:
    """It is right of clean records, and of nothing that hides."""
    found = judged(known, word)
    names = {"single named rightly, good design", "single named rightly, poor design",
             "two effects, both named"}  # fmt: skip
    assert {name for name, one in found.items() if one.refuted} == names | failed
    assert found["clean given a name, upper bound"].met


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
    delayed = by_name(figures([declared, silent]))
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

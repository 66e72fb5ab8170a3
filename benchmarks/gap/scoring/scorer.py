"""What a trial must come out with: each figure with its interval, from truths and verdicts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan, sqrt
from typing import Any

import numpy as np
from scipy.stats import binomtest

from benchmarks.gap.generator.outside import SINCE_INSIDE
from benchmarks.gap.generator.records import Truth
from benchmarks.gap.scoring.rivals import first_parameter
from benchmarks.gap.scoring.told import Told

INSTRUMENT = frozenset(["gauge_bias", "read_out_lag", "encoder_harmonics", "quantisation", "clock_drift", "drift"])
"""Names that blame the instrument."""


@dataclass(frozen=True)
class Verdict:
    """What the workflow said of a record."""

    verdict: str
    names: tuple[str, ...]
    alternatives: frozenset[str]
    after: float
    intervals: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    before: float = nan
    sign: bool = False
    values: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def named(self) -> bool:
        return self.verdict in ("named", "ambiguous", "partial") and bool(self.names)

    @property
    def reported(self) -> frozenset[str]:
        return frozenset(self.names) | self.alternatives


def verdict(found: Mapping[str, Any]) -> Verdict:
    """What a `gap.json` says."""
    names = tuple(one["name"] for one in found["effects"])
    others = frozenset(name for one in found["alternatives"] for name in one["names"])
    after, before = first_of(found.get("gap_after")), first_of(found.get("gap_before"))
    notes = found.get("notes") or [""]
    intervals = {
        one["name"]: {
            name: (known(number["interval"][0]), known(number["interval"][1]))
            for name, number in one.get("parameters", {}).items()
        }
        for one in found["effects"]
    }
    values = {
        one["name"]: {name: known(number.get("value")) for name, number in one.get("parameters", {}).items()}
        for one in found["effects"]
    }
    return Verdict(found["verdict"], names, others, after, intervals, before, "sign" in notes[0], values)


def first_of(gap: Any) -> float:
    """The number of a gap, of several outputs the first; nan where there is none."""
    value = next(iter(gap.values())) if isinstance(gap, Mapping) else gap
    return nan if value is None else float(value)


def known(number: float | None) -> float:
    """A number of a JSON file, nan where it has none."""
    return nan if number is None else float(number)


@dataclass(frozen=True)
class Scored:
    """A record with what can be told of it and what was said of it."""

    truth: Truth
    told: tuple[Told, ...]
    said: Verdict

    @property
    def allowed(self) -> frozenset[str]:
        """Every name that is no mistake here."""
        beside = {name for one in self.truth.hidden for name in one.beside}
        return frozenset(beside).union(*(one.names for one in self.told))

    @property
    def spurious(self) -> int:
        """Names given to nothing: not allowed, or one more than there are effects."""
        beside = {name for one in self.truth.hidden for name in one.beside}
        wrong = [name for name in self.said.names if name not in self.allowed]
        right = [name for name in self.said.names if name in self.allowed - beside]
        return len(wrong) + max(len(right) - len(self.told), 0)

    @property
    def nothing_like_it(self) -> bool:
        """Whether every name of the library leaves something of a cause that it does not have."""
        return not self.since_inside and all(len(one.names) == 1 for one in self.told)

    @property
    def since_inside(self) -> set[str]:
        """The names by which the library has causes by now that once were outside of it."""
        return {SINCE_INSIDE[name] for name in self.truth.names if name in SINCE_INSIDE}

    @property
    def all_named(self) -> bool:
        """Each hidden effect named by its own or by an untold name, its twins declared."""
        if not self.said.named:
            return False
        left = list(self.said.names)
        for one in sorted(self.told, key=lambda told: len(told.names)):
            match = [name for name in left if name in one.names]
            if not match or not one.twins - set(SINCE_INSIDE) <= self.said.reported:
                return False
            left.remove(match[0])
        return True


@dataclass(frozen=True)
class Figure:
    """A line of the table: its value with a 95 % interval, what it must reach, from how many."""

    name: str
    value: float
    low: float
    high: float
    must: float
    aim: float
    count: int
    at_most: bool
    by_bound: bool = False
    rate: bool = True

    @property
    def met(self) -> bool:
        """Whether the value meets what it must; where the notes ask so, its upper bound."""
        judged = self.high if self.by_bound else self.value
        return bool(judged <= self.must if self.at_most else judged >= self.must)

    @property
    def refuted(self) -> bool:
        """Whether the whole interval lies on the wrong side."""
        return bool(self.low > self.must if self.at_most else self.high < self.must)

    @property
    def word(self) -> str:
        """How it stands: met, MISSED beyond doubt, or open, where so few records do not tell."""
        if self.count == 0:
            return "none"
        return "met" if self.met else "MISSED" if self.refuted else "open"


def clopper_pearson(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Exact two-sided interval of a proportion."""
    found = binomtest(hits, count).proportion_ci(level, method="exact")
    return float(found.low), float(found.high)


def share(name: str, hits: Sequence[bool], must: float, aim: float, at_most: bool, by_bound: bool = False) -> Figure:
    """A rate; a one-sided upper 95 % bound where that is what is judged."""
    if not hits:
        return Figure(name, nan, nan, nan, must, aim, 0, at_most, by_bound)
    low, high = clopper_pearson(sum(hits), len(hits), 0.90 if by_bound else 0.95)
    return Figure(name, sum(hits) / len(hits), low, high, must, aim, len(hits), at_most, by_bound)


def mean(name: str, values: Sequence[float], must: float, aim: float) -> Figure:
    """A mean of what is never negative, with the interval of its standard error."""
    if not values:
        return Figure(name, nan, nan, nan, must, aim, 0, True, rate=False)
    middle = float(np.mean(values))
    spread = float(np.std(values, ddof=1)) if len(values) > 1 else nan
    half = 1.96 * spread / sqrt(len(values))
    low, high = max(middle - half, 0.0), middle + half
    return Figure(name, middle, low, high, must, aim, len(values), True, rate=False)


def blames_physics(one: Scored) -> bool:
    """A name that is not the instrument's, no instrument offered beside it."""
    if not one.said.named:
        return False
    physics = set(one.said.names) - INSTRUMENT
    return bool(physics) and not (INSTRUMENT & one.said.alternatives)


def falsely_named(one: Scored) -> bool:
    """A rounded reading may be called quantised; anything else is a false name."""
    harmless = {"quantisation"} if one.truth.noise == "quantised" else set()
    return one.said.named and bool(set(one.said.names) - harmless)


def covered(one: Scored, of: Sequence[Told] | None = None) -> list[bool]:
    """Whether the interval of each hidden effect's first number holds it, where it was named."""
    found = []
    for each in one.told if of is None else of:
        stem = first_parameter(each.name, one.truth.kind)
        for name, (low, high) in one.said.intervals.get(each.name, {}).items():
            if stem and name.startswith(stem) and isfinite(low + high + each.value):
                found.append(low <= each.value <= high)
    return found


def figures(records: Sequence[Scored]) -> list[Figure]:
    """Every figure of the table, in its order."""
    words = ("clean", "good", "poor", "pair", "outside", "size", "delay")
    by = {word: [one for one in records if one.truth.group.split()[-1] == word] for word in words}
    single = [*by["good"], *by["poor"]]
    sets = [one for one in single if one.said.named]
    named = [one for one in (*single, *by["pair"]) if one.said.named and one.all_named]
    untold = [one for one in by["outside"] if one.nothing_like_it]
    changed = [*by["size"], *by["delay"]]

    def rate(of: Sequence[Scored], hit: Callable[[Scored], bool]) -> list[bool]:
        return [hit(one) for one in of]

    return [
        share("clean given a name, upper bound", rate(by["clean"], falsely_named), 0.05, 0.015,
              True, True),
        share("single named rightly, good design", rate(by["good"], rightly), 0.88, 0.95, False),
        share("single named rightly, poor design", rate(by["poor"], rightly), 0.75, 0.85, False),
        share("truth inside the reported set", rate(sets, holds_truth), 0.95, 0.98, False),
        mean("size of the reported set", [len(one.said.reported) for one in sets], 2.0, 1.5),
        share("two effects, both named", rate(by["pair"], lambda one: one.all_named), 0.80, 0.92,
              False),
        mean("spurious names per record of two", [one.spurious for one in by["pair"]], 0.25, 0.05),
        share("outside the library, not `unnamed`",
              rate(untold, lambda one: one.said.verdict != "unnamed"), 0.25, 0.05, True),
        share("noise that changes or delay, physics named", rate(changed, blames_physics), 0.05,
              0.02, True),
        mean("held-out RMSE over noise after naming",
             [one.said.after / one.truth.noise_rms for one in named if isfinite(one.said.after)],
             1.10, 1.03),
        *coverage([hit for one in (*single, *by["pair"]) for hit in covered(one)]),
        *of_other_gears(records),
        *once_outside(records),
        *of_approximate(records),
        *of_rows(records),
        *of_memory(records),
    ]  # fmt: skip


def of_other_gears(records: Sequence[Scored]) -> list[Figure]:
    """Waves of other tooth numbers; none where there are no such records."""
    own = [one for one in records if one.truth.kind == "own gear"]
    unknown = [one for one in records if one.truth.kind == "unknown gear"]
    parts = (("other gear, declared, named rightly", own),
             ("other gear, not declared, named by its order", unknown))  # fmt: skip
    return [share(name, [rightly(one) for one in of], 0.88, 0.95, False) for name, of in parts if of]


def once_outside(records: Sequence[Scored]) -> list[Figure]:
    """Causes that the library has by now. They are drawn with other exponents than its own, so that
    a remainder may be told beside the name.
    """
    of = [one for one in records if one.truth.group == "outside" and one.since_inside]
    hits = [rightly(one) or set(one.said.names) == one.since_inside for one in of]
    return [share("once outside the library, named by it", hits, 0.88, 0.95, False)] if of else []


NEAR = 0.05
"""Fraction of a number by which it may be off."""


def of_approximate(records: Sequence[Scored]) -> list[Figure]:
    """A dominant effect whose form is off: its name, its number, and names of anything else."""
    of = [one for one in records if one.truth.group == "approximate"]
    if not of:
        return []
    return [
        share("form off: dominant effect named", [bool({*one.said.names} & one.allowed) for one in of], 0.95, 0.99,
              False),
        share("form off: its number within 5 % or its interval", [hit for one in of for hit in near(one)], 0.95, 0.99,
              False),
        share("form off: a wrong name", [bool({*one.said.names} - one.allowed) for one in of], 0.03, 0.01, True),
    ]  # fmt: skip


def of_rows(records: Sequence[Scored]) -> list[Figure]:
    """What fewer rows of a machine were given: more of them contradict no name, and take none back."""
    of = {one.truth.number: one for one in records if one.truth.group == "rows"}
    pairs = [
        (of[at], of[at + 1]) for at in of if at + 1 in of and len(of[at].truth.points) < len(of[at + 1].truth.points)
    ]
    held = [{*less.said.names} <= more.said.reported for less, more in pairs]
    return [share("more rows of a machine agree or refine", held, 1.0, 1.0, False)] if of else []


def of_memory(records: Sequence[Scored]) -> list[Figure]:
    """What depends on the rows before: its name, and delays that it is taken for."""
    named = [one for one in records if one.truth.group == "memory"]
    every = [one for one in records if one.truth.group in ("memory", "plays")]
    if not every:
        return []
    return [
        share("memory: named or among the alternatives", [holds_truth(one) for one in named], 0.85, 0.95, False),
        share("memory: called a delay", ["delay" in one.said.names for one in every], 0.0, 0.0, True),
    ]


def near(one: Scored) -> list[bool]:
    """Whether the first number of the hidden effect is near that of its formula's best fit, or in its interval."""
    each, found = one.told[0], list[bool]()
    if {*one.said.names} & (one.allowed - {each.name}):
        return []  # given another effect of the same cause the number is another one
    stem = first_parameter(each.name, one.truth.kind)
    for name, (low, high) in one.said.intervals.get(each.name, {}).items():
        if stem and name.startswith(stem) and isfinite(each.value):
            value = one.said.values[each.name][name]
            found.append(low <= each.value <= high or abs(value - each.value) <= NEAR * abs(each.value))
    return found


def coverage(hits: Sequence[bool]) -> list[Figure]:
    """Share of the 90 % intervals that hold the truth: within two bounds."""
    name = "coverage of 90 % intervals, at "
    return [share(f"{name}least", hits, 0.80, 0.87, False),
            share(f"{name}most", hits, 0.95, 0.93, True)]  # fmt: skip


def rightly(one: Scored) -> bool:
    """Named, and nothing spurious beside it."""
    return one.all_named and one.spurious == 0


def holds_truth(one: Scored) -> bool:
    return set(one.truth.names) <= one.said.reported

"""Where a rate comes from: the same share by design, noise, size, signal and hidden cause."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt

from benchmarks.gap.scoring.dominant import GROUP, dominant_named, wrong_beside
from benchmarks.gap.scoring.scorer import Scored, clopper_pearson, falsely_named, rightly

ROWS = {"60 to 200": 200.0, "200 to 700": 700.0, "700 to 2400": inf}
SNRS = {"0.2 to 0.5": 0.5, "0.5 to 1.2": 1.2, "1.2 to 3": inf}
"""Levels of rows and of signal to noise, and where each ends."""

By = Callable[[Scored], str]


@dataclass(frozen=True)
class Level:
    """A share with its 95 % interval among the records of one level."""

    by: str
    level: str
    hits: int
    count: int

    @property
    def value(self) -> float:
        return self.hits / self.count

    @property
    def interval(self) -> tuple[float, float]:
        return clopper_pearson(self.hits, self.count)


@dataclass(frozen=True)
class Miss:
    """What was said instead of a hidden cause, and in which records (group, number)."""

    hidden: tuple[str, ...]
    said: str
    records: tuple[tuple[str, int], ...]


def signal_to_noise(one: Scored) -> float:
    """Rms of what recalibration cannot make of the first hidden effect, over the noise's."""
    return sqrt(one.told[0].strength / len(one.truth.free))


def within(value: float, ends: Mapping[str, float]) -> str:
    """The level that a value belongs to."""
    return next(level for level, end in ends.items() if value < end)


def design(one: Scored) -> str:
    return one.truth.poor or "independent inputs"


def noise(one: Scored) -> str:
    return one.truth.noise


def rows(one: Scored) -> str:
    return within(len(one.truth.points), ROWS)


def signal(one: Scored) -> str:
    return within(signal_to_noise(one), SNRS)


def hidden(one: Scored) -> str:
    return ", ".join(one.truth.names)


def kind(one: Scored) -> str:
    return one.truth.kind


SINGLE: Mapping[str, By] = {
    "design": design, "noise": noise, "rows": rows, "signal to noise": signal, "bench": kind,
    "hidden effect": hidden,
}  # fmt: skip


def levels(records: Sequence[Scored], name: str, by: By, hit: Callable[[Scored], bool]
           ) -> list[Level]:  # fmt: skip
    """The share of hits at every level that occurs, in the order of the levels' names."""
    found = sorted({by(one) for one in records}, key=_order)
    groups = [[one for one in records if by(one) == level] for level in found]
    return [Level(name, level, sum(map(hit, group)), len(group)) for level, group in zip(found, groups, strict=True)]


def _order(level: str) -> tuple[float, str]:
    """Numbers by their size, words by the alphabet."""
    first = level.split()[0]
    return (float(first) if first.replace(".", "", 1).isdigit() else 0.0, level)


def of_single(records: Sequence[Scored]) -> list[Level]:
    """The single-effect rate by all that varies."""
    single = [one for one in records if one.truth.group.split()[-1] in ("good", "poor")]
    return [
        level for name, by in SINGLE.items() for level in levels(single, name, by, rightly)
    ]  # fmt: skip


def of_group(records: Sequence[Scored], word: str) -> list[Scored]:
    return [one for one in records if one.truth.group.split()[-1] == word]


def missed(one: Scored) -> bool:
    """Whether a record counts against the namer."""
    if one.truth.group == GROUP:
        return not one.truth.turned and (wrong_beside(one) or not dominant_named(one))
    if one.truth.outside:
        return one.said.verdict != "unnamed"
    if not one.truth.hidden:
        return falsely_named(one)
    return not rightly(one)


def misses(records: Sequence[Scored]) -> list[Miss]:
    """The records that count against the namer, alike ones together, the most frequent first."""
    found = [one for one in records if missed(one)]
    alike = Counter((one.truth.names, answer(one)) for one in found)
    return [
        Miss(names, text, tuple(
            (one.truth.group, one.truth.number) for one in found
            if (one.truth.names, answer(one)) == (names, text)
        ))
        for (names, text), _ in sorted(alike.items(), key=lambda item: (-item[1], item[0]))
    ]  # fmt: skip


def answer(one: Scored) -> str:
    """The verdict with its names, those that may stand instead in brackets."""
    said = one.said
    others = f" [{', '.join(sorted(said.alternatives))}]" if said.alternatives else ""
    return f"{said.verdict} {', '.join(said.names)}{others}".strip()

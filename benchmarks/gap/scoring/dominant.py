"""What records with a dominant effect must come out with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

from benchmarks.gap.scoring.scorer import Figure, Scored, coverage, covered, share
from benchmarks.gap.scoring.told import UNTOLD
from benchmarks.gap.scoring.true_names import true_error

GROUP = "dominant"
OF_ORDER_ONE = {"encoder_harmonics", "output_eccentricity"}
SIGN = "sign"
"""What the first note speaks of where the sign of an output is turned."""


def upright(records: Sequence[Scored]) -> list[Scored]:
    """The records of the group whose output is not turned."""
    return [one for one in records if one.truth.group == GROUP and not one.truth.turned]


def turned(records: Sequence[Scored]) -> list[Scored]:
    """Those whose output is."""
    return [one for one in records if one.truth.group == GROUP and one.truth.turned]


def exact(one: Scored) -> bool:
    """Whether every hidden effect is one of the library, and has its form as far as it can be seen:
    a mechanism is more than its formula, and at a hundred noise levels the rest of it stands out.
    """
    return not one.truth.outside and all(each.left < UNTOLD for each in one.told)


def dominant_named(one: Scored) -> bool:
    return one.said.named and any(name in one.told[0].names for name in one.said.names)


def wrong_beside(one: Scored) -> bool:
    """A name that is none of the hidden effects', nor told from one, in an answer without a
    rest.
    """
    wrong = [name for name in one.said.names if name not in one.allowed]
    return one.said.verdict in ("named", "ambiguous") and bool(wrong)


def small_named(one: Scored) -> list[bool]:
    """Whether each smaller effect of the library is named."""
    inside = one.told[1 : len(one.told) - int(one.truth.outside)]
    return [any(name in each.names for name in one.said.names) for each in inside]


def rest_admitted(one: Scored) -> bool:
    """Whether a part outside of the library is said to have no name."""
    return one.said.verdict in ("partial", "unnamed") and dominant_named(one)


def of_first(one: Scored) -> list[bool]:
    """Whether the interval of the dominant effect's first number covers it; none where another
    hidden effect has the same wave, and only their sum can be known.
    """
    return [] if set(one.truth.names) >= OF_ORDER_ONE else covered(one, one.told[:1])


def worse(one: Scored) -> bool:
    """Whether rows that the fit never saw are predicted worse than by the model as recalibrated."""
    return one.said.after > one.said.before * (1.0 + 1e-9)


def dominant_figures(records: Sequence[Scored], best: Mapping[int, float] | None = None) -> list[Figure]:
    """Every figure of the group; `best` is the least held-out error of the baselines, by record."""
    of, known = upright(records), best or {}
    every = [*of, *turned(records)]
    ratios = [
        one.said.after / min(known[one.truth.number], one.said.before)
        for one in every
        if one.truth.number in known and isfinite(one.said.after)
    ]
    outside = [one for one in of if one.truth.outside]
    inside = [one for one in of if exact(one)]

    def within(limit: float) -> list[bool]:
        return [one <= limit for one in ratios]

    return [
        share("held-out error above the recalibrated model's", [worse(one) for one in every], 0.0,
              0.0, True),
        share("dominant effect named", [dominant_named(one) for one in of], 0.95, 0.99, False),
        share("smaller effects named", [hit for one in of for hit in small_named(one)], 0.0, 0.0,
              False),
        share("a wrong name beside it, named or ambiguous", [wrong_beside(one) for one in of], 0.05,
              0.02, True),
        *coverage([hit for one in of for hit in of_first(one)]),
        share("part outside: said to be there", [rest_admitted(one) for one in outside], 0.85, 0.95,
              False),
        share("nothing outside: partial or unnamed",
              [one.said.verdict in ("partial", "unnamed") for one in inside], 0.15, 0.05, True),
        share("held-out error within 1.05 of the best rival's", within(1.05), 0.95,
              0.95, False),
        share("held-out error within 1.02 of the best rival's", within(1.02), 0.0,
              0.95, False),
        share("part outside: held-out error within 1.05 of the true names'",
              [one.said.after <= 1.05 * min(true_error(GROUP, one.truth.number), one.said.before)
               for one in outside], 0.95, 0.95, False),
        share("a turned sign is the first note", [one.said.sign for one in turned(records)], 0.0,
              0.95, False),
    ]  # fmt: skip


def best_of(answers: Mapping[str, Sequence[Scored]], but: str) -> dict[int, float]:
    """The least held-out error that other namers state of each record of the group."""
    found: dict[int, float] = {}
    for name, records in answers.items():
        for one in records if name != but else ():
            if one.truth.group == GROUP and isfinite(one.said.after):
                number = one.truth.number
                found[number] = min(found.get(number, one.said.after), one.said.after)
    return found

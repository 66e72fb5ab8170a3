"""One record through the namers, as lines that can be kept, and lines as scored records."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from importlib import import_module
from math import inf
from typing import Any

from benchmarks.gap.generator.records import record
from benchmarks.gap.namers.baselines import BASELINES, Namer
from benchmarks.gap.namers.workflow import SIMULATORS, analysed
from benchmarks.gap.scoring.scorer import Figure, Scored, verdict
from benchmarks.gap.scoring.told import Told, told

WORKFLOW = "tolevo"
NAMERS: Mapping[str, Namer] = {WORKFLOW: analysed, **BASELINES}


def namer_of(name: str) -> Namer:
    """A namer of the table, or one of somebody's own as `module:function`.

    Raises ValueError where there is none.
    """
    if name in NAMERS:
        return NAMERS[name]
    module, _, function = name.partition(":")
    try:
        found: Namer = getattr(import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        names = ", ".join(NAMERS)
        raise ValueError(f"namer {name!r}: give module:function or one of {names}") from error
    return found


def lines(namers: Sequence[str], group: str, number: int) -> list[dict[str, Any]]:
    """What each namer says of a record, and what the record can tell, as JSON takes it."""
    found, truth = record(group, number, SIMULATORS)
    told_of = [_kept(told(truth, one)) for one in truth.hidden]
    answers = []
    for name in namers:
        start = time.process_time()
        said = dict(namer_of(name)(found))
        seconds = time.process_time() - start
        answers.append({
            "namer": name, "group": group, "number": number, "seconds": seconds,
            "said": kept_of(said), "told": told_of,
        })  # fmt: skip
    return answers


def kept_of(said: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a `gap.json` that is scored."""
    names = ("verdict", "effects", "alternatives", "gap_after", "noise_floor", "where", "unnamed",
             "gap_before", "notes")  # fmt: skip
    return {name: said[name] for name in names if name in said}


def _kept(one: Told) -> dict[str, Any]:
    names = {"names": sorted(one.names), "twins": sorted(one.twins)}
    return {"name": one.name, "strength": one.strength, "value": one.value, "left": one.left,
            **names}  # fmt: skip


def scored(one: Mapping[str, Any]) -> Scored:
    """The line with its truth beside it again."""
    _, truth = record(one["group"], one["number"], SIMULATORS)
    kept = tuple(
        Told(each["strength"], frozenset(each["names"]), frozenset(each["twins"]), each["name"],
             each["value"], each.get("left", inf))
        for each in one["told"]
    )  # fmt: skip
    return Scored(truth, kept, verdict(one["said"]))


def printed(figures: Sequence[Figure]) -> str:
    """The figures of one namer, a line each."""
    head = f"{'figure':45s} {'value':>7s} {'95 % interval':>17s} {'n':>5s} {'must':>8s} {'aim':>8s}"
    rows = [
        f"{one.name:45s} {one.value:7.3f} [{one.low:7.3f},{one.high:7.3f}] {one.count:5d} "
        f"{'<=' if one.at_most else '>='} {one.must:5.3f} {'<=' if one.at_most else '>='} "
        f"{one.aim:5.3f} {one.word}"
        for one in figures
        if one.count
    ]
    return "\n".join([head, *rows])

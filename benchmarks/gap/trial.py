"""One record through one namer, as a line that can be kept, and lines as figures."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks.gap.generator.records import Record, Truth, record
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.namers.workflow import SIMULATORS, analysed
from benchmarks.gap.scoring.scorer import Figure, Scored, Told, told, verdict

Namer = Callable[[Record, Truth], Mapping[str, Any]]
WORKFLOW = "tolevo"


def through_workflow(found: Record, truth: Truth) -> Mapping[str, Any]:
    """What `tolevo gap` says; it is given the record alone."""
    return analysed(found)


NAMERS: dict[str, Namer] = {WORKFLOW: through_workflow, **BASELINES}


def line(namer: str, group: str, number: int) -> dict[str, Any]:
    """A record named and what it can tell, as JSON takes it."""
    found, truth = record(group, number, SIMULATORS)
    start = time.process_time()
    said = dict(NAMERS[namer](found, truth))
    seconds = time.process_time() - start
    return {
        "namer": namer, "group": group, "number": number, "seconds": seconds, "said": kept_of(said),
        "told": [_kept(told(truth, one)) for one in truth.hidden],
    }  # fmt: skip


def kept_of(said: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a `gap.json` that is scored."""
    names = ("verdict", "effects", "alternatives", "gap_after", "noise_floor", "where", "unnamed")
    return {name: said[name] for name in names if name in said}


def _kept(one: Told) -> dict[str, Any]:
    names = {"names": sorted(one.names), "twins": sorted(one.twins)}
    return {"name": one.name, "strength": one.strength, "value": one.value, **names}


def scored(one: Mapping[str, Any]) -> Scored:
    """The line with its truth beside it again."""
    _, truth = record(one["group"], one["number"], SIMULATORS)
    kept = tuple(
        Told(each["strength"], frozenset(each["names"]), frozenset(each["twins"]), each["name"],
             each["value"])
        for each in one["told"]
    )  # fmt: skip
    return Scored(truth, kept, verdict(one["said"]))


def printed(figures: Sequence[Figure]) -> str:
    """The table, one line per figure."""
    head = f"{'figure':45s} {'value':>7s} {'95 % interval':>17s} {'n':>5s} {'must':>8s} {'aim':>8s}"
    rows = [
        f"{one.name:45s} {one.value:7.3f} [{one.low:7.3f},{one.high:7.3f}] {one.count:5d} "
        f"{'<=' if one.at_most else '>='} {one.must:5.3f} {'<=' if one.at_most else '>='} "
        f"{one.aim:5.3f} {'met' if one.met else 'MISSED'}"
        for one in figures
    ]
    return "\n".join([head, *rows])

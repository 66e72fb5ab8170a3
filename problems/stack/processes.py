"""The processes that make a part: the tolerances that they hold, and their samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Array, Integers
from ...models.capability import PartSample
from ...models.machines import offers
from .definition import Part


def out_of_process(part: Part, t: Array, chosen: Integers) -> dict[int, str]:
    """Messages by row where tolerances (n,) of a part do not suit the processes (n,) chosen."""
    processes = [part.processes[number] for number in chosen] if part.alternatives else []
    return {
        row: f"process {process.name} holds {process.low:g} to {process.high:g} {part.unit}, got {t[row]:g}"
        for row, process in enumerate(processes)
        if not process.low <= t[row] <= process.high
    }


def corner_of(parts: Sequence[Part], names: Sequence[str], tight: bool) -> Array:
    """The design (all variables,) with every tolerance at an end, and a process for it."""
    design = np.zeros(len(names))
    for part in parts:
        ends = [p.low if tight else -p.high for p in part.processes]
        at = int(np.argmin(ends))
        design[names.index(f"{part.name}_t")] = abs(ends[at])
        if part.alternatives:
            design[names.index(f"{part.name}_process")] = at
    return design


def samples_of(parts: Sequence[Part]) -> tuple[tuple[str, str, PartSample], ...]:
    """Name, unit and measured parts of every part and machine that has some."""
    samples: list[tuple[str, str, PartSample]] = []
    for part in parts:
        samples += [] if part.sample is None else [(part.name, part.unit, part.sample)]
        samples += [
            (f"{part.name}, machine {machine}", part.unit, sample)
            for machine, sample in offers.samples_of(part.machines)
        ]
    return tuple(samples)

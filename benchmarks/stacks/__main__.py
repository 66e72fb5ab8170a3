"""`python -m benchmarks.stacks`: bounds of random stacks beside the best known costs.

No bound may lie above the best known cost; with even, log-concave deviations and yields that are
centred or one-sided the gap is to be 0.1 % at most.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

from ..kept import keep, kept
from ..outcome import verdict
from .drawn import Drawn, run

PROMISED = 0.1
"""Gap [percent] where the conditions hold."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw stacks, solve them, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of the first stack")
    parser.add_argument("--count", type=int, default=300, help="number of stacks")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--kept", type=Path, default=Path(gettempdir(), "tolevo_stacks.jsonl"),
                        help="file of results, by which an interrupted run goes on")  # fmt: skip
    given = parser.parse_args(arguments)
    seeds = range(given.seed, given.seed + given.count)
    known = {one.seed: one for one in read(given.kept)}
    missing = [seed for seed in seeds if seed not in known]
    for done, one in enumerate(results(missing, given.workers), 1):
        known[one.seed] = one
        keep(given.kept, asdict(one))
        print(f"\r{done} of {len(missing)}", end="", flush=True)
    found = [known[seed] for seed in seeds]
    none = sum(not one.found for one in found)
    seconds = sum(one.seconds for one in found)
    print(f"\nSeeds {given.seed} to {seeds[-1]}; {none} stacks are left out, whose limits no "
          f"design was found to keep; {seconds:.0f} s of CPU.\n\n"
          f"{table([one for one in found if one.found])}")  # fmt: skip


def results(seeds: Sequence[int], workers: int) -> Iterator[Drawn]:
    """The stacks of some seeds, one after the other."""
    if workers == 1:
        yield from map(run, seeds)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(run, seeds)


def read(path: Path) -> list[Drawn]:
    """Results that are kept."""
    rows: list[Any] = list(kept(path))
    return [Drawn(**row | {"limits": tuple(row["limits"])}) for row in rows]


def table(found: Sequence[Drawn]) -> str:
    """A row for each kind of stack."""
    kinds = {
        "even deviations, yields centred or one-sided": [one for one in found if one.exact],
        "of these with processes": [one for one in found if one.exact and one.ways],
        "even deviations, a yield off the middle": [o for o in found if o.even and not o.exact],
        "a skewed deviation": [one for one in found if not one.even],
        "all": list(found),
    }
    lines = ["| stacks | number | bounds above the best known cost | gap of `exact`, median "
             "| largest |\n|---|---:|---:|---:|---:|"]  # fmt: skip
    for name, own in kinds.items():
        if own:
            gap = np.array([one.gap for one in own])
            lines.append(f"| {name} | {len(own)} | {sum(not one.sound for one in own)} "
                         f"| {np.median(gap):.2g} % | {gap.max():.2g} % |")  # fmt: skip
    worst = max((one.gap for one in found if one.exact), default=0.0)
    kept = worst <= PROMISED and all(one.sound for one in found)
    return "\n".join([*lines, "", f"Promised: none above, {PROMISED} % in the first row: {verdict(kept)}."])


if __name__ == "__main__":
    main()

"""`python -m benchmarks.stacks`: bounds of random stacks beside the best known costs.

No bound may lie above the best known cost; with even, log-concave deviations and yields that are
centred or one-sided the gap is to be 0.1 % at most.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from .drawn import Drawn, run

PROMISED = 0.1
"""Gap [percent] where the conditions hold."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw stacks, solve them, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of the first stack")
    parser.add_argument("--count", type=int, default=300, help="stacks with a design that is found")
    given = parser.parse_args(arguments)
    found: list[Drawn] = []
    seed, start = given.seed, time.process_time()
    while len(found) < given.count:
        one = run(seed)
        seed += 1
        if one is not None:
            found.append(one)
        if len(found) % 10 == 0:
            print(f"{len(found)} of {given.count}, {time.process_time() - start:.0f} s of CPU",
                  flush=True)  # fmt: skip
    print(f"\nSeeds {given.seed} to {seed - 1}; {seed - given.seed - len(found)} stacks whose "
          f"limits no design was found to keep are left out; "
          f"{time.process_time() - start:.0f} s of CPU.\n\n{table(found)}")  # fmt: skip


def table(found: Sequence[Drawn]) -> str:
    """A row for each kind of stack."""
    kinds = {
        "even deviations, yields centred or one-sided": [one for one in found if one.exact],
        "of these with processes": [one for one in found if one.exact and one.ways],
        "even deviations, a yield off the middle": [o for o in found if o.even and not o.exact],
        "a skewed deviation": [one for one in found if not one.even],
        "all": list(found),
    }
    lines = ["| stacks | number | bounds above the best known cost | gap of `exact`, median | largest |",
             "|---|---:|---:|---:|---:|"]  # fmt: skip
    for name, own in kinds.items():
        if own:
            gap = np.array([one.gap for one in own])
            lines.append(f"| {name} | {len(own)} | {sum(not one.sound for one in own)} "
                         f"| {np.median(gap):.2g} % | {gap.max():.2g} % |")  # fmt: skip
    worst = max((one.gap for one in found if one.exact), default=0.0)
    verdict = "met" if worst <= PROMISED and all(one.sound for one in found) else "MISSED"
    return "\n".join([*lines, "", f"Promised: none above, {PROMISED} % in the first row: {verdict}."])


if __name__ == "__main__":
    main()

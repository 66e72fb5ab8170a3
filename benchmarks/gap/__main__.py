# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""The hidden-effect trial at its full size: `python -m benchmarks.gap --records 100`.

Every record is named and scored once and kept in a file of lines, so that a broken run goes on
where it was; another code needs another file. Prints each figure with its interval.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.gap.generator.records import BENCH_GROUPS, GROUPS
from benchmarks.gap.scoring.scorer import Scored, figures
from benchmarks.gap.trial import NAMERS, WORKFLOW, line, printed, scored

Key = tuple[str, str, int]


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=30, help="of each group")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--groups", nargs="*", default=list(BENCH_GROUPS), choices=list(GROUPS))
    parser.add_argument("--namers", nargs="*", default=[WORKFLOW], choices=list(NAMERS))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("runs/gap_benchmark.jsonl"))
    parser.add_argument(
        "--misses", action="store_true", help="print the records that count against"
    )
    return parser.parse_args()


def key(one: dict[str, Any]) -> Key:
    return one["namer"], one["group"], one["number"]


def kept(path: Path) -> dict[Key, dict[str, Any]]:
    """The lines that are there; a last one that was cut off is left out."""
    found: dict[Key, dict[str, Any]] = {}
    if path.exists():
        for text in path.read_text(encoding="utf-8").splitlines():
            try:
                one = json.loads(text)
            except json.JSONDecodeError:
                continue
            found[key(one)] = one
    return found


def run(todo: Iterable[Key], path: Path, workers: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with (
        ProcessPoolExecutor(workers) as pool,
        path.open("a", encoding="utf-8", buffering=1) as file,
    ):
        for done in as_completed([pool.submit(line, *one) for one in todo]):
            file.write(json.dumps(done.result()) + "\n")


def missed(one: Scored) -> bool:
    """Whether a record counts against the namer."""
    if one.truth.outside:
        return one.said.verdict != "unnamed"
    if not one.truth.hidden:
        return one.said.named
    return not one.all_named or one.spurious > 0


def described(one: Scored) -> str:
    truth, said = one.truth, one.said
    told = "; ".join(f"lambda {each.strength:.0f} {sorted(each.names)}" for each in one.told)
    return (
        f"{truth.group} {truth.number} {truth.kind} n {len(truth.points)} {truth.noise} "
        f"{truth.poor or ''} {truth.names} [{told}] -> {said.verdict} {said.names} "
        f"{sorted(said.alternatives)}"
    )


def main() -> None:
    given = arguments()
    numbers = range(given.first, given.first + given.records)
    wanted = [(n, g, k) for n in given.namers for k in numbers for g in given.groups]
    there = kept(given.out)
    run([one for one in wanted if one not in there], given.out, given.workers)
    there = kept(given.out)
    for namer in given.namers:
        lines = [there[one] for one in wanted if one[0] == namer]
        found = [scored(one) for one in lines]
        seconds = [one["seconds"] for one in lines]
        print(f"\n{namer}: {len(lines)} records, CPU s per record median "
              f"{np.median(seconds):.2f}, largest {max(seconds):.1f}")  # fmt: skip
        print(printed(figures(found)))
        if given.misses:
            print("\n".join(described(one) for one in found if missed(one)))


if __name__ == "__main__":
    main()

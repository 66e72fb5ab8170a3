# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""The benchmark of naming at its full size: `python -m benchmarks.gap`.

Every record is shown to every namer and scored once. The answers are kept in a file of lines, so
that a broken run goes on where it was; those of other code are asked anew. Prints each figure with
its interval.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import shlex
import sys
import time
from collections.abc import Sequence
from itertools import compress
from pathlib import Path

from benchmarks.gap.answers import Asked, Key, as_text, kept, missing
from benchmarks.gap.asked import asked, count
from benchmarks.gap.generator.records import BENCH_GROUPS, GROUPS
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.page import (
    MEASURED,
    NEWER,
    NEWER_GROUPS,
    details,
    families,
    newer_page,
    page,
    parts_of,
    repeatable,
    written,
)
from benchmarks.gap.scoring.scorer import figures
from benchmarks.gap.trial import NAMERS, lines, namer_of, printed, scored

SIZES = {"good": 150, "poor": 150, "pair": 80, "clean": 300, "size": 60, "delay": 60,
         "outside": 100, "dominant": 200, "approximate": 100, "rows": 30, "memory": 70, "plays": 10,
         "manipulator good": 12, "manipulator poor": 12, "manipulator clean": 12,
         "manipulator outside": 12, "uneven good": 100, "late good": 40}  # fmt: skip
OF_MODELS = 20
"""Records of each group, and of one that is not listed; one of poses takes ten times as long."""
FIRST = 10_000
"""Lower numbers may have been looked at while the workflow was made."""
MINUTE = 60.0


def _size(text: str) -> tuple[str, int]:
    """`GROUP=COUNT` as both."""
    group, _, number = text.partition("=")
    if group not in GROUPS:
        raise argparse.ArgumentTypeError(f"no group {group!r}")
    return group, count(number)


def arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=count, help="of each group; otherwise as many as the page")
    parser.add_argument("--at-most", type=count, help="of each group, fewer than the page has")
    parser.add_argument("--of", nargs="*", default=[], metavar="GROUP=COUNT", type=_size,
                        help="records of a group, whatever the other options say")  # fmt: skip
    parser.add_argument("--first", type=int, default=FIRST, help="number of the first one")
    parser.add_argument("--groups", nargs="*", default=list(GROUPS), choices=list(GROUPS))
    parser.add_argument("--namers", nargs="*", default=list(NAMERS),
                        help=f"of {', '.join(NAMERS)}; or your own, module:function")  # fmt: skip
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("runs/gap_benchmark.jsonl"))
    parser.add_argument("--write", type=Path, help="put the tables into this page")
    given = parser.parse_args(argv)
    try:
        for name in given.namers:
            namer_of(name)
        for part in split(given.groups) if given.write else ():
            parts_of(given.write, part)
    except (ValueError, OSError) as error:
        parser.error(str(error))
    return given


def split(groups: Sequence[str]) -> dict[str, list[str]]:
    """The groups of each part of the page that has any."""
    newer = [name for name in groups if name in NEWER_GROUPS]
    rest = [name for name in groups if name not in NEWER_GROUPS]
    return {part: of for part, of in ((NEWER, newer), (MEASURED, rest)) if of}


def wanted(given: argparse.Namespace) -> list[Key]:
    """What is to be asked; the baselines read tables that hold their prediction."""
    sizes = {name: given.records or SIZES.get(name, OF_MODELS) for name in given.groups}
    sizes = {name: min(size, given.at_most or size) for name, size in sizes.items()}
    sizes |= {name: size for name, size in given.of if name in sizes}
    return [
        (namer, group, given.first + k)
        for group, size in sizes.items() for k in range(size) for namer in given.namers
        if group in BENCH_GROUPS or namer not in BASELINES
    ]  # fmt: skip


def ask(todo: Sequence[Asked], path: Path, workers: int) -> None:
    """Keeps each answer in the file, and says once a minute how far it is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    whole = not path.exists() or path.read_bytes()[-1:] in (b"", b"\n")
    start = said = time.monotonic()
    with path.open("a", encoding="utf-8", buffering=1) as file:
        file.write("" if whole else "\n")
        for done, found in enumerate(asked(lines, todo, workers), start=1):
            file.write(as_text(found))
            now = time.monotonic()
            if now - said >= MINUTE:
                said, passed = now, (now - start) / MINUTE
                rest = passed * (len(todo) - done) / done
                tell(f"{done} of {len(todo)} records, {passed:.0f} min; about {rest:.0f} more")


def tell(text: str) -> None:
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def main(argv: Sequence[str]) -> int:
    given = arguments(argv)
    keys = wanted(given)
    try:
        ask(missing(keys, kept(given.out)), given.out, given.workers)
    except KeyboardInterrupt:
        tell(f"stopped; {given.out} keeps what was answered, the same command goes on")
        return 130
    there = kept(given.out)
    by = {name: [there[one] for one in keys if one[0] == name] for name in given.namers}
    answers = {name: [scored(one) for one in found] for name, found in by.items() if found}
    command = shlex.join(["python", "-m", "benchmarks.gap", *repeatable(argv)])
    for part, groups in split(given.groups).items() if given.write else ():
        kinds = {name: [one["group"] in groups for one in by[name]] for name in answers}
        some = {name: list(compress(found, kinds[name])) for name, found in answers.items() if any(kinds[name])}
        seconds = {name: [float(one["seconds"]) for one in compress(by[name], kinds[name])] for name in some}
        tables = newer_page(some, command) if part == NEWER else page(some, seconds, command)
        written(given.write, tables, part)
    for name, found in answers.items():
        bench = [one for one in found if one.truth.group in BENCH_GROUPS]
        for family, own in ({"tables": bench} | families(found)).items():
            if own:
                head = f"{name}, {family}: {len(own)} records"
                sys.stdout.write(f"\n{head}\n{printed(figures(own))}\n")
    sys.stdout.write(f"\n{text}\n" if (text := details(answers)) else "")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

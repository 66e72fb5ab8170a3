# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""`python -m benchmarks.gap.elsewhere [--records 40] [--first 22000]`: the error in conditions that a record lacks.

The rows of a record fall into cells of two of its inputs, four levels of each. Those of every other cell, as on a
chessboard, are the record; the others are predicted: by `tolevo gap` and `tolevo simulate` as a user runs them, by the
baselines and by rivals of other packages where those are installed (`.venv-bench`), their numbers by least squares.
Readings of more than five standard deviations of the noise aside. Names are judged by what the whole record can tell.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

import tolevo
from benchmarks.gap.answers import code_of
from benchmarks.gap.asked import asked, count
from benchmarks.gap.generator.records import Record, Truth, record
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.namers.peers import PEERS, Peer
from benchmarks.gap.namers.plain_bic import selected
from benchmarks.gap.namers.seen import Marks, middle, seen
from benchmarks.gap.page import abbreviated, made_by, parts_of, repeatable, table, written
from benchmarks.gap.scoring.held_out import FAR, fitted, predicted
from benchmarks.gap.scoring.scorer import verdict
from benchmarks.gap.scoring.told import told
from benchmarks.gap.trial import WORKFLOW
from benchmarks.kept import keep, kept

FROM = ("dominant", "approximate", "outside")
"""Groups whose records are cut: an effect and others beside it, a form that is off, a cause without a name."""
LEVELS = 4
CONDITIONS = ("torque_Nm", "output_speed_rpm", "temperature_C")
MOST = {"median": 1.05, "95 %": 1.3}
"""Error over that of plain BIC at most, in the median and in 95 % of the records."""
BIC, NOTHING, SLOW = "plain BIC", "no effect", "ADCD"
BETTER = 1.05
"""Ratio of errors from which a record counts as lost."""
MARK = "elsewhere"
"""The part of the page that the table is written to."""


class Said(NamedTuple):
    """What a method says of a record: names, and the output (n,) of all rows."""

    names: tuple[str, ...]
    output: Array


def in_record(found: Record, rng: np.random.Generator) -> Marks:
    """Which rows (n,) are the record: every other cell of two inputs."""
    given = [name for name in CONDITIONS if name in found.table]
    cells = np.zeros(len(found.table), dtype=np.int64)
    for name in rng.choice(given, 2, replace=False).tolist():
        values = found.table[name].to_numpy()
        cells += np.searchsorted(np.quantile(values, np.arange(1, LEVELS) / LEVELS), values)
    return np.asarray(cells % 2 == int(rng.integers(2)))


def by_tolevo(found: Record, rows: Marks) -> Said:
    """The output as the corrected configuration of some rows predicts it of all of them."""
    with TemporaryDirectory() as place:
        configuration = Path(place, "gap.toml")
        configuration.write_text(found.configuration, encoding="utf-8")
        tolevo.gap(configuration, found.table[rows], out=Path(place, "out"))
        told_of = verdict(json.loads(Path(place, "out", "gap.json").read_text(encoding="utf-8")))
        said = tolevo.simulate(Path(place, "out", "corrected.toml"), found.table)
    return Said(told_of.names, said[output_of(found)].to_numpy(dtype=np.float64))


def by_plain_bic(found: Record, rows: Marks) -> Said:
    """The same of the names that plain BIC selects in these rows, all numbers fitted to them."""
    whole, at = seen(found), np.flatnonzero(rows)
    named = selected(seen(replace(found, table=found.table[rows])))
    columns = fitted(named, whole.points, whole.free, whole.left, at)
    return Said(tuple(rival.name for rival, _ in named), simulated(found) + predicted(columns, whole.left, at))


def by_baseline(name: str, found: Record, rows: Marks) -> Said:
    """The same of a baseline that fits no nonlinear number: they stay in the middle of their ranges."""
    names = [one["name"] for one in BASELINES[name](replace(found, table=found.table[rows]))["effects"]]
    whole = seen(found)
    blocks = [one.columns(whole.points, middle(one)) for one in whole.rivals if one.name in names]
    return _by_columns(found, rows, names, np.hstack([np.zeros((len(whole), 0)), *blocks]))


def _by_columns(found: Record, rows: Marks, names: Sequence[str], columns: Array) -> Said:
    whole = seen(found)
    change = predicted(np.hstack([whole.free, columns]), whole.left, np.flatnonzero(rows))
    return Said(tuple(names), simulated(found) + change)


def by_peer(peer: Peer, found: Record, rows: Marks) -> Said:
    """The same of a rival of another package."""
    return _by_columns(found, rows, *peer(found, rows))


def recalibrated(found: Record, rows: Marks) -> Said:
    """The simulation, its zero by the median of these rows."""
    away = found.table[output_of(found)].to_numpy(dtype=np.float64) - simulated(found)
    return Said((), simulated(found) + np.median(away[rows]))


METHODS: Mapping[str, Callable[[Record, Marks], Said]] = {
    WORKFLOW: by_tolevo,
    BIC: by_plain_bic,
    "LassoCV": partial(by_baseline, "LassoCV"),
    **{name: partial(by_peer, peer) for name, peer in PEERS.items()},
    NOTHING: recalibrated,
}


def output_of(found: Record) -> str:
    return next(name for name in map(str, found.table) if f"{name}_predicted" in found.table)


def simulated(found: Record) -> Array:
    return found.table[f"{output_of(found)}_predicted"].to_numpy(dtype=np.float64)


def question(methods: Sequence[str], group: str, number: int) -> dict[str, Any]:
    """Of each method the error elsewhere [noise], the hidden effects of the library that it names, and the names that
    are none of the record's.
    """
    found, truth = record(group, number)
    found = replace(found, table=found.table.reset_index(drop=True))
    rows = in_record(found, np.random.default_rng([number, len(found.table)]))
    measured = found.table[output_of(found)].to_numpy(dtype=np.float64)
    judged = ~rows & _is_quiet(truth, found, measured)
    each = [told(truth, one) for one in truth.hidden]
    inside = each[: len(each) - truth.outside]
    allowed = {name for one in truth.hidden for name in one.beside}.union(*(one.names for one in each))
    answer: dict[str, Any] = {"group": group, "number": number, "hidden": len(inside), "said": {}}
    for name in methods:
        said = METHODS[name](found, rows)
        answer["said"][name] = {
            "error": float(np.sqrt(np.mean((measured - said.output)[judged] ** 2))) / truth.noise_rms,
            "right": sum(bool(one.names & {*said.names}) for one in inside),
            "wrong": len({*said.names} - allowed),
        }
    return answer


def _is_quiet(truth: Truth, found: Record, measured: Array) -> Marks:
    """Rows (n,) whose noise is no outlier."""
    sign = -1.0 if truth.turned else 1.0
    noise = measured - simulated(found) - sign * sum(one.added for one in truth.hidden)
    return np.asarray(np.abs(noise - np.median(noise)) < FAR * truth.sigma)


Answers = Sequence[Mapping[str, Any]]


def errors_of(found: Answers, name: str) -> Array:
    return np.array([one["said"][name]["error"] for one in found])


def lost(found: Answers, name: str) -> list[str]:
    """The records whose other conditions a rival predicts better than `tolevo`, by more than 5 %."""
    both = [one for one in found if name in one["said"]]
    worse = errors_of(both, WORKFLOW) > BETTER * errors_of(both, name)
    return [f"{one['group']} {one['number']}" for one, is_lost in zip(both, worse, strict=True) if is_lost]


def tables(found: Answers) -> list[str]:
    """Every method, what `tolevo` loses to it first: its names and its error over that of plain BIC, by groups; then
    the records that are lost.
    """
    lines, losses = [], []
    for name in dict.fromkeys(name for one in found for name in one["said"]):
        of = [one for one in found if name in one["said"]]
        own, places = [one["said"][name] for one in of], lost(of, name)
        ratio = errors_of(of, name) / errors_of(of, BIC)
        groups = [ratio[[one["group"] == group for one in of]] for group in FROM]
        lines.append([
            name, f"{'-' if name == WORKFLOW else len(places)} of {len(of)}",
            f"{sum(one['right'] for one in own)} of {sum(one['hidden'] for one in of)}",
            str(sum(one["wrong"] for one in own)), f"{np.median(ratio):.3f}", f"{np.quantile(ratio, 0.95):.3f}",
            *(f"{np.median(part):.3f}" if len(part) else "-" for part in groups),
            f"{np.median(errors_of(of, name)):.3f}",
        ])  # fmt: skip
        losses += [f"{name} is better in {abbreviated(places)}."] if places else []
    head = ["error over plain BIC's", f"{100 * (BETTER - 1):.0f} % better than tolevo", "effects named", "wrong names",
            "median", "95 %", *FROM, "over the noise"]  # fmt: skip
    return [table(head, lines), *losses]


def main(argv: Sequence[str]) -> int:
    """Exit status 1 where a figure is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=count, default=40, help="of each group")
    parser.add_argument("--slow", type=count, default=4, help=f"of each group for {SLOW}, which takes 20 s")
    parser.add_argument("--first", type=int, default=22_000, help="number of the first one")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("runs/gap_elsewhere.jsonl"))
    parser.add_argument("--write", type=Path, help="put the tables into this page")
    given = parser.parse_args(argv)
    if given.write:
        parts_of(given.write, MARK)
    code = f"{code_of(WORKFLOW)} {code_of(BIC)} {sha256(Path(__file__).read_bytes()).hexdigest()[:12]}"
    there = {(one["group"], one["number"]): one for one in kept(given.out) if one["code"] == code}
    wanted = [(group, given.first + k) for k in range(given.records) for group in FROM]
    of = {key: [name for name in METHODS if name != SLOW or key[1] < given.first + given.slow] for key in wanted}
    todo = [(of[key], *key) for key in wanted if key not in there or not {*of[key]} <= {*there[key]["said"]}]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    for answer in asked(question, todo, given.workers):
        keep(given.out, {**answer, "code": code})
        there[answer["group"], answer["number"]] = answer
    found = [there[one] for one in wanted]
    parts = tables(found)
    print("\n\n".join(parts))
    if given.write:
        missing = [name for name in ("PySINDy", SLOW) if name not in PEERS]
        absent = f" Not installed: {', '.join(missing)}." if missing else ""
        command = shlex.join(["python", "-m", "benchmarks.gap.elsewhere", *repeatable(argv)])
        written(given.write, "\n\n".join([made_by(command, absent), *parts]), MARK)
    ratio = errors_of(found, WORKFLOW) / errors_of(found, BIC)
    median, most = np.quantile(ratio, [0.5, 0.95])
    return int(median > MOST["median"] or most > MOST["95 %"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

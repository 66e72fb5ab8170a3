"""What holds of every answer, whatever hides: `python -m benchmarks.gap.invariants`.

Asks the records of the benchmark of naming and prints the answers that break one of the
invariants below. They are tested on the final answer, numbers from all rows, by the numbers that it
was chosen with; what is kept in the file is not asked again by the same code.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import f as f_distribution
from threadpoolctl import threadpool_limits

from benchmarks.gap.answers import code_of
from benchmarks.gap.asked import asked, count
from benchmarks.gap.generator.records import GROUPS, record
from benchmarks.gap.namers.workflow import SIMULATORS, read_as_files
from benchmarks.gap.trial import WORKFLOW
from benchmarks.kept import keep, kept
from tolevo.commands.gap.blocks import HeldOut
from tolevo.commands.gap.ending_records import gaps
from tolevo.commands.gap.gap import ending, lines_of, result_of
from tolevo.commands.gap.result import Ending

RECALIBRATED = "held-out error above that of the model as recalibrated"
STEP = "held-out error above that of an accepted step by more than its standard error"
NOTHING = "an effect whose joint interval holds 0"
BOUND = "a number at its bound that is not said"
UNKNOWN = "an effect of which every interval holds 0"
CANCELS = "an effect that contributes more than 3 times what it takes away"
WITHIN = "a gap within the noise floor that is not `no_gap`"


def broken(group: str, number: int) -> list[str]:
    """The invariants that do not hold of the answer to a record, each with what breaks it."""
    with TemporaryDirectory() as folder, threadpool_limits(1):
        plan, data = read_as_files(record(group, number, SIMULATORS)[0], Path(folder))
        end = ending(plan, data)
        return violated(end, "\n".join(lines_of(result_of(plan, data, end))))


def violated(end: Ending, said: str) -> list[str]:
    """The invariants that do not hold of an answer, of which the terminal says `said`."""
    rows = [*_unknown(end), *_cancels(end), *_within_floor(end)] if end.rows else []
    return [*_predicts_worse(end), *_may_be_nothing(end), *_silent_bounds(end, said), *rows]


def _predicts_worse(end: Ending) -> Iterator[str]:
    """Of rows; what the answer to a batch is chosen by is a likelihood."""
    if not end.rows:
        return
    labels = end.analysis.search.labels
    answer = _squares(end.after, labels)
    for at, (_, step) in enumerate(end.analysis.selection.accepted):
        difference = answer - _squares(step, labels)
        error = float(np.std(difference, ddof=1) * np.sqrt(len(difference)))
        worse = float(np.sum(difference))
        if at == 0 and worse > 1e-9 * float(np.sum(answer)):
            yield f"{RECALIBRATED}: by {worse:.4g}"
        if at > 0 and worse > error:
            yield f"{STEP}: step {at}, by {worse:.4g}, its standard error {error:.4g}"


def _squares(tested: HeldOut, labels: np.ndarray) -> np.ndarray:
    """Held-out squares in each block (b,)."""
    return np.bincount(labels, tested.white**2)


def _may_be_nothing(end: Ending) -> Iterator[str]:
    """Wald's test of the linear numbers of each effect, its nonlinear ones held, from the whole
    covariance.
    """
    model = end.model
    for member in (end.fit.members[at] for at in end.identified):
        linear = {one.name for one in member.candidate.linear}
        at = [k for k, one in enumerate(model.numbers)
              if one.owner == member.name and one.name in linear]  # fmt: skip
        if not np.isfinite(model.errors[at]).all():
            continue  # it was found without derivatives
        sure = [k for k in at if model.errors[k] == 0.0 and model.values[k] != 0.0]
        free = [k for k in at if model.errors[k] > 0.0]
        if sure or not free:
            continue  # it stands at a bound that is not 0
        shape = [k for k, one in enumerate(model.numbers)
                 if one.owner == member.name and k not in at and model.errors[k] > 0.0]  # fmt: skip
        own, size = [*free, *shape], len(free)
        alike = model.covariance[np.ix_(own, own)] / np.outer(model.errors[own], model.errors[own])
        a, b = alike[:size, :size], alike[:size, size:]
        held = a - b @ np.linalg.lstsq(alike[size:, size:], b.T, rcond=1e-12)[0]
        ratio = model.values[free] / model.errors[free]
        statistic = float(ratio @ np.linalg.lstsq(held, ratio, rcond=1e-12)[0]) / size
        limit = f_distribution.ppf(end.setup.plan.settings.interval, len(free), model.freedom)
        if statistic < limit:
            yield f"{NOTHING}: {member.name}, F {statistic:.3g} below {limit:.3g}"


def _silent_bounds(end: Ending, said: str) -> Iterator[str]:
    """Numbers of effects at an end of what their library allows; a single number at 0 is none."""
    for member in (end.fit.members[at] for at in end.identified):
        values, several = end.model.effect(member.name), len(end.model.effect(member.name)) > 1
        for one in (*member.candidate.linear, *member.candidate.shape):
            value = values.get(one.name)
            ends = [x for x in (one.low, one.high) if np.isfinite(x) and (x != 0.0 or several)]
            if value is None or one.choices or not np.isclose(ends, value, rtol=1e-7, atol=0).any():
                continue
            if f"at its physical bound: {one.name} of {member.name}" not in said:
                yield f"{BOUND}: {one.name} of {member.name} is {value:.6g}"


def _unknown(end: Ending) -> Iterator[str]:
    """Effects of which no number is known to differ from 0."""
    for name in (end.fit.names[at] for at in end.identified):
        ends = [end.model.interval(name, one.name) for one in end.model.numbers if one.owner == name]
        if ends and all(low <= 0.0 <= high for low, high in ends):
            yield f"{UNKNOWN}: {name}"


def _cancels(end: Ending) -> Iterator[str]:
    """The part of each effect that the free parameters cannot make, and by how much the residual of
    all effects falls when it is added last.
    """
    fitter = end.analysis.search.fitter
    whole = fitter.fit(end.fit.effects)
    free = np.linalg.qr(fitter.base)[0] if fitter.base.size else np.zeros((len(fitter.y), 0))
    for at, member in enumerate(whole.members):
        added = fitter.white(member) @ whole.coefficients[at]
        contributed = float(np.linalg.norm(added - free @ (free.T @ added)))
        taken = float(np.sqrt(max(fitter.fit(whole.without(at)).rss - whole.rss, 0.0)))
        if contributed > 3.0 * taken:
            yield f"{CANCELS}: {member.name}, {contributed:.4g} against {taken:.4g} noise levels"


def _within_floor(end: Ending) -> Iterator[str]:
    """A gap before any effect that no output has beyond its floor."""
    found = gaps(end)
    outputs = [one.name for one in end.setup.data.outputs]
    if end.verdict != "no_gap" and all(found.before[name] < found.floor[name] for name in outputs):
        yield f"{WITHIN}: {end.verdict}, {found.before} below {found.floor}"


def _answer(group: str, number: int) -> dict[str, Any]:
    return {"group": group, "number": number, "broken": broken(group, number)}


def main(argv: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=count, default=20, help="of each group")
    parser.add_argument("--first", type=int, default=10_000, help="number of the first one")
    parser.add_argument("--groups", nargs="*", default=list(GROUPS), choices=list(GROUPS))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=Path("runs/gap_invariants.jsonl"))
    given = parser.parse_args(argv)
    code = code_of(WORKFLOW)
    wanted = [(group, given.first + k) for k in range(given.records) for group in given.groups]
    there = {(one["group"], one["number"]): one["broken"] for one in kept(given.out)
             if one["code"] == code}  # fmt: skip
    given.out.parent.mkdir(parents=True, exist_ok=True)
    todo = [one for one in wanted if one not in there]
    for answer in asked(_answer, todo, given.workers):
        keep(given.out, {**answer, "code": code})
        there[answer["group"], answer["number"]] = answer["broken"]
    bad = {one: there[one] for one in wanted if there[one]}
    for (group, number), reasons in bad.items():
        sys.stdout.write(f"{group} {number}: {'; '.join(reasons)}\n")
    sys.stdout.write(f"{len(bad)} of {len(wanted)} answers break an invariant\n")
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

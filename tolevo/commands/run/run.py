"""`tolevo run`: the list of its steps, its side searches, and its files."""

from __future__ import annotations

import hashlib
import platform
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...algorithms.archive import nondominated
from ...algorithms.checkpoint import Checkpoint
from ...algorithms.exact.solver import Exact
from ...algorithms.run import Progress, Shared
from ...algorithms.search import SearchResult, search
from ...directory import Ownership, own_folder
from ...errors import InputError, refuse
from ...execution import Background, Closing, Execution, Executor, Lost, Processes, built, executor_of, next_of, pinned
from ...files import WORKBOOK, csv_text, write_bytes, write_text
from ...journal import recording_steps
from ...page_data import as_json, label_tables, records, table_files
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem, designs_frame
from ...records import Axis, RunResult, mechanism_lines, model_lines
from ...units import plain_number
from . import references as effects
from .answers import add_analysis, add_assumptions, add_capability, add_choices, add_promise, answers, rounded_design
from .changes import value_against_limit, words
from .decide import decide
from .front import (
    CHECKPOINT,
    CONFIGURATION,
    Designs,
    alternatives,
    join_references,
    middle_point,
    nearest_miss,
    notes_of,
    open_checkpoint,
    reported_front,
    rows_in_range,
    seconds_before,
    sentences,
)
from .plan import RunOutcome, RunPlan, add_units, chosen_point
from .proofs import (
    ProvenFront,
    add_bounds,
    add_conditional_bounds,
    add_estimated_bounds,
    add_requirements,
    end_notes,
    exact_front,
    measures,
    proof_notes,
    searchable,
    solved_front,
)
from .references import (
    REDUCERS,
    SideSearch,
    compare,
    continues_front,
    documents,
    regrets,
    searches_from_front,
    side_searches,
    store_reducer_fronts,
    table,
    violated,
)
from .tolerances import roughness_assumptions

# The side searches of a run, by an executor during the main search where there are workers.


SIDE = "side_*.npz"
"""Files of the steps of side searches that have not ended."""
Fronts = dict[SideSearch, pd.DataFrame | None]


@dataclass(frozen=True, slots=True)
class SideTask:
    """A side search as a task."""

    key: str
    side: SideSearch
    path: Path | None = None
    """The file of its steps, where it runs on this machine."""


def front_of(task: SideTask, report: Callable[[Progress], None] | None = None) -> pd.DataFrame | None:
    """The reported front of a side search, its steps recalled; None where it was interrupted."""
    built.cache_clear()  # the units of the main search, where its parts were computed in this process
    if task.path is None:
        return task.side.front(report)
    steps = Checkpoint(task.path, task.side.key)
    with suppress(InputError):  # none, or damaged: computed again
        known = Checkpoint.read(task.path)
        steps = known if known.identity == task.side.key else steps
    with recording_steps(steps.section("steps")):
        front = task.side.front(report, steps)
    if front is None:
        steps.write()
    return front


class Sides(Closing):
    """Runs side searches during the main one; each finished front is kept in the checkpoint.

    One of the `workers` is the process of the main search, which then computes the fronts
    that no other has begun. Searches that still run when the context is left are ended at once.
    """

    def __init__(
        self,
        searches: tuple[SideSearch, ...],
        workers: Execution | int,
        checkpoint: Checkpoint,
        progress: Callable[[Progress], None] | None = None,
        lent: Executor | None = None,
    ) -> None:
        self.searches, self._progress, self._lent = searches, progress, lent
        self.checkpoint = checkpoint
        self.where = workers if isinstance(workers, Execution) else Execution(workers)
        name = secrets.token_hex(8)
        self._open = deque(
            SideTask(f"{name}-{at}", side, None if self.where.dask else self._file(side))
            for at, side in enumerate(searches)
            if side.key not in checkpoint.tables
        )
        self._background: Background[SideTask, pd.DataFrame | None] | None = None
        self._others = min((self.where.workers or 1) - 1, len(self._open))
        if self._open and (self.where.dask or self._others):
            # a single process is in addition to this one
            executor = executor_of(self.where) if self.where.dask else lent or Processes(self._others)
            self._background = Background(executor, front_of, partial(next_of, self._open))

    def free(self) -> int:
        """Processes in addition to this one that have no side search to work on."""
        busy = self._background is not None and not self._background.over
        return (self.where.workers or 1) - 1 - (self._others if busy else 0)

    def close(self) -> None:
        """End what still runs at once; processes that are `lent` stay where they have nothing to do."""
        if self._background is not None and not (self._lent is not None and self._background.over):
            self._background.close()

    def collect(self) -> None:
        """Keep the fronts that have ended since; that of a lost process is computed again."""
        for task, front in self._background.taken() if self._background else ():
            if isinstance(front, Lost):
                self._open.append(task)
            else:
                self._keep(task.side, front)

    def finish(self) -> None:
        """Compute or wait for all fronts; an interrupt leaves out what has not been computed."""
        try:
            self._compute()
            if self._background is not None:
                self._background.wait()
                self.collect()
                self._compute()  # what was lost
        except KeyboardInterrupt:
            self.collect()

    def _compute(self) -> None:
        while self._open:
            try:
                task = self._open.pop()
            except IndexError:  # begun elsewhere meanwhile
                return
            self._keep(task.side, front_of(task, partial(self._report, task.side)))
            self.collect()

    def _report(self, side: SideSearch, state: Progress) -> None:
        """Pass the state of a side search on, under its own name."""
        self.collect()
        if self._progress is not None:
            step = f"{side.label}, {state.phase or f'generation {state.generation}'}"
            self._progress(replace(state, phase=step))

    def fronts(self) -> Fronts:
        """The front of each side search, None where it has not been computed."""
        return {side: self.checkpoint.tables.get(side.key) for side in self.searches}

    def _keep(self, side: SideSearch, front: pd.DataFrame | None) -> None:
        if front is None:  # it was interrupted
            raise KeyboardInterrupt
        if side.key not in self.checkpoint.tables:
            self.checkpoint.keep(side.key, front)
        self._file(side).unlink(missing_ok=True)

    def _file(self, side: SideSearch) -> Path:
        """The file of the steps of a side search, by its place."""
        return self.checkpoint.path.with_name(SIDE.replace("*", str(self.searches.index(side))))


# The drawing of a machine with the shares of its parts, as the page shows it.


def drawn(problem: ToleranceProblem, front: pd.DataFrame) -> dict[str, Any]:
    """`machine`: the parts with their shares [%] at the point in the middle of the front by cost,
    its cost, and the poses. Empty where a problem has no drawing.
    """
    sketch = problem.sketch()
    if front.empty or not sketch:
        return {}
    row = middle_point(front)
    parts = []
    for part in sketch["parts"]:
        stated = {key: value for key, value in part.items() if key != "shares" and value is not None}
        parts.append(stated | {"share": round(float(np.sum([float(row[name]) for name in part["shares"]])), 2)})
    return {"machine": {"parts": parts, "poses": sketch["poses"], "cost": float(row["cost"])}}


# The files of a run. Each appears whole or not at all.


def write(result: RunResult, folder: Path) -> None:
    """Write everything that the contract lists into `folder`, the summary last."""
    # Figures take longer to import than a configuration to read, which imports this package.
    from ...page.figures import pictures
    from ...page.page import page
    from ...page.sheet import allocation_sheet, drawing_page

    sheet, files = allocation_sheet(result), _write_tables(result, folder)
    write_bytes(folder / "front.parquet", result.front.to_parquet(index=False))
    write_text(folder / "front.json", as_json(records(result.front)))
    if sheet is not None:
        write_bytes(folder / "allocation.xlsx", sheet)
    for name, content in pictures(result).items():
        write_bytes(folder / name, content)
    write_text(folder / "report.html", page(result))
    if (drawing := drawing_page(result)) is not None:
        write_text(folder / "drawing.html", drawing)
    _write_summary(result, files, folder)


def write_tables(result: RunResult, folder: Path) -> None:
    """Write the tables and the summary alone, as far as a result has them."""
    _write_summary(result, _write_tables(result, folder), folder)


def _write_tables(result: RunResult, folder: Path) -> dict[str, str]:
    """Write the files from which the page can be rebuilt: the SHA-256 of each, by which edits are detected."""
    files = {"config.toml": result.configuration.encode()} | table_files(result)
    if result.tolerances:
        files["tolerances.json"] = as_json(list(result.tolerances)).encode()
    for name, content in files.items():
        write_bytes(folder / name, content)
    return {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}


def _write_summary(result: RunResult, files: Mapping[str, str], folder: Path) -> None:
    write_text(folder / "summary.json", as_json(dict(result.summary) | {"files": files}))


MISS = "nearest_miss.csv"
FAILED = "failed.csv"


def run(
    plan: RunPlan,
    out: Path,
    workers: Execution | int = 1,
    progress: Callable[[Progress], None] | None = None,
    resume: bool = False,
    overwrite: bool = True,
) -> RunOutcome:
    """Run `plan` and write its files to `out`; with `resume` continue the run that `out` holds.

    The result does not depend on `workers`: side searches have their own seeds and run in other
    processes where there are some. An interrupt ends the search; its results so far are written.
    Raises InputError where nothing is free to be searched, where limits are missing or out of
    reach, where another process works in `out`, or where it holds something that is not to be
    replaced (`overwrite`); RunError where the disk is full.
    """
    if not plan.problem.free:
        other = "`tolevo analyse` or " if isinstance(plan.problem, Stack) else ""
        text = f"every variable is fixed: there is nothing to optimise; use {other}`tolevo evaluate`"
        raise refuse("problem", text)
    searchable(plan.problem, plan.algorithm)
    with own_folder(out, "run", resume, overwrite) as place, pinned():
        return _run(plan, place, workers, progress, resume)


def _run(
    plan: RunPlan, place: Ownership, workers: Execution | int, progress: Callable[[Progress], None] | None, resume: bool
) -> RunOutcome:
    checkpoint, out = open_checkpoint(plan, place, resume), place.folder
    start, resume_notes = time.monotonic() - seconds_before(checkpoint), notes_of(checkpoint, resume)
    beside = effects.search_without_effects(plan) + effects.side_search(plan)
    where = workers if isinstance(workers, Execution) else Execution(workers)
    others = 0 if where.dask else (where.workers or 1) - 1
    # the documents are evaluated beside the front where nothing else is, and nothing before it needs them
    later = plan.references and continues_front(plan) and others > 0 and not plan.reference_search and not beside
    known = documents(plan.problem) if plan.references and not later else pd.DataFrame()
    searches = side_searches(plan, known) + beside if plan.references else beside
    place.begin(keep=(CONFIGURATION, CHECKPOINT, SIDE, REDUCERS) if resume else (CONFIGURATION,))
    write_text(out / CONFIGURATION, plan.configuration)
    checkpoint.write()
    store_reducer_fronts(plan.problem, out)
    try:
        with Designs(plan.problem, where, lambda: (where.workers or 1) - 1) as designs:
            printed: Callable[..., pd.DataFrame] = lambda *_: known  # noqa: E731
            if later:
                printed = designs.ahead(documents, None)
            search_result, fronts = _run_searches(plan, checkpoint, searches, printed, designs, progress)
            if search_result.interrupted or any(side_front is None for side_front in fronts.values()):
                checkpoint.write()
                return _write_interrupted(plan, out, search_result, printed(pd.DataFrame()), start)
            with recording_steps(checkpoint.section("result")):
                found = _conclude_run(
                    plan, search_result, fronts, printed(), resume_notes, start, progress, designs.results
                )
    except KeyboardInterrupt:
        checkpoint.write()
        raise
    result, lines = found
    checkpoint.write()
    miss = nearest_miss(plan.problem, search_result) if result.front.empty else pd.DataFrame()
    if result.front.empty:
        write_text(out / MISS, csv_text(miss))
    if len(search_result.failed):
        listed = designs_frame(plan.problem, plan.problem.complete(search_result.failed))
        write_text(out / FAILED, csv_text(listed))
    plan.problem.release()  # figures and tables need memory as well
    write(result, out)
    if plan.workbook:
        _write_workbook(plan, result, out)
    status = str(result.summary["status"])
    place.complete(status)
    return RunOutcome(status, out, _lines(result, status, out, lines, _broken_limits(plan.problem, miss)), result)


def _write_workbook(plan: RunPlan, result: RunResult, folder: Path) -> None:
    """The workbook of a stack with sheets of the first choice, where there is one."""
    from ...configuration.workbook import with_result

    point = chosen_point(result)
    design = rounded_design(result, plan.problem, point)
    if design is not None and result.allocation is not None and isinstance(plan.problem, Stack):
        rows = result.allocation[result.allocation["point"] == point]
        write_bytes(folder / WORKBOOK, with_result(plan.workbook, plan.problem, design, rows))


def _conclude_run(
    plan: RunPlan,
    search_result: SearchResult,
    fronts: Fronts,
    printed: pd.DataFrame,
    resume_notes: tuple[str, ...],
    start: float,
    progress: Callable[[Progress], None] | None,
    shared: Shared,
) -> tuple[RunResult, Sequence[str]]:
    """Everything that follows from the searches, and what the terminal says of the proof."""
    searched = reported_front(plan.problem, search_result)
    exact = exact_front(plan.problem, solved_front(plan, search_result))
    robust = regrets(plan.problem)
    references = table(plan, printed, fronts, exact, robust.row)
    front, dropped, joined = join_references(searched, references, plan.problem)
    front, front_proof = add_bounds(front, plan.problem)
    before = next((side_front for side, side_front in fronts.items() if side.apart), None)
    overlays = effects.overlays_of(fronts, searched)
    relaxed = {side.label: side_front for side, side_front in fronts.items() if side.relaxed}
    if len(references):
        references, _ = add_bounds(references, plan.problem, rows_in_range(references, plan.problem))
        references = robust.added(compare(references, searched, relaxed, plan.problem))
    status = "done" if len(front) else "no_feasible_point"
    names = list(plan.problem.objectives)
    for other_front in overlays.values():
        front = effects.add_distance(front, other_front, names, between=not isinstance(plan.algorithm, Exact))
    comparisons = [
        n for label, other_front in overlays.items() for n in effects.notes(front, label, other_front, names)
    ]
    warned = (*plan.problem.effect_notes(), *plan.problem.cautions(), *comparisons)
    alternative_costs = alternatives(plan.problem, front)
    remarks = (*plan.problem.remarks(front), *sentences(alternative_costs))
    failures = _failure_notes(search_result)
    first = (*failures, *robust.notes, *_start_notes(plan))
    notes = (*first, *warned, *remarks, *resume_notes, *_notes(references, dropped, joined))
    decisions = decide(plan.problem, front, plan.choice, shared)
    proven = (*proof_notes(plan.problem, front, front_proof), *end_notes(plan.problem, front), *notes, *decisions.notes)
    summary = _summary(plan, search_result, front, status, proven, time.monotonic() - start)
    summary |= measures(search_result, front, front_proof, exact)
    summary |= {"robust": robust.summary} if robust.summary else {}
    summary |= {"bound_of": plan.problem.priced} if plan.problem.priced != "cost" else {}
    summary |= drawn(plan.problem, front) | ({"alternatives": alternative_costs} if alternative_costs else {})
    result = _result(plan, search_result, front, references, summary, proven, exact)
    looser = label_tables(relaxed)
    looser = None if looser is None or looser.empty else looser
    result = replace(add_choices(result, decisions, plan, exact), overlays=overlays, relaxed=looser)
    if plan.problem.settings.promise is None:  # whose verdicts take long
        plan.problem.release()  # one sample after the other in memory
    result = add_conditional_bounds(result, plan, shared)
    plan.problem.release(of_searches=True)
    result = add_estimated_bounds(result, plan, shared)
    result = replace(result, summary={**result.summary, "answers": answers(result, plan.problem, front_proof)})
    result = add_requirements(
        add_units(add_capability(add_promise(result, plan.problem), plan.problem), plan.problem), plan.problem
    )
    result = add_analysis(result, plan.problem)
    plan.problem.release()
    result = add_assumptions(result, plan.problem, search_result.history, progress, shared)
    if before is not None:
        result = replace(result, before=before, moved=effects.allocation_moves(plan.problem, before, front))
    return result, proof_notes(plan.problem, front, front_proof)


def _write_interrupted(
    plan: RunPlan, out: Path, search_result: SearchResult, printed: pd.DataFrame, start: float
) -> RunOutcome:
    """Write the front so far as the search sees it, without what takes long: fresh units, proofs, page.

    The documents are left out where they have not been evaluated yet.
    """
    best = nondominated(search_result.f) if len(search_result.f) else slice(0)
    few = replace(search_result, x=search_result.x[best], f=search_result.f[best])
    front = reported_front(plan.problem, few, searching=True).assign(bound=np.nan, gap_percent=np.nan)
    references = table(replace(plan, references=False), printed, {}, None)
    summary = _summary(plan, search_result, front, "interrupted", (), time.monotonic() - start)
    result = _result(plan, search_result, front, references, summary, (), None)
    write_tables(result, out)
    line = (
        f"interrupted: {len(front)} Pareto points of {search_result.evaluations} evaluations, with values as the "
        f"search sees them, and its state as saved last are in {out}; run the same command with --resume to continue"
    )
    return RunOutcome("interrupted", out, (line,), result)


def _run_searches(
    plan: RunPlan,
    checkpoint: Checkpoint,
    searches: tuple[SideSearch, ...],
    printed: Callable[..., pd.DataFrame],
    designs: Designs,
    progress: Callable[[Progress], None] | None,
) -> tuple[SearchResult, Fronts]:
    """The main search with those beside it, then those that begin from its front."""
    idle = designs.free
    with Sides(searches, designs.where, checkpoint, progress) as sides:
        designs.free = sides.free

        def report(state: Progress) -> None:
            sides.collect()
            printed(pd.DataFrame())  # an error in it ends the search
            if progress is not None:
                progress(state)

        with recording_steps(checkpoint.section("search")):
            search_result = search(
                plan.problem,
                plan.algorithm,
                plan.budget,
                plan.seed,
                report,
                plan.engine,
                checkpoint,
                designs.results,
                plan.start,
            )
        if search_result.interrupted:
            return search_result, sides.fronts()
        sides.finish()
    designs.free = idle
    searches += searches_from_front(plan, printed(), search_result.chosen)
    checkpoint.keep_only([side.key for side in searches])
    plan.problem.release()
    with Sides(searches, designs.where, checkpoint, progress, designs.executor) as sides:
        sides.finish()
        return search_result, sides.fronts()


def _summary(
    plan: RunPlan, search_result: SearchResult, front: pd.DataFrame, status: str, notes: tuple[str, ...], seconds: float
) -> dict[str, object]:
    ideal, nadir = plan.problem.box()
    names = plan.problem.objectives
    packages = ("tolevo", "pymoo", "numpy", "scipy", "pandas", "moocore")
    return {
        "status": status,
        "seed": plan.seed,
        "versions": {"python": platform.python_version()} | {p: version(p) for p in packages},
        "configuration_hash": hashlib.sha256(plan.configuration.encode()).hexdigest(),
        "evaluations": search_result.evaluations,
        **({"failed_evaluations": search_result.failures} if search_result.failures else {}),
        "seconds": seconds,
        "points": len(front),
        "ideal": dict(zip(names, ideal.tolist(), strict=True)),
        "nadir": dict(zip(names, nadir.tolist(), strict=True)),
        "notes": list(notes),
        "assumptions": [
            asdict(a) for a in (*plan.problem.assumptions(), *roughness_assumptions(plan.problem, plan.choice))
        ],
        **_model(plan.problem),
        **_costs(plan.problem),
        **effects.summary(plan.problem),
    }


def _costs(problem: ToleranceProblem) -> dict[str, object]:
    """The currency of the costs, and which are assumed; empty where costs are relative."""
    money = problem.settings.money
    if not money.currency:
        return {}
    costs = {"currency": money.currency, "assumed": list(money.assumed)}
    return {"costs": costs | ({"scale_assumed": money.scale} if money.scale else {})}


def _model(problem: ToleranceProblem) -> dict[str, object]:
    """The model that the numbers come from; empty where there is only one."""
    if not problem.declaration.model_statement:
        return {}
    return {"model": problem.declaration.model_name, "model_statement": problem.declaration.model_statement}


def _result(
    plan: RunPlan,
    search_result: SearchResult,
    front: pd.DataFrame,
    references: pd.DataFrame,
    summary: dict[str, object],
    notes: tuple[str, ...],
    exact: ProvenFront | None,
) -> RunResult:
    columns = ["generation", "evaluations", "seconds", "hypervolume", "feasible_fraction"]
    convergence = pd.DataFrame([asdict(p) for p in search_result.history], columns=columns)
    whole = exact.hypervolume if exact is not None else float("nan")
    convergence.insert(4, "hypervolume_ratio", convergence["hypervolume"] / whole)
    return RunResult(
        plan.problem.title() or problem_title(plan.problem) or plan.title,
        front,
        references,
        convergence,
        summary,
        objectives=_axes(plan.problem, plan.problem.objectives),
        variables=tuple(Axis(v.name, v.unit, v.meaning) for v in plan.problem.variables),
        notes=notes,
        bars=plan.problem.bars(),
        configuration=plan.configuration,
    )


def problem_title(problem: ToleranceProblem) -> str:
    """The title of a problem: the first line of its description."""
    if not type(problem).__module__.startswith("tolevo."):
        return ""
    text = (type(problem).__doc__ or "").strip().split("\n")[0]
    return text.rstrip(".").split(":")[0].split(" (default")[0]


def _axes(problem: ToleranceProblem, names: tuple[str, ...]) -> tuple[Axis, ...]:
    outputs = {o.name: o for o in problem.outputs}
    return tuple(Axis(n, outputs[n].unit, outputs[n].meaning) for n in names)


def _notes(references: pd.DataFrame, dropped: int, joined: int) -> list[str]:
    """What the page and the summary say about the references."""
    notes = [
        f"{row['label']} breaks {row['violated_limits'].replace(' ', ', ')}: it is outside of what "
        "this run may choose, so the front cannot be expected to beat it; see the relaxed columns"
        for row in references.to_dict("records")
        if row["violated_limits"]
    ]
    if joined:
        were, points = ("reference was", "it dominates"), ("references were", "they dominate")
        added, beaten = were if joined == 1 else points
        removed = {0: "no point", 1: "one point"}.get(dropped, f"{dropped} points")
        notes.append(
            f"the search found nothing as good as {joined} of the references: {joined} {added} added to the front, and "
            f"{removed} that {beaten} removed; the table of references compares them with the front of the search alone"
        )
    return notes


def _start_notes(plan: RunPlan) -> list[str]:
    """What the user should know of the designs that the search began from."""
    if plan.start is None:
        return []
    f, g = plan.problem.searched(plan.start)
    whole = np.isfinite(f).all(axis=1) & np.isfinite(g).all(axis=1)
    failed, broken = int(np.count_nonzero(~whole)), int(np.count_nonzero(np.any(g > 0.0, axis=1) & whole))
    words = [f"{failed} of them failed"] if failed else []
    words += (
        [f"{broken} of them break a limit of this run: they are searched from, but are no result"] if broken else []
    )
    return [*plan.start_notes, *words]


def _failure_notes(search_result: SearchResult) -> list[str]:
    """What the user should know of evaluations that failed."""
    if not search_result.failures:
        return []
    number, listed = search_result.failures, len(search_result.failed)
    which = "their designs are" if listed == number else f"the first {listed} of their designs are"
    return [
        f"{number} of {search_result.evaluations} evaluations failed, because a value is not finite: they count as "
        f"infeasible; {which} in {FAILED}"
    ]


def _broken_limits(problem: ToleranceProblem, miss: pd.DataFrame) -> str:
    """The limits that the nearest miss breaks, with its values."""
    rows = miss.to_dict("records")
    names = {name for row in rows for name in violated(problem, row)}
    limits = [limit for limit in problem.limits if limit.name in names]
    return "; ".join(f"{words(o.name)} {value_against_limit(float(rows[0][o.name]), o)}" for o in limits)


def _lines(result: RunResult, status: str, out: Path, proof_lines: Sequence[str], broken: str) -> tuple[str, ...]:
    """A short summary for the terminal; `proof_lines` are left out where the answers state them."""
    lines = [
        f"{status}: {len(result.front)} Pareto point{'s' * (len(result.front) != 1)}, {result.summary['evaluations']} "
        f"evaluations, {float(str(result.summary['seconds'])):.1f} s"
    ]
    lines += [*mechanism_lines(result.summary), *model_lines(result.summary)]
    lines += result.answers.values()
    for row in result.references.to_dict("records"):
        compliance = "meets all limits" if row["feasible"] else f"breaks {row['violated_limits']}"
        values = ", ".join(
            f"{axis.name} {plain_number(row[axis.name])} {axis.unit if axis.name == 'cost' else ''}".rstrip()
            for axis in result.objectives
        )
        lines.append(f"reference {row['label']}: {values}; {compliance}")
    answered = proof_lines if "proof" in result.answers else ()
    lines += [f"note: {note}" for note in result.notes if note not in answered]
    searched = result.summary["evaluations"]
    if status == "no_feasible_point" and searched and result.summary.get("failed_evaluations") == searched:
        lines.append("no evaluation has a value, so that nothing is known of the limits")
    elif status == "no_feasible_point":
        lines.append(
            f"the nearest miss is in {out / 'nearest_miss.csv'}{f' ({broken})' if broken else ''}; relax the limit it "
            f"breaks{', widen the ranges or raise the budget' if searched else ' or widen the ranges'}"
        )
    return tuple(lines)

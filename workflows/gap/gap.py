"""`tolevo gap`: the analysis of data, from their preparation to the files of its result."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from threadpoolctl import threadpool_limits

from ...directory import owned
from ...gap_records import GapResult
from ...records import Axis, mechanism_lines
from ..execution import Execution
from .all_rows import on_all_rows
from .analysis import Analysis, analysed
from .correct import corrected_toml, in_problem
from .data import GapData
from .ending_records import effects, gate, residual_table, rival_records, scores
from .gaps import OF_ROWS, gaps, never_worse
from .locate import regions
from .next.measurement import next_measurement
from .one_delay import uneven_delays
from .plan import GapPlan
from .plausible import unlikely_numbers
from .populations.compared import compared
from .populations.results import attribution_of, inputs_instead, summary_messages
from .progress import GapProgress, Report, silent
from .quantiles import spread_of_units
from .recalibration import moved_far
from .regions import of_inside
from .remainder import remainder_of, removed_from, terms_of
from .replicates import Replicates, identity_of, is_complete, opened
from .result import Ending, ended
from .setup import prepared
from .shapes import shape_records
from .spectrum import spectrum
from .uncertainty import Spread, bootstrap
from .write import summary_of, write

RMSE = "{}: rmse {:.4g} -> {:.4g} {} on held-out rows; noise {:.4g}"
FAR = "{}: distance of the batch from the model's population {:.4g} -> {:.4g} {} on held-out units; chance {:.4g}"


@dataclass(frozen=True, slots=True)
class GapOutcome:
    """How an analysis ended ("done" or "interrupted"), and its summary in lines.

    `result` is None where it was interrupted, or was complete before.
    """

    status: str
    folder: Path
    lines: tuple[str, ...]
    result: GapResult | None = None


def gap(
    plan: GapPlan,
    data: GapData,
    out: Path,
    workers: Execution | int = 1,
    progress: Report | None = None,
    resume: bool = False,
    overwrite: bool = True,
) -> GapOutcome:
    """Find, identify and close the gap between `plan`'s model and `data`, into `out`.

    The result does not depend on `workers`. With `resume`, `out` may hold the same analysis: its
    finished bootstrap replicates are not repeated, and a complete analysis is only read. Raises
    InputError where the data are outside of the model's range, or `out` has another owner; nothing
    is written then.
    """
    identity = identity_of(plan, data)
    with owned(out, "gap", resume, overwrite) as place:
        if resume and is_complete(place, identity):
            return GapOutcome("done", out, (*summary_of(out), f"{out} was complete already"))
        replicates = opened(place, identity, resume)
        try:
            result = analysis_result(plan, data, workers, progress, replicates)
            lines = lines_of(result)
            write(result, out, lines)
            place.complete()
        except KeyboardInterrupt:
            return GapOutcome("interrupted", out, (_saved(replicates, plan.settings.bootstrap),))
    return GapOutcome("done", out, lines, result)


def _saved(replicates: Replicates, count: int) -> str:
    """A message on what an interrupt has saved, and how to go on."""
    if replicates.path is None or not replicates.path.is_file():
        return "interrupted: nothing was written"
    done = f"{len(replicates.ended)} of {count} replicates are kept in {replicates.path}; " if count else ""
    return f"interrupted: {done}run the same command with --resume to continue"


def analysis_result(
    plan: GapPlan,
    data: GapData,
    workers: Execution | int = 1,
    progress: Report | None = None,
    replicates: Replicates | None = None,
) -> GapResult:
    """The whole analysis of data in memory; the only file that it writes is that of its replicates.

    Linear algebra runs in a single thread: columns are long and few, and threads that wait for each
    other took two thirds of the CPU.
    """
    report, replicates, spread = progress or silent, replicates or Replicates(), None
    with threadpool_limits(1):
        end = ending(plan, data, report, replicates.begin)
        if plan.settings.bootstrap and end.fit.members:
            spread = bootstrap(end.analysis, end.fit, replicates, workers, report)
        report(GapProgress("result"))
        return result_of(plan, data, end, spread)


def ending(
    plan: GapPlan, data: GapData, report: Report = silent, accepted: Callable[[], None] = lambda: None
) -> Ending:
    """The final result of data in memory; `accepted` is called once the model accepts them.

    Raises InputError where the data are outside of the model's range.
    """
    report(GapProgress("columns of the library"))
    setup = prepared(plan, data)
    accepted()
    report(GapProgress("search"))
    return on_all_rows(never_worse(ended(analysed(setup))), data)


def result_of(plan: GapPlan, data: GapData, end: Ending, spread: Spread | None = None) -> GapResult:
    """The final result as records; intervals are those of the replicates where there are any."""
    analysis, setup = end.analysis, end.setup
    initial = analysis.initial_null_model
    limit = initial.search.thresholds.generic
    table, gap_sizes, attribution = residual_table(end, data), gaps(end), attribution_of(end)
    text, planned = corrected_toml(plan, end.model, analysis.scatter[:1]), next_measurement(end)
    rivals = rival_records(end, planned.rivals if planned else {}) + inputs_instead(end, attribution)
    return GapResult(
        title=plan.labels.name or plan.model_name,
        verdict="ambiguous" if end.verdict == "named" and rivals else end.verdict,
        outputs=tuple(Axis(o.name, o.unit, o.meaning) for o in data.outputs),
        inputs=tuple(Axis(c.name, c.unit, c.meaning) for c in data.inputs),
        gate=gate(end),
        where=of_inside(setup, end.fit, table)
        + regions(initial.setup, initial.search.fitter, initial.generic, initial.null_fit, limit),
        scores=scores(end),
        steps=analysis.selection.steps,
        effects=in_problem(plan, text, effects(end, spread)),
        rivals=rivals,
        shapes=shape_records(end),
        noise_floor=gap_sizes.floor,
        gap_before=gap_sizes.before,
        gap_after=gap_sizes.after,
        residuals=table,
        spectrum=spectrum(data, table, initial.noises, limit),
        units=spread_of_units(data, end),
        summary=_summary(plan, data, end, spread) | {"gap_is": gap_sizes.meaning},
        notes=_notes(analysis, data, end),
        population=compared(end),
        attribution=attribution,
        configuration=plan.configuration,
        corrected=text,
        remainder=remainder_of(end),
        unresolved=terms_of(end),
        next_measurement=planned.record if planned else None,
        next_points=planned.points if planned else None,
        drawing=plan.drawing,
    )


def _summary(plan: GapPlan, data: GapData, end: Ending, spread: Spread | None) -> dict[str, object]:
    """The other entries of `gap.json`: none changes from run to run."""
    settings = plan.settings
    return {
        "model": plan.model_name,
        "seed": plan.seed,
        "configuration_hash": hashlib.sha256(plan.configuration.encode()).hexdigest(),
        "data_hash": data.digest,
        "data": dict(data.table),
        "rows": len(data),
        "rows_used": len(end.setup.data),
        "library": [candidate.name for candidate in (*end.setup.library, *end.setup.on_scatter)],
        "threshold": end.analysis.search.thresholds.library,
        "false_rate": settings.false_rate,
        "practical_limit": settings.practical_limit,
        "interval": settings.interval,
        "assumptions": {"parts_out_of_limits": settings.parts_out_of_limits},
        "intervals_from": "linearised" if spread is None else "block bootstrap of the selection",
        "bootstrap": 0 if spread is None else len(spread.replicates),
        "outside_training_region": _region(data),
        "versions": {"tolevo": version("tolevo")},
        **({"mechanism": known} if (known := plan.labels.stated()) else {}),
    }


def _region(data: GapData) -> dict[str, list[float]]:
    """The range of each input that the corrected model was fitted in."""
    inputs = {c.name: data.measurements.table[c.name] for c in data.inputs}
    return {name: [float(values.min()), float(values.max())] for name, values in inputs.items()}


def _notes(analysis: Analysis, data: GapData, end: Ending) -> tuple[str, ...]:
    drawing = end.setup.plan.drawing
    notes = [*([drawing.assumed] if drawing and drawing.assumed else []), *end.setup.first]
    notes += [*unlikely_numbers(end.fit, data), *data.notes, *end.setup.notes]
    for output, noise in zip(data.outputs, analysis.initial_null_model.noises, strict=True):
        if noise.outliers:
            subject = f"{noise.outliers} outliers do" if noise.outliers > 1 else "1 outlier does"
            notes.append(f"{output.name}: {subject} not count")
        if noise.varies_with:
            notes.append(f"{output.name}: the size of the noise follows {noise.varies_with}")
        if noise.rho > 0.3:
            notes.append(
                f"{output.name}: the noise is autocorrelated ({noise.rho:.2f} from one measurement to the next)"
            )
    if end.rows:
        notes += uneven_delays(analysis.search.fitter, end.fit, end.setup.data)
    if removed := removed_from(analysis):
        notes.append(f"{', '.join(removed)}: something similar is present, but its form differs")
    if far := moved_far(end):
        notes.append(far)
    if len(end.setup.library) == 0:
        notes.append("no effect of the library applies to this model with these columns")
    return tuple(notes)


def lines_of(result: GapResult) -> tuple[str, ...]:
    """A short summary for the terminal."""
    lines = mechanism_lines(result.summary)
    lines += result.drawing.lines() if result.drawing else ()
    lines.append(f"{result.verdict}: {result.summary['rows']} rows")
    words = RMSE if result.summary["gap_is"] == OF_ROWS else FAR
    for output in result.outputs:
        before, after, floor = (gap[output.name] for gap in (result.gap_before, result.gap_after, result.noise_floor))
        lines.append(words.format(output.name, before, after, output.unit, floor))
    lines += [f"effect {effect}" for effect in result.effects]
    lines += [
        f"at its physical bound: {name} of {effect.name}" for effect in result.effects for name in effect.at_bound
    ]
    lines += [f"in the problem: {effect.name}: {effect.counterpart}" for effect in result.effects if effect.counterpart]
    lines += [f"rival {rival}" for rival in result.rivals]
    lines += [f"remainder: {part}" for part in result.remainder]
    if not result.remainder:
        lines += [f"not identified: {shape}" for shape in result.shapes]
    lines += summary_messages(result.population, result.attribution)
    if (planned := result.next_measurement) is not None:
        lines.append(f"next measurement: {planned}")
        lines += [f"next measurement: {entry}" for entry in (*planned.effects[1:], *planned.notes)]
    if result.verdict == "no_gap":
        detectable = sorted(result.gate.detectable, key=lambda effect: effect.rms)[:5]
        lines += [f"smallest detectable effect: {effect}" for effect in detectable]
    if unseen := ", ".join(result.gate.unseen):
        lines.append(f"cannot be detected, because free parameters imitate it: {unseen}")
    lines += [f"note: {note}" for note in result.notes]
    return tuple(lines)

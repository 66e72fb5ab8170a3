"""`tolevo gap`: the analysis of data, from their preparation to the files of its result."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from ... import page_data
from ...directory import own_folder
from ...execution import Execution
from ...files import write_bytes, write_text
from ...interrupts import writing
from ...journal import recording_steps
from ...models.effects.measurements import Active, predicted
from ...models.measurable import MeasurableModel, Role
from ...page_data import as_json
from ...records import Axis, CommandOutcome, mechanism_lines
from ...section import Array
from .analysis import Analysis, analysed
from .correct import corrected_toml, fit_all_rows, in_problem, uneven_delays, zeros_with
from .data import GapData
from .ending_records import (
    OF_ROWS,
    effects,
    elsewhere,
    gaps,
    gate,
    never_worse,
    recalibrated,
    remainder_of,
    removed_effects,
    residual_table,
    rival_records,
    scores,
    terms_of,
)
from .fit import Fit
from .locate import along, regions, regions_of_prediction, shapes, spectrum
from .next_measurement import next_measurement
from .plan import GapPlan, GapProgress, Report, ignore_progress
from .population import Misfit
from .populations import attribution_of, compared, inputs_instead, summary_messages
from .read import unlikely_numbers
from .records import FoundEffect, GapResult, Rival, Shape
from .result import Ending, finish_analysis
from .scan import generic_residual
from .setup import prepare_setup, residual_of
from .uncertainty import Replicates, Spread, bootstrap, identity_of, is_complete, open_replicates

COLUMNS = ("output", "share", "measured", "before", "after")
DRAWN = 20_000
"""Least number of units drawn from a model."""
MAX_DRAWN_UNITS = 400
"""Largest number of quantiles of a distribution."""


def spread_of_units(data: GapData, end: Ending) -> pd.DataFrame:
    """Quantiles by output at fractions of the units; empty where the model has no population.

    Those before are of the null model, without the effect on the scatter that the final setup
    carries; those after are of the corrected configuration, with its zeros and in its order.
    """
    plan = end.analysis.initial_null_model.setup.plan
    if plan.model is None or not data.target.population:
        return pd.DataFrame({name: [] for name in COLUMNS})
    scatter = [effect.active for effect in end.analysis.scatter[:1]]
    before = _draw_units(plan, data, plan.model, plan.active, plan.zero)
    model = plan.rebuild(end.model.free()) if plan.rebuild and end.model.free() else plan.model
    after = _draw_units(plan, data, model, (*scatter, *plan.active, *end.model.active), zeros_with(plan, end.model))
    count = min(MAX_DRAWN_UNITS, len(data))
    fractions = (np.arange(count) + 0.5) / count
    sides = {"measured": data.measured, "before": before, "after": after}
    parts = [
        pd.DataFrame(
            {"output": output.name, "share": fractions}
            | {side: np.quantile(values[output.name], fractions) for side, values in sides.items()}
        )
        for output in data.outputs
    ]
    return pd.concat(parts, ignore_index=True)


def _draw_units(
    plan: GapPlan, data: GapData, model: MeasurableModel, effects: Sequence[Active], zero: Mapping[str, float]
) -> dict[str, Array]:
    """Units (m,) drawn at the inputs of the data, equally many at each."""
    table = data.measurements.table
    runs = [
        predicted(model, plan.model_name, table, effects, np.random.default_rng([plan.seed, 9, number]), zero)
        for number in range(-(-DRAWN // len(data)))
    ]
    return {output.name: np.concatenate([run[output.name] for run in runs]) for output in data.outputs}


MAX_RECALIBRATION_MOVE = 0.5
"""Fraction of its tolerance from which a parameter has moved far."""
MOVE_IN_ERRORS = 4.0
"""Number of standard errors that it must have moved."""


def far_move_note(end: Ending) -> str:
    """The note on parameters that moved far and beyond their errors; empty where none has."""
    model = end.model
    pairs = zip(model.numbers, model.errors.tolist(), strict=True)
    errors = {number.name: error for number, error in pairs if number.kind == "free"}
    return recalibration_message(
        (parameter.name, parameter.after - parameter.before, parameter.tolerance, errors[parameter.name])
        for parameter in recalibrated(end)
    )


def recalibration_message(moves: Iterable[tuple[str, float, float, float]]) -> str:
    """The same note from names, moves, tolerances and standard errors."""
    far = [
        name
        for name, move, tolerance, error in moves
        if abs(move) > max(MAX_RECALIBRATION_MOVE * tolerance, MOVE_IN_ERRORS * error)
    ]
    if not far:
        return ""
    return (
        f"recalibrated by more than {100 * MAX_RECALIBRATION_MOVE:.0f} % of its tolerance: {', '.join(far)}; with an "
        "empty [free] this would be a gap, and its effect would be identified if the library contains it"
    )


def shape_records(end: Ending) -> tuple[Shape, ...]:
    """The forms that are significant given the final fit, as records."""
    analysis, search = end.analysis, end.analysis.search
    generic = analysis.null_model.generic
    misfit_shapes = () if analysis.misfit is None else (_misfit_record(end, analysis.misfit),)
    settled = not analysis.identified.withdrawn and not end.remains and not analysis.identified.significant
    if not analysis.significant or (end.identified and settled):
        return misfit_shapes
    fit = search.fitter.fit(end.fit.effects)
    remaining = generic_residual(fit, search.fitter, generic)
    records = shapes(end.setup, search, generic, remaining, fit, removed_effects(analysis))
    if end.verdict == "unnamed" and end.setup.plan.settings.empirical:
        formulas = [_formula(end, shape, fit) for shape in records]
        records = tuple(
            replace(shape, empirical=text, text=f"{shape.text}; empirical: {text}") if text else shape
            for shape, text in zip(records, formulas, strict=True)
        )
    return (*misfit_shapes, *records)


def _formula(end: Ending, shape: Shape, fit: Fit) -> str:
    """A formula over the shape's variable; empty where a spline fits as well."""
    from ...models.effects.empirical import Curve, empirical

    setup = end.setup
    x, name, period = along(setup, shape.variable), shape.variable, 0.0
    if x is None or shape.by:
        return ""
    if np.isfinite(shape.order):
        x = np.mod(shape.order * setup.data.measurements[Role.ANGLE], 2.0 * np.pi)
        name, period = f"({shape.order:g} {name})", 2.0 * np.pi
    at = [o.name for o in setup.data.outputs].index(shape.output)
    rows, noise = setup.data.rows_of(at), end.analysis.null_model.noises[at]
    good, y = noise.counted, residual_of(setup, fit)[rows]
    if shape.direction == "odd":
        y = y * np.asarray(setup.data.measurements[Role.DIRECTION], dtype=float)
    curve = Curve(x[good], y[good], noise.sigma[good], end.analysis.search.labels[rows][good], period)
    text = empirical(curve, name)
    return f"direction ({text})" if text and shape.direction == "odd" else text


def _misfit_record(end: Ending, misfit: Misfit) -> Shape:
    """Units that scatter unlike the model's, as a record."""
    output = end.setup.data.outputs[0]
    width = ", stretched to its width," if misfit.stretched else ""
    text = (
        f"the units scatter unlike the population: {misfit.distance:.3g} {output.unit} from it "
        f"about their mean{width} where chance reaches {misfit.limit:.3g}; their standard "
        f"deviation is {misfit.ratio:.2f} times as large"
    )
    where = (output.name, "population", "scatter of the units")
    return Shape(*where, misfit.distance, output.unit, text, torque="none", direction="none")


SUMMARY = "summary.txt"


def write(result: GapResult, folder: Path, lines: Sequence[str]) -> None:
    """Everything that the contract lists, and the summary's lines; `gap.json` last."""
    from ...page.drawing import as_png, as_svg  # matplotlib, which an interrupted analysis does not need
    from .page import drawings, gap_page

    write_text(folder / "config.toml", result.configuration)
    write_text(folder / "corrected.toml", result.corrected)
    page_data.write_tables(result, folder)
    drawn = tuple(drawings(result))
    for name, figure, _ in drawn:
        write_bytes(folder / f"{name}.png", as_png(figure))
        write_bytes(folder / f"{name}.svg", as_svg(figure))
    write_text(folder / "report.html", gap_page(result, drawn))
    write_text(folder / SUMMARY, "".join(f"{line}\n" for line in lines))
    write_text(folder / page_data.NAME, page_data.dump_result(result))
    write_text(folder / "gap.json", as_json(record(result)))


def summary_of(folder: Path) -> tuple[str, ...]:
    """The summary of an analysis that has ended; empty where its file was removed."""
    path = folder / SUMMARY
    return tuple(path.read_text(encoding="utf-8").splitlines()) if path.is_file() else ()


def record(result: GapResult) -> dict[str, Any]:
    """The content of `gap.json`."""
    return {
        **({"simulated": asdict(result.drawing)} if result.drawing else {}),
        "verdict": result.verdict,
        "effects": [_effect(effect) for effect in result.effects],
        "alternatives": [_rival(rival) for rival in result.rivals],
        "next_measurement": asdict(planned) if (planned := result.next_measurement) else None,
        "unresolved": [asdict(term) for term in result.unresolved],
        "remainder": [asdict(remainder) for remainder in result.remainder],
        "unnamed": [asdict(shape) for shape in result.shapes],
        "where": [asdict(part) | {"region": part.ends, "text": str(part)} for part in result.where],
        "population": [asdict(line) for line in result.population],
        "attribution": [asdict(attribution) for attribution in result.attribution],
        "noise_floor": _numbers(result.noise_floor),
        "gap_before": _numbers(result.gap_before),
        "gap_after": _numbers(result.gap_after),
        "elsewhere": _numbers(result.elsewhere) if result.elsewhere else None,
        "split": {key: _numbers(value) if isinstance(value, Mapping) else value for key, value in result.split.items()},
        "gate": asdict(result.gate),
        "scores": [asdict(score) for score in result.scores],
        "steps": [asdict(step) for step in result.steps],
        **result.summary,
        "notes": list(result.notes),
    }


def _numbers(by_output: Mapping[str, float]) -> float | dict[str, float]:
    """A number for a single output; for several one by output, and the total in noise units."""
    first, *others = (size for name, size in by_output.items() if name != "total")
    return dict(by_output) if others else first


EVIDENCE = ("gain", "threshold", "held_out_gain", "held_out_error", "share")


def _effect(effect: FoundEffect) -> dict[str, Any]:
    return {
        "name": effect.name,
        "family": effect.family,
        "cause": effect.cause,
        "parameters": {
            p.name: {"value": p.value, "interval": [p.low, p.high], "unit": p.unit, "meaning": p.meaning}
            for p in effect.parameters
        },
        "explains_percent": effect.explains_percent,
        "form_error": effect.form_error,
        "in_problem": effect.in_problem,
        "counterpart": effect.counterpart,
        "evidence": {
            **{name: getattr(effect, name) for name in EVIDENCE},
            "bootstrap_frequency": effect.frequency,
            "at_bound": list(effect.at_bound),
        },
    }


def _rival(rival: Rival) -> dict[str, Any]:
    named = asdict(rival)
    return named | {"separating_measurement": named.pop("measurement")}


RMSE = "{}: rmse {:.4g} -> {:.4g} {} on held-out rows; noise {:.4g}"
BATCH_DISTANCE_TEXT = (
    "{}: distance of the batch from the model's population {:.4g} -> {:.4g} {} on held-out units; chance {:.4g}"
)


GapOutcome = CommandOutcome[GapResult | None]


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
    with own_folder(out, "gap", resume, overwrite) as place:
        if resume and is_complete(place, identity):
            return GapOutcome("done", out, (*summary_of(out), f"{out} was complete already"), None)
        replicates = open_replicates(place, identity, resume)
        try:
            result = analysis_result(plan, data, workers, progress, replicates)
            lines = lines_of(result)
            with writing(replicates.save_steps):
                write(result, out, lines)
                replicates.close()  # what the manifest lists is not written again
                place.complete()
        except KeyboardInterrupt:
            replicates.save_steps()
            return GapOutcome("interrupted", out, (_saved_message(replicates, plan.settings.bootstrap),), None)
    return GapOutcome("done", out, lines, result)


def _saved_message(replicates: Replicates, count: int) -> str:
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
    report, replicates, spread = progress or ignore_progress, replicates or Replicates(), None
    with threadpool_limits(1):
        end = ending(plan, data, report, replicates)
        if plan.settings.bootstrap and end.fit.members:
            spread = bootstrap(end.analysis, end.fit, replicates, workers, report)
        report(GapProgress("result"))
        with recording_steps(replicates.section("result")):
            return result_of(plan, data, end, spread)


def ending(
    plan: GapPlan, data: GapData, report: Report = ignore_progress, replicates: Replicates | None = None
) -> Ending:
    """The final result of data in memory; `replicates` begin once the model accepts them.

    Raises InputError where the data are outside of the model's range.
    """
    report(GapProgress("columns of the library"))
    replicates = replicates or Replicates()

    @contextmanager
    def begun() -> Iterator[None]:
        replicates.begin()
        with recording_steps(replicates.section("setup")):
            yield

    with recording_steps(replicates.section("prediction")):
        setup = prepare_setup(plan, data, begun)
    report(GapProgress("search"))
    with recording_steps(replicates.section("search")):
        return fit_all_rows(never_worse(finish_analysis(analysed(setup))), data)


def result_of(plan: GapPlan, data: GapData, end: Ending, spread: Spread | None = None) -> GapResult:
    """The final result as records; intervals are those of the replicates where there are any."""
    analysis, setup = end.analysis, end.setup
    initial = analysis.initial_null_model
    limit = initial.search.thresholds.generic
    table, gap_sizes, attribution = residual_table(end, data), gaps(end), attribution_of(end)
    text, planned = corrected_toml(plan, end.model, analysis.scatter[:1], data.ranges), next_measurement(end)
    (error_elsewhere, split), rivals = (
        elsewhere(end),
        rival_records(end, planned.rivals if planned else {}) + inputs_instead(end, attribution),
    )
    return GapResult(
        title=plan.labels.name or plan.model_name,
        verdict="ambiguous" if end.verdict == "named" and rivals else end.verdict,
        outputs=tuple(Axis(o.name, o.unit, o.meaning) for o in data.outputs),
        inputs=tuple(Axis(c.name, c.unit, c.meaning) for c in data.inputs),
        gate=gate(end),
        where=(
            *regions_of_prediction(setup, end.fit, table),
            *regions(initial.setup, initial.search.fitter, initial.generic, initial.null_fit, limit),
        )
        if analysis.significant
        else (),
        scores=scores(end),
        steps=analysis.steps,
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
        elsewhere=error_elsewhere,
        split=split,
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
    if removed := removed_effects(analysis):
        notes.append(
            f"{', '.join(removed)}: something similar is present, but its form differs, or its size is not determined"
        )
    if far := far_move_note(end):
        notes.append(far)
    if len(end.setup.library) == 0:
        notes.append("no effect of the library applies to this model with these columns")
    return tuple(notes)


def _elsewhere(result: GapResult, output: str, unit: str) -> str:
    """The error of an output in other parts of the record, in words."""
    error, split = result.elsewhere[output], result.split
    ends = [
        f"{split[name][output]:.4g} {unit} by {name}" for name in ("interpolation", "extrapolation") if name in split
    ]
    inside = f" ({', '.join(ends)})" if ends else ""
    parts = f"{split['parts']} parts by {split['by']}"
    return f"{output}: rmse {error:.4g} {unit}{inside} where each of {parts} is predicted by the others"


def lines_of(result: GapResult) -> tuple[str, ...]:
    """A short summary for the terminal."""
    lines = mechanism_lines(result.summary)
    lines += result.drawing.lines() if result.drawing else ()
    lines.append(f"{result.verdict}: {result.summary['rows']} rows")
    words = RMSE if result.summary["gap_is"] == OF_ROWS else BATCH_DISTANCE_TEXT
    for output in result.outputs:
        before, after, floor = (gap[output.name] for gap in (result.gap_before, result.gap_after, result.noise_floor))
        lines.append(words.format(output.name, before, after, output.unit, floor))
    lines += [_elsewhere(result, output.name, output.unit) for output in result.outputs if result.elsewhere]
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

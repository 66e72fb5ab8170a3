"""Units of `rv_reducer` whose processes differ from the samples' estimates, and their promise.

A state of the processes scales the scatter of measured errors and moves their means; the units are
built and measured as usual. The promised fraction keeps the limit where its quantile of the
largest backlash does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...models.rv_reducer.population.gradient import Slopes
from ...models.rv_reducer.population.turn import Population
from ...models.rv_reducer.population.unit_basis import stem
from ..arrays import Array, Flags
from ..process_problem import Shortfall
from ..promise import PLUG_IN, PROMISED, YIELD
from .evaluation import Evaluation, Populations

if TYPE_CHECKING:
    from .promising import PromisingUnits

WORST = "backlash_max_arcmin"
POSITION = "pin_position"
"""The error whose mean turns the unit, and moves nothing."""


def shifting(problem: PromisingUnits) -> Flags:
    """Which means (k,) of measured errors move the outputs of the units."""
    return np.array(
        [problem.settings.variables[name].mid is not None and stem(name) != POSITION for name in problem.known],
        dtype=bool,
    )


def deviations(problem: PromisingUnits, row: Mapping[str, float]) -> Array:
    """Standard deviations (k,) of the measured errors by the estimates."""
    laws = (problem.settings.variables[name].distribution for name in problem.known)
    return np.array(
        [
            law.sigma * row[name]  # type: ignore[union-attr]
            for law, name in zip(laws, problem.known, strict=True)
        ]
    )


def evaluation_at(problem: PromisingUnits, design: Array, scale: Array, shift: Array, searching: bool) -> Evaluation:
    """A full design (all,) at one state (k,) of the processes."""
    row, means = problem.as_built(design)
    moved = shift * deviations(problem, row) * problem.shifting
    for name, widening, more in zip(problem.known, scale, moved, strict=True):
        row[name] *= float(widening)
        means[stem(name)] = means.get(stem(name), 0.0) + float(more)
    return Evaluation(problem.promised_model, problem.populations(searching), row, means)


def slopes_at(problem: PromisingUnits, design: Array, evaluation: Evaluation, name: str) -> tuple[Array, Array]:
    """Derivatives (k,) of an output by scales and shifts, at the state of an evaluation."""
    row, _ = problem.as_built(design)
    slopes, means = evaluation.gradient(name), evaluation.slopes_of_means(name)
    by_scale = np.array([row[variable] * slopes[variable] for variable in problem.known])
    by_mean = np.array([means[variable] for variable in problem.known])
    return by_scale, by_mean * deviations(problem, row) * problem.shifting


def shortfall(problem: PromisingUnits, design: Array, scales: Array, shifts: Array, searching: bool) -> Shortfall:
    """Quantiles [arcmin] above the limit of the backlash."""
    limit, moving = problem.model.conditions.limit, problem.shifting
    values, slopes, error = np.empty(len(scales)), [], 0.0
    for at, (scale, shift) in enumerate(zip(scales, shifts, strict=True)):
        evaluation = evaluation_at(problem, design, scale, shift, searching)
        values[at] = evaluation.value(WORST) - limit
        by_scale, by_shift = slopes_at(problem, design, evaluation, WORST)
        slopes.append(np.append(by_scale, by_shift[moving]))
        error = evaluation.error(WORST)
    return Shortfall(values, error, np.array(slopes))


def add_gradient(
    problem: PromisingUnits, designs: Array, gradients: dict[str, Array], by_mean: dict[str, dict[str, Array]]
) -> None:
    """Add derivatives of the promised yield to those of the other outputs: by variables, and by the
    means of errors that machines make. The processes of an assured yield are held fixed.
    """
    promise = problem.settings.promise
    if promise is None or promise.statement == PLUG_IN:
        return
    rows, means = ([], {tolerance: np.zeros(len(designs)) for tolerance in problem.machined_tolerances})
    for at, design in enumerate(designs):
        state, evaluation = problem.promised_units(design)
        slopes = evaluation.gradient(YIELD)
        by_means = evaluation.slopes_of_means(YIELD) if np.any(problem.shifting) or problem.machined_tolerances else {}
        row, _ = problem.as_built(design)
        moved = state[1] * deviations(problem, row) * problem.shifting
        for name, wider, more in zip(problem.known, state[0], moved, strict=True):
            slopes[name] = float(wider) * slopes[name]
            slopes[name] += by_means.get(name, 0.0) * more / row[name] if more else 0.0
        rows.append([slopes.get(v.name, 0.0) for v in problem.variables])
        for tolerance in problem.machined_tolerances:
            means[tolerance][at] = by_means[tolerance]
    gradients[PROMISED], by_mean[PROMISED] = np.array(rows).reshape(designs.shape), means


def mixed(problem: PromisingUnits, drawn: Populations, stream: int) -> Populations:
    """The same units, each by processes drawn for it alone: their yield is the expected one."""

    def draw(positions: int, units: int) -> Population:
        population = drawn.draw(positions, units)
        z = dict(population.sample.z)
        for at, (name, knowledge) in enumerate(problem.known.items()):
            rng = np.random.default_rng([problem.settings.seed, stream, 1 + at])
            variance, error = knowledge.drawn(units, rng)
            law = problem.settings.variables[name].distribution
            off = error * law.sigma * problem.shifting[at]  # type: ignore[union-attr]
            for key in (
                error for error in z if error.removesuffix("_radial").removesuffix("_tangential") == stem(name)
            ):
                z[key] = z[key] * np.sqrt(variance) + off
        sample = replace(population.sample, z=z)
        return replace(population, sample=sample, slopes=Slopes.of(population.lattice.geometry, sample))

    return Populations(draw, drawn.sizes)

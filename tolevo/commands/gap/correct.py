"""`corrected.toml`, its test of delays, and the final fit on every row of a thinned record."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
import tomli_w

from ...configuration.plugins import RECORD
from ...errors import InputError
from ...models.effects.instrument import Delay
from ...models.inputs import Zone
from ...section import Array
from ...units import split_unit
from .close import Corrected, refit_corrected_model, widened
from .data import GapData
from .fit import Fit, Fitter, Member, Space, is_term
from .generic import table_of
from .linear import project_out
from .noise import Noise, outliers, size_follows
from .plan import GapPlan
from .population import Scatter
from .records import FoundEffect
from .result import Ending
from .setup import move_setup, values_of

NO_RANGES: Mapping[str, list[float]] = {}


def corrected_toml(
    plan: GapPlan, model: Corrected, scatter: tuple[Scatter, ...] = (), record: Mapping[str, list[float]] = NO_RANGES
) -> str:
    """The run configuration (where there is one) with model, parameters, zeros and effects.

    `record` is the least and largest value of each input in the measurements.
    """
    configuration: dict[str, Any] = deepcopy(dict(plan.run))
    if not configuration:
        configuration = {k: deepcopy(v) for k, v in plan.tables.items() if k not in ("effect", "unresolved")}
    configuration["model"] = plan.model_name
    configuration.setdefault("seed", plan.seed)
    parameters = dict(configuration.get("parameters", {})) | dict(plan.stated_parameters)
    for name, value in model.free().items():
        table, dot, key = name.partition(".")
        if dot:
            parameters[table] = {**parameters.get(table, {}), key: value}
        else:
            parameters[name] = value
    if parameters:
        configuration["parameters"] = parameters
    if "variables" in configuration:
        configuration["variables"] = _at_mids(configuration["variables"], model.free())
    if turned := {name: sense for name, sense in plan.sense.items() if sense < 0}:
        configuration["sense"] = turned
    if zero := zeros_with(plan, model):
        configuration["zero"] = zero
    terms = [table_of(member, model.effect(member.name)) for member in model.members if is_term(member)]
    more = [
        {"name": member.name, **member.candidate.effect.stated(), "parameters": model.effect(member.name)}
        for member in model.members
        if not is_term(member)
    ]
    # first: what moves units is not stretched with their scatter
    first = [
        {"name": scatter_effect.candidate.name, "parameters": scatter_effect.numbers} for scatter_effect in scatter
    ]
    effects = [*first, *configuration.get("effect", []), *plan.tables.get("effect", []), *more]
    if effects:
        configuration["effect"] = effects
    if terms := [*configuration.get("unresolved", []), *plan.tables.get("unresolved", []), *terms]:
        configuration["unresolved"] = terms
    if record and (effects or terms):
        configuration[RECORD] = dict(record)
    if plan.model is None:
        configuration |= {"columns": {name: _column(column) for name, column in plan.columns.items()}}
    scalars = {k: v for k, v in configuration.items() if not isinstance(v, dict | list)}
    return tomli_w.dumps(_toml_value({**scalars, **configuration}))


def _at_mids(variables: Mapping[str, Any], free: Mapping[str, float]) -> dict[str, Any]:
    """The `[variables]` with the mid-limits that were recalibrated, where they state any."""
    updated = dict(variables)
    for name, variable in variables.items():
        mid = free.get("{}_mid_{}".format(*split_unit(name)))
        if mid is not None and "limits" in variable:
            half = Zone.of_text(variable["limits"]).half_width
            kept = {key: value for key, value in variable.items() if key != "limits"}
            updated[name] = {"value": half, "mid": mid, **kept}
        elif mid is not None and "mid" in variable:
            updated[name] = {**variable, "mid": mid}
    return updated


def in_problem(plan: GapPlan, text: str, effects: tuple[FoundEffect, ...]) -> tuple[FoundEffect, ...]:
    """The effects with their counterparts in the problem whose allocation is to be repeated."""
    if plan.counterparts is None:
        return effects
    name = plan.run["problem"]
    none = f"no counterpart in {name}: the allocation does not change"
    counterparts: Mapping[str, str] = {}
    try:
        counterparts = plan.counterparts(text)
    except InputError as error:
        why = "; ".join(f"{fault.place}: {fault.message}" for fault in error.faults)
        none = f"{name} does not accept it: {why}"
    pairs = [(effect, counterparts.get(effect.name, "")) for effect in effects]
    return tuple(replace(effect, in_problem=bool(what), counterpart=what or none) for effect, what in pairs)


def zeros_with(plan: GapPlan, model: Corrected) -> dict[str, float]:
    """What the instrument adds to each output: the known part plus the fitted one."""
    fitted = {number.name: value for number, value in model.numbers_of("zero")}
    return {name: plan.zero.get(name, 0.0) + fitted.get(name, 0.0) for name in {**plan.zero, **fitted}}


def _column(column: Any) -> dict[str, Any]:
    parts = {"role": column.role, "unit": column.unit, "of": column.of}
    turned = {"sense": column.sense} if column.sense < 0 else {}
    return {key: value for key, value in parts.items() if value} | turned


def _toml_value(value: Any) -> Any:
    """Values in the types of TOML."""
    if isinstance(value, Mapping):
        return {str(key): _toml_value(entry) for key, entry in value.items() if entry is not None}
    if isinstance(value, list | tuple):
        return [_toml_value(entry) for entry in value]
    return value.item() if hasattr(value, "item") else value


# Test of a delay: a true one shifts rising and falling, high and low rows by the same time.
#
# An effect that opens or rounds a loop differently for growing and falling load looks like a delay
# that differs there. The delay is estimated in each of the four kinds of rows, all else fitted with
# it.

STEP = 1e-2
"""Relative step of a derivative."""
CHANCE = 0.01
"""Probability that a single delay is taken for several."""
MIN_KIND_FRACTION = 1e-6
"""Fraction of the squares of all rows below which a kind of rows carries no information."""
MIN_DELAY_SCATTER = 0.15
"""Rms difference of the delays from their mean, as a fraction of it, from which a note is given."""
STRETCHES = 40
"""Stretches of the record, the clusters of the residual."""


def uneven_delays(fitter: Fitter, fit: Fit, data: GapData) -> list[str]:
    """Sentences about delays that are not the same throughout the record."""
    sentences = []
    for at, member in enumerate(fit.members):
        if not isinstance(member.candidate.effect, Delay):
            continue
        q = fitter.spanned(fit.without(at))
        for name, late in member.shape.items():
            if late != 0.0 and (delays := _delays_by_kind(fitter, fit, q, member, name, data)) is not None:
                sentences.append(_sentence(name, delays))
    return sentences


def _sentence(name: str, delays: Array) -> str:
    kinds = ("rise above the median", "fall above it", "rise below it", "fall below it")
    pairs = zip(delays.tolist(), kinds, strict=True)
    parts = ", ".join(f"{delay:.3g} s where measurements {kind}" for delay, kind in pairs)
    return (
        f"{name} differs between kinds of rows: {parts}. A late channel is equally late everywhere; "
        "this may be an unidentified part of the loop"
    )


def _delays_by_kind(fitter: Fitter, fit: Fit, q: Array, member: Member, name: str, data: GapData) -> Array | None:
    """The delays (4,) of each kind of rows; None where they may be the same.

    Wald's test of equal delays. Their covariance is the larger of two: white noise at the level of
    the residual, and the residual itself by stretches (Liang and Zeger 1986).
    """
    late = member.shape[name]
    ends = [{**member.shape, name: late * (1.0 + sign * STEP)} for sign in (1.0, -1.0)]
    longer, shorter = (fitter.columns.of(member.candidate, shape)[:, 0] for shape in ends)
    slope = (longer - shorter) / (2.0 * STEP * late)
    parts = [fitter.space.whiten(np.where(kind, slope, 0.0)) for kind in _kinds(slope, data).T]
    g = project_out(np.column_stack(parts), q)
    if (np.sum(g**2, axis=0) < MIN_KIND_FRACTION * np.sum(g**2)).any():
        return None
    corrections, covariance = _estimate_coefficients(g, fit.residual)
    contrast = np.eye(len(corrections))[1:] - np.eye(len(corrections))[0]
    differences = contrast @ corrections
    spread = contrast @ covariance @ contrast.T
    statistic = float(differences @ np.linalg.solve(spread, differences)) / len(differences)
    weights = np.sum(g**2, axis=0) / np.sum(g**2)
    scatter = np.sqrt(float(weights @ (corrections - weights @ corrections) ** 2))
    limit = float(scipy.special.fdtri(len(differences), STRETCHES - 1, 1.0 - CHANCE))
    return late + corrections if statistic > limit and scatter > MIN_DELAY_SCATTER * abs(late) else None


def _kinds(slope: Array, data: GapData) -> Array:
    """Rows (N, 4) that are high or low and rise or fall: what rises, falls with its delay."""
    measured = data.stacked(data.measured)
    kinds = np.zeros((len(slope), 4), dtype=bool)
    for at in range(len(data.outputs)):
        rows = data.rows_of(at)
        high = measured[rows] > np.median(measured[rows])
        up, down = slope[rows] < 0.0, slope[rows] > 0.0
        kinds[rows] = np.column_stack([high & up, high & down, ~high & up, ~high & down])
    return kinds


def _estimate_coefficients(g: Array, residual: Array) -> tuple[Array, Array]:
    """Least squares of columns (N, 4) on a residual (N,): coefficients and their covariance."""
    inverse = np.linalg.pinv(g.T @ g, rcond=1e-12)
    coefficients = inverse @ (g.T @ residual)
    rest = residual - g @ coefficients
    edges = np.linspace(0, len(residual), STRETCHES + 1).astype(int)
    sums = np.array([g[a:b].T @ rest[a:b] for a, b in pairwise(edges)])
    white_noise = inverse * float(rest @ rest) / len(rest)
    return coefficients, widened(white_noise, inverse @ (sums.T @ sums) @ inverse)


WANDERS = 3.0
"""Standard errors from which neighbouring rows count as autocorrelated."""
MAX_NOISE_ROWS = 200_000
"""Rows from which the size of the noise is estimated, at most."""


def fit_all_rows(end: Ending, full: GapData) -> Ending:
    """The result with its parameters fitted to all rows, and intervals that shrink accordingly.

    The effects and the generic terms are those of the search; their parameters, the noise and its
    autocorrelation from row to row are those of the whole record.
    """
    setup = end.setup
    if len(full) == len(setup.data) or full.target.population:
        return end
    whole = move_setup(replace(setup, data=full), setup.at, {})
    predicted = end.model.predicted(full)
    residuals = [full.measured[o.name] - predicted[o.name] for o in full.outputs]
    space = Space(tuple(_noise(end, full, at, residual) for at, residual in enumerate(residuals)), setup.prior)
    return replace(end, model=refit_corrected_model(whole, space, end.fit, end.model).widened(end.model.added_variance))


def _noise(end: Ending, full: GapData, at: int, residual: Array) -> Noise:
    """The noise of one output, from its residual (n,) given the final model."""
    name, search_noise = full.outputs[at].name, end.analysis.search.fitter.space.noises[at]
    size = full.std[name] if name in full.std else np.ones(len(full))
    good = outliers(residual, size)
    known = name in full.std or search_noise.source == "configuration"
    if search_noise.varies_with and not known:
        size = _size(full, residual, good)
    scale = 1.0 if name in full.std else float(np.sqrt(np.mean((residual[good] / size[good]) ** 2)))
    scale = search_noise.level if search_noise.source == "configuration" else scale
    sigma = size * scale
    rho = _neighbours(np.where(good, residual / sigma, 0.0))
    return Noise(sigma, search_noise.source, rho, None if good.all() else good, search_noise.varies_with)


def _size(full: GapData, residual: Array, good: np.ndarray) -> Array:
    """The relative size (n,) of the noise, where it depends on an input."""
    rows = np.linspace(0, len(full) - 1, min(len(full), MAX_NOISE_ROWS)).astype(np.int64)
    inputs = values_of(full.some(rows))
    follows = size_follows(residual[rows], inputs, good[rows])
    if follows is None:
        return np.ones(len(full))
    name, size = follows
    order = np.argsort(inputs[name], kind="stable")
    return np.asarray(np.interp(values_of(full)[name], inputs[name][order], size[order]))


def _neighbours(white: Array) -> float:
    """Autocorrelation of each row with the next, 0 where it is not significant."""
    rho = float(white[1:] @ white[:-1] / max(float(white @ white), 1e-300))
    return float(np.clip(rho, 0.0, 0.99)) if rho * np.sqrt(len(white)) > WANDERS else 0.0

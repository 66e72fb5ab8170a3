"""The final fit on every row of a record that was thinned for the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Array
from .close import refitted
from .data import GapData
from .noise import Noise, outliers, size_follows
from .result import Ending
from .setup import moved_to, values_of
from .space import Space

WANDERS = 3.0
"""Standard errors from which neighbouring rows count as autocorrelated."""
MOST = 200_000
"""Rows from which the size of the noise is estimated, at most."""


def on_all_rows(end: Ending, full: GapData) -> Ending:
    """The result with its parameters fitted to all rows, and intervals that shrink accordingly.

    The effects and the generic terms are those of the search; their parameters, the noise and its
    autocorrelation from row to row are those of the whole record.
    """
    setup = end.setup
    if len(full) == len(setup.data) or full.target.population:
        return end
    whole = moved_to(replace(setup, data=full), setup.at, {})
    predicted = end.model.predicted(full)
    residuals = [full.measured[o.name] - predicted[o.name] for o in full.outputs]
    space = Space(tuple(_noise(end, full, at, residual) for at, residual in enumerate(residuals)), setup.prior)
    return replace(end, model=refitted(whole, space, end.fit, end.model).widened(end.model.added_variance))


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
    rows = np.linspace(0, len(full) - 1, min(len(full), MOST)).astype(np.int64)
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

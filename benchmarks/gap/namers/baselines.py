"""Namers that must fail: always the same name, plain BIC, and the lasso."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from math import log
from typing import Any

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LassoCV

from benchmarks.gap.generator.kinds import KINDS
from benchmarks.gap.generator.records import Record, Truth
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.scoring.rivals import RIVALS, Rival, least_left, without

MOST = 4
"""Effects that a greedy namer may add."""

Namer = Callable[[Record, Truth], dict[str, Any]]


def said(names: list[str], after: float) -> dict[str, Any]:
    effects = [{"name": name} for name in dict.fromkeys(names)]
    word = "named" if effects else "no_gap"
    return {"verdict": word, "effects": effects, "alternatives": [], "gap_after": after}


def residual(record: Record, truth: Truth) -> Array:
    output = KINDS[truth.kind].outputs[0]
    return (record.table[output] - record.table[f"{output}_predicted"]).to_numpy(dtype=float)


def always_compliance(record: Record, truth: Truth) -> dict[str, Any]:
    rival = RIVALS[truth.kind][0]
    left = least_left(rival, truth.points, truth.free, residual(record, truth))[0]
    return said(["torsional_compliance"], float(np.sqrt(left / len(truth.points))))


def plain_bic(record: Record, truth: Truth) -> dict[str, Any]:
    """Forward selection as long as n ln(RSS) + k ln(n) falls."""
    what, free, at = residual(record, truth), truth.free, truth.points
    n = len(at)
    names: list[str] = []
    left = float((without(free, what) ** 2).sum())
    while len(names) < MOST:
        fits = [(*least_left(one, at, free, what), one) for one in RIVALS[truth.kind]]
        scores = [n * log(rss / left) + one.count * log(n) for rss, _, one in fits]
        best = int(np.argmin(scores))
        if scores[best] >= 0.0:
            break
        left, p, rival = fits[best]
        names.append(rival.name)
        free = np.hstack([free, rival.columns(at, p)])
    return said(names, float(np.sqrt(left / n)))


def middle(rival: Rival) -> Array:
    return np.array([grid[len(grid) // 2] for grid in rival.grids])


def lasso(record: Record, truth: Truth) -> dict[str, Any]:
    """Every name whose columns, at the middle of their grids, keep a coefficient."""
    blocks = [(one.name, one.columns(truth.points, middle(one))) for one in RIVALS[truth.kind]]
    names = np.repeat([name for name, _ in blocks], [block.shape[1] for _, block in blocks])
    columns = np.hstack([block for _, block in blocks])
    columns = (columns - columns.mean(axis=0)) / np.maximum(columns.std(axis=0), 1e-12)
    what = residual(record, truth)
    what = (what - what.mean()) / what.std()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        fitted = LassoCV(cv=3, max_iter=2000, alphas=30, precompute=True).fit(columns, what)
    kept = [str(name) for name in names[np.abs(fitted.coef_) > 1e-9]]
    error = residual(record, truth).std() * float(np.std(what - fitted.predict(columns)))
    return said(kept, error)


BASELINES: dict[str, Namer] = {
    "always compliance": always_compliance,
    "plain BIC": plain_bic,
    "LassoCV": lasso,
}

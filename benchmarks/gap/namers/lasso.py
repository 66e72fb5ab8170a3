"""The lasso (Tibshirani 1996), its penalty by cross-validation."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LassoCV

from benchmarks.gap.generator.records import Record
from benchmarks.gap.namers.seen import dictionary, said_of, seen, standardised


def lasso(record: Record) -> dict[str, Any]:
    """Every name of the dictionary that keeps a coefficient at the penalty that predicts best."""
    found = seen(record)
    of = dictionary(found)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        fitted = LassoCV(cv=3, max_iter=2000, alphas=30, precompute=True).fit(of.columns, standardised(found.left))
    return said_of(found, of, np.asarray(np.abs(fitted.coef_) > 1e-9, dtype=np.bool_))

"""Rivals of other packages, in `.venv-bench`: PySINDy over the dictionary, and ADCD, which searches a formula."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from math import log

import numpy as np

from benchmarks.gap.generator.records import Record
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.namers.seen import Marks, Seen, dictionary, seen, standardised
from benchmarks.gap.scoring.rivals import least_left, without

LEVELS = 8
"""Levels of a column between which the means of a gap are compared."""
ALIKE = 0.1
"""Fraction of a formula's squares that an effect may leave of it and give it its name."""
Chosen = tuple[list[str], Array]
"""Names, and columns (n, m) beside what is free, whose coefficients are fitted to the rows of the record."""
Peer = Callable[[Record, Marks], Chosen]


def pysindy(whole: Record, rows: Marks) -> Chosen:
    """What the package's STLSQ (Brunton, Proctor and Kutz 2016) keeps of the dictionary in some rows, by default."""
    from pysindy.optimizers import STLSQ

    every = seen(whole)
    of = dictionary(every)
    fitted = STLSQ().fit(standardised(of.columns[rows]), standardised(every.left[rows])[:, None])
    kept = np.ravel(fitted.coef_) != 0.0
    names = [name for name, one in zip(of.names, kept, strict=True) if one]
    return list(dict.fromkeys(names)), of.columns[:, kept]


def adcd(whole: Record, rows: Marks) -> Chosen:
    """The correction that the package (Erdita 2026) finds of some rows without a language model, all defaults; what it
    asks for, the variable that governs, is the one between whose levels the gap differs most. It names nothing: its
    formula has the name of the effect that leaves least of it, if that is under a tenth of its squares.
    """
    import sympy
    from adcd.api import fit

    logging.getLogger("adcd").setLevel(logging.ERROR)
    every, table = seen(whole), whole.table
    output = next(name for name in map(str, table) if f"{name}_predicted" in table)
    inputs = {
        name: table[name].to_numpy(dtype=np.float64)
        for name in map(str, table)
        if name not in (output, f"{output}_predicted", "session")
    }
    governs = max(inputs, key=lambda name: _between(inputs[name][rows], every.left[rows]))
    predicted = table[f"{output}_predicted"].to_numpy(dtype=np.float64)
    measured = table[output].to_numpy(dtype=np.float64)
    some = {name: values[rows] for name, values in inputs.items()}
    found = fit(some, measured[rows], predicted[rows], governs, correction_mode="additive", verbose=False)
    column = np.zeros(len(table))
    if found.best_expr:
        formula = sympy.sympify(found.best_expr).subs(found.best_theta)
        symbols = sorted(map(str, formula.free_symbols))
        with np.errstate(all="ignore"):
            column = column + sympy.lambdify(symbols, formula, "numpy")(*(inputs[name] for name in symbols))
    column = np.nan_to_num(column, posinf=0.0, neginf=0.0)
    return _names_like(every, column), column[:, None]


def _between(x: Array, gap: Array) -> float:
    """The squares of a gap (n,) between levels of a column (n,)."""
    level = np.searchsorted(np.unique(np.quantile(x, np.arange(1, LEVELS) / LEVELS)), x)
    means = np.bincount(level, gap - gap.mean()) / np.maximum(np.bincount(level), 1)
    return float(np.sum(means[level] ** 2))


def _names_like(of: Seen, column: Array) -> list[str]:
    """The name of the effect that leaves least of a column (n,), with ln n for each number, unless it is much."""
    own = float(np.sum(without(of.free, column) ** 2))
    if own == 0.0:
        return []
    fits = [(least_left(one, of.points, of.free, column)[0] / own, one) for one in of.rivals]
    least, best = min(fits, key=lambda pair: len(of) * log(pair[0] + 1e-12) + pair[1].count * log(len(of)))
    return [best.name] if least < ALIKE else []


PEERS: Mapping[str, Peer] = {
    name: peer for name, peer in (("PySINDy", pysindy), ("ADCD", adcd)) if find_spec(name.lower()) is not None
}
"""Those that are installed."""

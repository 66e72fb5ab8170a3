"""A formula for an unidentified effect, only where it predicts held-out rows better than a spline.

It is no cause. Such a form interpolates within the data and does not extrapolate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from .unresolved import wave

KNOTS = 8
STIFF = np.geomspace(1e-4, 1e2, 7)
"""Penalties of the spline, of which the best predictor is chosen."""


@dataclass(frozen=True)
class Curve:
    """Values y (n,) over x (n,), their standard deviations, and blocks of rows held out together.

    `period` is that of x where x is periodic, else 0.
    """

    x: Array
    y: Array
    sigma: Array
    labels: NDArray[np.int64]
    period: float = 0.0


@dataclass(frozen=True)
class Formula:
    """a + b f(x), or a + b f(x) + c g(x): `columns` (n, 1 or 2) of x; `text` with {b}, {c} and {x};
    `numbers` of parameters in addition to the coefficients.
    """

    text: str
    columns: Callable[[Array], Array]
    numbers: int


def empirical(curve: Curve, name: str) -> str:
    """The formula in `name`, empty where no formula beats the spline on held-out rows."""
    from sklearn.model_selection import LeaveOneGroupOut  # takes long to import

    formulas = list(_formulas(curve))
    formula_error, spline_error = 0.0, 0.0
    for training, held_out in LeaveOneGroupOut().split(curve.x, groups=curve.labels):
        best, coefficients = _best(curve, formulas, training)
        residual = curve.y[held_out] - _design(best, curve.x[held_out]) @ coefficients
        smooth = _spline(curve, training).predict(curve.x[held_out, None])
        formula_error += float(np.sum((residual / curve.sigma[held_out]) ** 2))
        spline_error += float(np.sum(((curve.y[held_out] - smooth) / curve.sigma[held_out]) ** 2))
    if formula_error >= spline_error:
        return ""
    best, coefficients = _best(curve, formulas, np.arange(len(curve.x)))
    numbers = dict(zip("abc", (f"{value:.4g}" for value in coefficients), strict=False))
    return ("{a} + " + best.text).format(**numbers, x=name)


def _spline(curve: Curve, rows: NDArray[np.int64]) -> Any:
    """A smoothing spline through some rows."""
    from sklearn.linear_model import RidgeCV  # takes long to import
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import SplineTransformer

    splines = SplineTransformer(KNOTS, knots="quantile", extrapolation="linear")
    if curve.period:
        knots = np.linspace(0.0, curve.period, KNOTS)[:, None]
        splines = SplineTransformer(knots=knots, extrapolation="periodic")
    smooth = make_pipeline(splines, RidgeCV(STIFF))
    weights = 1.0 / curve.sigma[rows] ** 2
    return smooth.fit(curve.x[rows, None], curve.y[rows], ridgecv__sample_weight=weights)


def _best(curve: Curve, formulas: list[Formula], rows: NDArray[np.int64]) -> tuple[Formula, Array]:
    """The formula that fits some rows best, at ln n per parameter, and its coefficients."""
    x, scale = curve.x[rows], 1.0 / curve.sigma[rows]
    y, price = curve.y[rows] * scale, np.log(len(rows))
    fits = []
    for formula in formulas:
        columns = _design(formula, x) * scale[:, None]
        coefficients = np.asarray(np.linalg.lstsq(columns, y, rcond=1e-9)[0], dtype=np.float64)
        score = float(np.sum((y - columns @ coefficients) ** 2)) + price * (formula.numbers + len(coefficients))
        fits.append((score, formula, coefficients))
    return min(fits, key=itemgetter(0))[1:]


def _design(formula: Formula, x: Array) -> Array:
    return np.column_stack([np.ones_like(x), formula.columns(x)])


def _formulas(curve: Curve) -> Iterator[Formula]:
    """Every form at each of the tried values of its parameters."""
    if curve.period:
        yield Formula("{b} cos({x}) + {c} sin({x})", wave, 0)
        return
    yield Formula("{b} {x}", partial(_polynomial, degree=1), 0)
    yield Formula("{b} {x} + {c} {x}^2", partial(_polynomial, degree=2), 0)
    turns = (curve.x < 0).any() and (curve.x > 0).any()
    for odd in (False, True) if turns else (False,):
        yield from _magnitudes(float(np.abs(curve.x).max()), odd)
    for middle in np.linspace(curve.x.min(), curve.x.max(), 33):
        for width in np.ptp(curve.x) * np.geomspace(0.03, 0.5, 10):
            yield Formula(
                f"{{b}} exp(-(({{x}} - {middle:.4g})/{width:.3g})^2)", partial(_bump, middle=middle, width=width), 2
            )


def _magnitudes(largest: float, odd: bool) -> Iterator[Formula]:
    """Functions of the magnitude of x, with its sign where they are odd."""
    sign = "sgn({x}) " if odd else ""
    columns = partial(_magnitude, odd=odd)
    for power in np.geomspace(0.2, 4.0, 40):
        yield Formula(f"{{b}} {sign}|{{x}}|^{power:.3g}", partial(columns, of=lambda r, p: r**p, at=power), 1)
    for size in largest * np.geomspace(0.02, 3.0, 30):
        exponential, logarithm = f"(1 - exp(-|{{x}}|/{size:.3g}))", f"ln(1 + |{{x}}|/{size:.3g})"
        yield Formula(f"{{b}} {sign}{exponential}", partial(columns, of=lambda r, s: -np.expm1(-r / s), at=size), 1)
        yield Formula(f"{{b}} {sign}{logarithm}", partial(columns, of=lambda r, s: np.log1p(r / s), at=size), 1)


def _polynomial(x: Array, degree: int) -> Array:
    return np.column_stack([x**power for power in range(1, degree + 1)])


def _magnitude(x: Array, of: Callable[[Array, float], Array], at: float, odd: bool) -> Array:
    """A function of |x| with one parameter, with the sign of x if odd."""
    values = of(np.abs(x), at)
    return np.sign(x) * values if odd else values


def _bump(x: Array, middle: float, width: float) -> Array:
    return np.asarray(np.exp(-(((x - middle) / width) ** 2)))

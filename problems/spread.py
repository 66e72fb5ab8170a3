"""S of every requirement of a form: roots and quantiles, with the tangents that bound them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .forms import Form

LEAST = 1e-100
"""A smaller value counts as no spread: a price per square of it would overflow."""
ROUNDING = 1e-14
"""Relative allowance for the rounding of the tangent of a norm."""


@dataclass(frozen=True, slots=True)
class Spread:
    """S (n, r) at parts s, its derivatives (n, r, features), and S >= intercept + direction . s.

    The `intercept` (n, r) is lowered by what rounding and an unfinished series may add; it needs
    the largest parts that are considered.
    """

    value: Array
    direction: Array
    intercept: Array


def spread_of(form: Form, s: Array, most: Array | None = None) -> Spread:
    """S at parts s (n, r, features); `most` (r, features) are the largest ones considered."""
    towards = s if form.correlation is None else s @ form.correlation
    square = np.maximum(form.constant + np.sum(towards * s, axis=2), 0.0)
    value = np.sqrt(square)
    safe = np.where(value > 0.0, value, 1.0)
    direction, intercept = towards / safe[..., None], form.constant / safe
    for row, surplus in enumerate(form.surpluses):
        if surplus is not None:  # a norm: its tangent planes lie below it
            more, rise = surplus.value(s[:, row] ** 2)
            root = np.sqrt(square[:, row] + more)
            safe_root = np.where(root > 0.0, root, 1.0)[:, None]
            value[:, row] = root
            direction[:, row] = (towards[:, row] + s[:, row] * rise) / safe_root
            along = np.sum(direction[:, row] * s[:, row], axis=1)
            intercept[:, row] = (root - along) - ROUNDING * (root + np.abs(along))
    if form.joint is not None:
        rows = form.joint.rows
        tangent = form.joint.tangent(s[:, rows], sure=most is not None)
        doubt = tangent.value_error
        if most is not None:
            with np.errstate(invalid="ignore"):
                reach = np.where(most[rows] != 0.0, tangent.gradient_error * np.abs(most[rows]), 0.0)
            doubt = doubt + np.where(np.isfinite(reach), reach, np.inf).sum(axis=2)
        value[:, rows], direction[:, rows] = tangent.value, tangent.gradient
        intercept[:, rows] = tangent.value - np.sum(tangent.gradient * s[:, rows], axis=2) - doubt
    return Spread(np.where(value > LEAST, value, 0.0), direction, intercept)


def largest_parts(form: Form) -> Array:
    """The largest parts (r, features) of any way."""
    return np.stack(
        [
            np.max([np.abs(np.multiply(way.spread, way.high)) for way in feature.ways], axis=0)
            for feature in form.features
        ],
        axis=1,
    )

"""Tabulated costs that are not convex, as several ways with convex ones."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...models.costs import Table
from ...problems.forms import Form, Way


def convex_pieces(form: Form) -> Form:
    """The form with every way cut where its table bends down: each piece is convex."""
    if all(way.curve.convex for feature in form.features for way in feature.ways):
        return form
    return replace(
        form,
        features=tuple(
            replace(feature, ways=tuple(piece for way in feature.ways for piece in _pieces(way)))
            for feature in form.features
        ),
    )


def _pieces(way: Way) -> list[Way]:
    if not isinstance(way.curve, Table):
        return [way]
    t, slopes = np.array(way.curve.t), np.diff(way.curve.cost_at) / np.diff(way.curve.t)
    bends = t[1:-1][np.diff(slopes) < 0.0]
    edges = [way.low, *bends[(bends > way.low) & (bends < way.high)].tolist(), way.high]
    return [
        replace(way, curve=_part(way.curve, low, high), low=low, high=high)
        for low, high in pairwise(edges)
    ]


def _part(table: Table, low: float, high: float) -> Table:
    """The table between two tolerances, low below high."""
    inner = [(t, c) for t, c in zip(table.t, table.cost_at, strict=True) if low < t < high]
    first, last = (float(table.cost(np.array([end]))[0]) for end in (low, high))
    t, cost = zip((low, first), *inner, (high, last), strict=True)
    return Table(t, cost)

"""Costs that are not convex, as several ways with convex ones."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from ...problems.forms import Form, Way


def convex_pieces(form: Form) -> Form:
    """The form with every way cut where its cost curve bends down: in each piece it is convex."""
    return replace(
        form,
        features=tuple(
            replace(feature, ways=tuple(piece for way in feature.ways for piece in _pieces(way)))
            for feature in form.features
        ),
    )


def _pieces(way: Way) -> list[Way]:
    edges = [way.low, *(t for t in way.curve.bends if way.low < t < way.high), way.high]
    return [replace(way, low=low, high=high) for low, high in pairwise(edges)]

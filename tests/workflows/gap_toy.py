"""A search for names over given columns: no data, no library, white noise of size 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np

from tolevo.models.effects import EffectParameter
from tolevo.workflows.gap.fit import Fitter, Member
from tolevo.workflows.gap.library import Candidate
from tolevo.workflows.gap.linear import joined
from tolevo.workflows.gap.noise import Noise
from tolevo.workflows.gap.plan import GapSettings
from tolevo.workflows.gap.scan import Dictionary, Thresholds
from tolevo.workflows.gap.select import Search
from tolevo.workflows.gap.space import Space

Array = np.ndarray
N = 100
PENALTY = float(np.log(N))


def member(
    name: str, linear: int = 1, low: float = -inf, family: str = "load", **more: Any
) -> Member:
    """A name with so many coefficients, each not below `low`; `unread` and `shape` as they are."""
    numbers = tuple(EffectParameter(f"c{k}", "", "", low) for k in range(linear))
    shape = tuple(EffectParameter(one, "", "", linear=False) for one in more.get("shape", {}))
    effect = SimpleNamespace(name=name, family=family, needs=())
    candidate = Candidate(effect, numbers, shape, more.get("unread", False))  # type: ignore[arg-type]
    return Member(candidate, more.get("shape", {}))


class Given:
    """Columns (N, m) by name; those of a name with a place are of a function of it."""

    def __init__(self, columns: Mapping[str, Any]) -> None:
        self.columns = columns

    def of(self, candidate: Candidate, shape: Mapping[str, float]) -> Array:
        own = self.columns[candidate.name]
        found = own(*shape.values()) if callable(own) else own
        return np.asarray(found, dtype=float).reshape(N, -1)


def toy(
    members: Sequence[Member], columns: Mapping[str, Any], y: Array, limit: float = 10.0,
    blocks: int = 10, **settings: Any,
) -> Search:  # fmt: skip
    """A search beside a free constant; blocks are of every so many rows."""
    space, given = Space((Noise(np.ones(N), "given"),)), Given(columns)
    fitter = Fitter(space, y, np.ones((N, 1)), given, np.zeros(0))  # type: ignore[arg-type]
    parts = [given.of(one.candidate, one.shape) for one in members]
    groups = joined(parts, [one.candidate.one_sided for one in members], N)
    book = Dictionary(tuple(members), groups)
    labels = np.arange(N) % blocks
    return Search(fitter, book, book.white(space), Thresholds(limit, 20.0), labels,
                  GapSettings(**settings))  # fmt: skip


def directions(count: int, seed: int = 1) -> Array:
    """Orthonormal columns (N, count) without a mean."""
    drawn = np.random.default_rng(seed).normal(size=(N, count))
    return np.linalg.qr(np.column_stack([np.ones(N), drawn]))[0][:, 1:]


def squares_left(columns: Sequence[Array], y: Array) -> float:
    """Of least squares by a constant and these columns, by numpy alone."""
    x = np.column_stack([np.ones(N), *columns])
    return float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2))

"""A search for names over given columns: no data, no library, white noise of size 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from types import SimpleNamespace
from typing import Any

import numpy as np

from tolevo.commands.gap.analysis import Settling
from tolevo.commands.gap.data import GapData
from tolevo.commands.gap.fit import Fit, Fitter, Member, Space
from tolevo.commands.gap.generic import generic
from tolevo.commands.gap.library import Candidate
from tolevo.commands.gap.linear import join_groups
from tolevo.commands.gap.noise import Noise
from tolevo.commands.gap.plan import GapSettings
from tolevo.commands.gap.scan import Dictionary, Remaining, Thresholds
from tolevo.commands.gap.selection import Search
from tolevo.models.effects import Effect, EffectParameter
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.effects.unresolved import Form, Unresolved
from tolevo.models.measurable import Column, Role
from tolevo.section import Output

Array = np.ndarray
N = 100
PENALTY = float(np.log(N))


def member(name: str, linear: int = 1, low: float = -inf, family: str = "load", **more: Any) -> Member:
    """A name with so many coefficients, each not below `low`; `unread` and `shape` as they are."""
    numbers = tuple(EffectParameter(f"c{k}", "", "", low) for k in range(linear))
    shape = tuple(EffectParameter(one, "", "", linear=False) for one in more.get("shape", {}))
    effect = SimpleNamespace(
        name=name, family=family, yields_to="", reach="", needs=(), together=more.get("together", 1)
    )
    candidate = Candidate(effect, numbers, shape, more.get("unread", False))  # type: ignore[arg-type]
    return Member(candidate, more.get("shape", {}))


class Given:
    """Columns (N, m) by name; those of a name with a place are of a function of it, and those of a
    term are its own at the data.
    """

    def __init__(self, columns: Mapping[str, Any], data: GapData | None = None) -> None:
        self.columns, self.data = columns, data

    def of(self, candidate: Candidate, shape: Mapping[str, float]) -> Array:
        if isinstance(candidate.effect, Unresolved):
            assert self.data is not None
            return candidate.effect.columns(self.data.measurements)
        own = self.columns[candidate.name]
        found = own(*shape.values()) if callable(own) else own
        return np.asarray(found, dtype=float).reshape(N, -1)

    def kinds_of_rows(self, effect: Effect) -> None:
        """All rows are of one kind."""


def toy(
    members: Sequence[Member], columns: Mapping[str, Any], y: Array, limit: float = 10.0,
    data: GapData | None = None, **settings: Any,
) -> Search:  # fmt: skip
    """A search beside a free constant; each of ten blocks is of every tenth row."""
    space, given = Space((Noise(np.ones(N), "given"),)), Given(columns, data)
    fitter = Fitter(space, y, np.ones((N, 1)), given, np.zeros(0))  # type: ignore[arg-type]
    parts = [given.of(one.candidate, one.shape) for one in members]
    groups = join_groups(parts, [one.candidate.one_sided for one in members], N)
    book = Dictionary(tuple(members), groups)
    labels = np.arange(N) % 10
    return Search(fitter, book, book.raw.white(space), Thresholds(limit, 20.0), labels,
                  GapSettings(**settings))  # fmt: skip


def directions(count: int, seed: int = 1) -> Array:
    """Orthonormal columns (N, count) without a mean."""
    drawn = np.random.default_rng(seed).normal(size=(N, count))
    return np.linalg.qr(np.column_stack([np.ones(N), drawn]))[0][:, 1:]


def squares_left(columns: Sequence[Array], y: Array) -> float:
    """Of least squares by a constant and these columns, by numpy alone."""
    x = np.column_stack([np.ones(N), *columns])
    return float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2))


ROLES = {"speed": (Role.SPEED, "rpm"), "temperature": (Role.TEMPERATURE, "C"),
         "lot": (Role.LOT, "")}  # fmt: skip


def readings(**table: Array) -> GapData:
    """Rows of these columns, with one output `te`."""
    columns = tuple(
        Column(name, ROLES[name][1], "", text=ROLES[name][0] is Role.LOT, role=ROLES[name][0]) for name in table
    )
    outputs = (Output("te", "arcsec", ""),)
    target = target_from("table", outputs, columns, table)
    zero = {"te": np.zeros(N)}
    return GapData(target, measurements_of(columns, table), zero, zero, {}, np.arange(N))


def settling(
    members: Sequence[Member], columns: Mapping[str, Any], y: Array, data: GapData,
    forms: Sequence[Form] | None = None, predicted: Array | None = None, **settings: Any,
) -> Settling:  # fmt: skip
    """What an answer is looked for with: the model alone was tried, and nothing else; of `forms`
    alone where they are given.
    """
    search = toy(members, columns, y, data=data, **settings)
    every = zip(*generic(data, None if predicted is None else {"te": predicted}), strict=True)
    pairs = list(every)
    if forms is not None:  # by their texts: from Python 3.13 on dataclasses with NaN are not equal
        texts = [repr(form) for form in forms]
        pairs = [(one, own) for one, own in pairs if repr(one) in texts]
        pairs.sort(key=lambda pair: texts.index(repr(pair[0])))
    white = join_groups([own for _, own in pairs])
    which = np.zeros(len(pairs), dtype=np.int64)
    left = Remaining(white, tuple(form for form, _ in pairs), which, {})
    empty = search.fitter.fit(())
    return Settling(search, left, data, [(empty, search.tested(empty))])


def of_names(one: Settling, names: str, *more: Member) -> Fit:
    """The fit of names of one letter each, and of more members."""
    book = {each.name: each for each in one.search.dictionary.members}
    return one.search.fitter.fit([*(book[name] for name in names), *more])

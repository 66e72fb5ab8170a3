"""The gain of every effect and generic form against a residual, and thresholds by noise alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...journal import recall_arrays
from ...models.effects.effect import grid
from ...models.effects.unresolved import Form
from ...models.measurable import Role
from ...section import Array
from .fit import Fit, Fitter, Member
from .library import Candidate, Columns
from .linear import TIE, Groups, join_groups, project_out, ranked, ranking

CHUNK = 250
"""Number of noise records that are simulated at once."""
ASYMPTOTIC_GAIN = 300.0
"""Half of a gain from which the first term of the tail's expansion suffices."""


@dataclass(frozen=True)
class Dictionary:
    """The library on the fixed grid of its nonlinear parameters, raw columns (N, C)."""

    members: tuple[Member, ...]
    raw: Groups

    @cached_property
    def places(self) -> dict[str, tuple[int, int]]:
        """The start and the end of the grid of each effect."""
        names = [member.name for member in self.members]
        return {name: (names.index(name), names.index(name) + names.count(name)) for name in dict.fromkeys(names)}


def dictionary(library: Sequence[Candidate], columns: Columns, spread: float, gap: Array | None = None) -> Dictionary:
    """The dictionary of every candidate on its grid, and where a `gap` (N,) shows one between, there."""
    data = columns.data
    shapes = {candidate.name: grid(candidate.shape, spread) for candidate in library}
    if gap is not None and len(data.outputs) == 1:
        for candidate in library:
            read = candidate.effect.read_from(gap, data.measurements, data.target)
            shapes[candidate.name] += [read] if read else []
    members = tuple(Member(candidate, shape) for candidate in library for shape in shapes[candidate.name])
    parts = [columns.of(member.candidate, member.shape) for member in members]
    rows = len(columns.data) * len(columns.data.outputs)
    return Dictionary(members, join_groups(parts, [member.candidate.one_sided for member in members], rows))


@dataclass(frozen=True)
class Thresholds:
    """Quantiles of the maximum over all candidates under noise alone, at the false rate.

    `library` is a gain; `generic` is minus the logarithm of a probability.
    """

    library: float
    generic: float


def thresholds(
    library: Groups, generic: Groups, q: Array, simulations: int, rate: float, rng: np.random.Generator
) -> Thresholds:
    """Thresholds from simulated noise records (N, simulations) in whitened space, each scaled."""

    def simulated() -> tuple[Array, Array]:
        named, forms = library.orthonormal(q), generic.orthonormal(q)
        tops, levels = [], []
        for start in range(0, simulations, CHUNK):
            noise = rng.standard_normal((len(q), min(CHUNK, simulations - start)))
            scale = np.sum(project_out(noise, q) ** 2, axis=0) / (len(q) - q.shape[1])
            tops.append(np.max(named.gains(noise) / scale, axis=0, initial=0.0))
            levels.append(strongest_evidence(forms, forms.gains(noise) / scale))
        return np.concatenate(tops), np.concatenate(levels)

    tops, levels = recall_arrays(("thresholds", q), simulated)
    library_limit = np.quantile(tops, 1.0 - rate)
    return Thresholds(float(library_limit), float(np.quantile(levels, 1.0 - 0.5 * rate)))


def strongest_evidence(groups: Groups, gains: Array) -> Array:
    """The largest evidence (S,) of gains (g, S); in groups of one size, that of the largest gain."""
    sizes = np.unique(groups.sizes)
    largest = [np.max(gains[groups.sizes == size], axis=0) for size in sizes]
    if not largest:
        return np.zeros(gains.shape[1])
    return np.asarray(np.max(_evidence(sizes, np.array(largest)), axis=0))


def evidence(groups: Groups, gains: Array) -> Array:
    """Minus the logarithm of the probability of gains (g, ...) under noise, by the group's size."""
    return _evidence(groups.sizes, gains)


def _evidence(sizes: NDArray[np.int64], gains: Array) -> Array:
    half = sizes.reshape(-1, *([1] * (gains.ndim - 1))) / 2.0
    x = np.maximum(gains, 0.0) / 2.0
    chance = scipy.special.gammaincc(half, np.minimum(x, ASYMPTOTIC_GAIN))
    with np.errstate(divide="ignore"):
        far = x - (half - 1.0) * np.log(np.maximum(x, 1.0)) + scipy.special.gammaln(half)
        return np.asarray(np.where(x < ASYMPTOTIC_GAIN, -np.log(chance), far))


@dataclass(frozen=True)
class ScanResult:
    """A candidate at its best grid point, with its gain given the members of a fit."""

    member: Member
    gain: float


def scan(fitter: Fitter, white: Groups, dictionary: Dictionary, members: Sequence[Member]) -> list[ScanResult]:
    """Each candidate that is not in a fit of `members`, at its best grid point, best first. Of two
    that differ by rounding alone the first one of the library precedes, on any machine.
    """
    gains = fitter.gains(white, members)
    taken = {member.name for member in members}
    best: dict[str, ScanResult] = {}
    for member, gain in zip(dictionary.members, gains.tolist(), strict=True):
        if member.name in taken:
            continue
        if member.name not in best or gain > (1.0 + TIE) * best[member.name].gain:
            best[member.name] = ScanResult(member, gain)
    return ranked(list(best.values()), lambda result: result.gain)


@dataclass(frozen=True)
class Remaining:
    """Generic forms in whitened space: their columns, forms and outputs."""

    white: Groups
    forms: tuple[Form, ...]
    outputs: NDArray[np.int64]
    roles: dict[str, Role]


@dataclass(frozen=True)
class GenericResidual:
    """Generic forms tested against a residual: their evidence, gains, and order of evidence."""

    evidence: Array
    gains: Array
    best: NDArray[np.int64]


def generic_residual(fit: Fit, fitter: Fitter, generic: Remaining) -> GenericResidual:
    """The generic forms tested against the residual of a fit, given all its members."""
    gains = fitter.gains(generic.white, fit.members)
    level = evidence(generic.white, gains)
    return GenericResidual(level, gains, ranking(level))

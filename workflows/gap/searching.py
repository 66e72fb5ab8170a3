"""The space of a search: the noise given the selected effects, and columns whitened by it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.inputs.distribution import Array
from ...models.measurable import Role
from .blocks import block_labels
from .estimate import estimated, remainders
from .fit import Fit, Fitter
from .linear import Groups
from .noise import Noise
from .reading import resolution
from .scan import Dictionary, Remaining, Thresholds, thresholds
from .select import Search
from .setup import Setup, values_of
from .space import Space

SAME = 0.02
"""Change of the noise's level and autocorrelation below which they count as unchanged."""


def searching(
    setup: Setup,
    noises: Sequence[Noise],
    book: Dictionary,
    raw: Groups,
    which: NDArray[np.int64],
    known: Thresholds | None,
) -> tuple[Search, Remaining]:
    """The search in the space of this noise."""
    plan = setup.plan
    space = Space(tuple(noises), setup.prior)
    fitter = Fitter(space, setup.residual, setup.base, setup.columns, setup.offset)
    white = book.white(space)
    generic = Groups(space.whiten(raw.columns), raw.starts, raw.one_sided)
    if known is None:
        rng = np.random.default_rng([plan.seed, 2])
        known = thresholds(white, generic, fitter.q, plan.settings.simulations, plan.settings.false_rate, rng)
    labels = np.tile(block_labels(setup.data), len(setup.data.outputs))
    roles = {c.name: c.role for c in setup.data.target.columns}
    forms = tuple(setup.forms) * len(setup.data.outputs)
    return (Search(fitter, book, white, known, labels, plan.settings), Remaining(generic, forms, which, roles))


def noise_of(setup: Setup, contributions: Sequence[Array]) -> tuple[Noise, ...]:
    """The noise of each output given the model and the effects' columns (N, m)."""
    outputs = setup.data.outputs
    q = len(outputs)
    kept = [
        np.column_stack(parts) for parts in zip(*(np.split(x, q) for x in (setup.base, *contributions)), strict=True)
    ]
    remaining = remainders(
        np.split(setup.residual, q),
        kept,
        setup.forms,
        setup.generic,
        values_of(setup.data),
        [c.name for c in setup.data.inputs if c.role is Role.TIME],
        setup.data.repeats,
        [_stated_noise(setup, output.name) for output in outputs],
        [setup.laws[o.name].std if setup.laws else 0.0 for o in outputs],
        [0.0 if setup.laws else resolution(setup, o.name) for o in outputs],
    )
    return tuple(estimated(remainder) for remainder in remaining)


def _stated_noise(setup: Setup, name: str) -> tuple[Array, str] | None:
    """The noise (n,) that the table or the configuration states, and which of the two."""
    if name in setup.data.std:
        return setup.data.std[name], "column"
    if name in setup.plan.noise:
        return np.full(len(setup.data), setup.plan.noise[name]), "configuration"
    return None


def contributions(setup: Setup, fit: Fit) -> list[Array]:
    """Columns of the members in the outputs' units."""
    return [setup.columns.of(member.candidate, member.shape) for member in fit.members]


def spread_of(noises: Sequence[Noise]) -> float:
    """The largest level of the noise of the outputs."""
    return float(max(noise.level for noise in noises))


def alike(first: Sequence[Noise], second: Sequence[Noise]) -> bool:
    """Whether two estimates of the noise are practically the same."""
    return all(
        abs(a.level / b.level - 1.0) < SAME
        and abs(a.rho - b.rho) < SAME
        and a.outliers == b.outliers
        and a.varies_with == b.varies_with
        for a, b in zip(first, second, strict=True)
    )

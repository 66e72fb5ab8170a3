"""The space of a search: the noise given the selected effects, and columns whitened by it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...models.measurable import Role
from .blocks import block_labels
from .estimate import Remainder, estimated
from .fit import Fit, Fitter
from .linear import Groups
from .noise import Noise
from .null_model import NullModel
from .reading import resolution
from .scan import Dictionary, Remaining, Thresholds, thresholds
from .select import Search
from .setup import Setup, values_of
from .space import Space

SAME = 0.02
"""Change of the noise's level and autocorrelation below which they count as unchanged."""


def searching(
    setup: Setup,
    noises: tuple[Noise, ...],
    effects: Dictionary,
    forms: Groups,
    outputs: NDArray[np.int64],
    known: Thresholds | None,
) -> NullModel:
    """The null model in the space of this noise; `forms` (N, C) are generic columns, `outputs` (g,)
    the output of each group of them.
    """
    plan = setup.plan
    space = Space(noises, setup.prior)
    fitter = Fitter(space, setup.residual, setup.base, setup.columns, setup.offset)
    white, generic = effects.white(space), forms.white(space)
    if known is None:
        rng = np.random.default_rng([plan.seed, 2])
        known = thresholds(white, generic, fitter.q, plan.settings.simulations, plan.settings.false_rate, rng)
    labels = np.tile(block_labels(setup.data), len(setup.data.outputs))
    search = Search(fitter, effects, white, known, labels, plan.settings)
    roles = {c.name: c.role for c in setup.data.target.columns}
    remaining = Remaining(generic, setup.forms * len(setup.data.outputs), outputs, roles)
    return NullModel(setup, noises, search, remaining, forms)


def in_noise(null_model: NullModel, noises: tuple[Noise, ...]) -> NullModel:
    """The same null model in the space of another noise, with the same thresholds."""
    search, outputs = null_model.search, null_model.generic.outputs
    return searching(null_model.setup, noises, search.dictionary, null_model.forms, outputs, search.thresholds)


def noise_of(setup: Setup, contributions: Sequence[Array]) -> tuple[Noise, ...]:
    """The noise of each output given the model and the effects' columns (N, m)."""
    data = setup.data
    split = [np.split(x, len(data.outputs)) for x in (setup.residual, setup.base, *contributions)]
    clocks = [c.name for c in data.inputs if c.role is Role.TIME]
    slow, inputs = tuple(form.variable in clocks for form in setup.forms), values_of(data)
    noises = []
    for output, residual, *columns in zip(data.outputs, *split, strict=True):
        known, source = _stated_noise(setup, output.name)
        law = setup.laws[output.name].std if setup.laws else 0.0
        rounding = 0.0 if setup.laws else resolution(setup, output.name)
        kept = np.column_stack(columns)
        remainder = Remainder(residual, kept, setup.generic, inputs, slow, data.repeats, known, source, law, rounding)
        noises.append(estimated(remainder))
    return tuple(noises)


def _stated_noise(setup: Setup, name: str) -> tuple[Array | None, str]:
    """The noise (n,) that the table or the configuration states, and which of the two."""
    if name in setup.data.std:
        return setup.data.std[name], "column"
    if name in setup.plan.noise:
        return np.full(len(setup.data), setup.plan.noise[name]), "configuration"
    return None, "estimated"


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

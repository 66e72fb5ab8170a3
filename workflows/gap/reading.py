"""The quantity that an instrument measures: the prediction with all effects added to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Array
from ...declarations import Output
from ...models.effects.instrument.lattice import step_of
from .fit import Fit, Fitter
from .library import Candidate, Columns
from .setup import Setup
from .space import Space

COARSE = 0.25
"""Fraction of the residual's scatter from which the steps of measurements are noted."""

ITERATIONS, CLOSER = 8, 0.01
"""Largest number of iterations, and the fraction of the squares that a further one must save."""


def as_read(setup: Setup, fit: Fit | None = None) -> Setup:
    """The setup in which an instrument measures the zeros and the effects of a fit as well.

    Without a fit the zero of an output is the median of its residual. The setup is unchanged where
    no effect of its library acts on the measurement itself.
    """
    if not any(_reads(setup, candidate) for candidate in setup.library):
        return setup
    outputs = setup.data.outputs
    if fit is None:
        parts = np.split(setup.residual, len(outputs))
        notes = [_coarse(setup, o, x) for o, x in zip(outputs, parts, strict=True)]
        setup = replace(setup, notes=(*setup.notes, *(note for note in notes if note)))
        more = {
            o.name: np.full(len(x), np.median(x) if o.name in setup.data.zeros else 0.0)
            for o, x in zip(outputs, parts, strict=True)
        }
    else:
        total = setup.base[:, setup.prior :] @ fit.free[setup.prior :]
        for member, size in zip(fit.members, fit.coefficients, strict=True):
            if not _reads(setup, member.candidate):
                total = total + setup.columns.of(member.candidate, member.shape) @ size
        more = dict(zip((o.name for o in outputs), np.split(total, len(outputs)), strict=True))
    return replace(setup, columns=Columns(setup.data, setup.columns.predict, more))


def read_again(setup: Setup, space: Space, fit: Fit) -> tuple[Setup, Fit]:
    """The setup in which the instrument measures what the members of a fit add, and their fit in
    it; iterated to convergence where a member acts on the measurement itself.
    """
    before = np.inf
    for _ in range(ITERATIONS):
        fitter = Fitter(space, setup.residual, setup.base, setup.columns, setup.offset)
        fit = fitter.refined(fit.members)
        if before - fit.rss < CLOSER * fit.rss or not any(_reads(setup, member.candidate) for member in fit.members):
            break
        setup, before = as_read(setup, fit), fit.rss
    return setup, fit


def resolution(setup: Setup, output: str) -> float:
    """The standard deviation due to the steps of an output's measurements, 0 without steps."""
    return float((step_of(setup.data.measured[output]) or 0.0) / np.sqrt(12.0))


def _coarse(setup: Setup, output: Output, residual: Array) -> str:
    """The note on measurements whose steps are a large part of their residual (n,), else ""."""
    scatter, whole = resolution(setup, output.name), float(np.std(residual))
    if scatter <= COARSE * whole:
        return ""
    step, percent = scatter * np.sqrt(12.0), 100.0 * min(scatter / whole, 1.0)
    return (
        f"{output.name} is measured in steps of {step:.4g} {output.unit}: their scatter alone is "
        f"{percent:.0f} % of the residual"
    )


def _reads(setup: Setup, candidate: Candidate) -> bool:
    """Whether a candidate acts on the measurement itself."""
    values, data = {number.name: max(number.choices, default=1.0) for number in candidate.shape}, setup.data
    return candidate.is_nonlinear and bool(candidate.effect.act(data.measurements, values, data.target).reading)

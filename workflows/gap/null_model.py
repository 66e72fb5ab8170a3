"""The model without any effect, and what is searched given it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from .fit import Fit
from .linear import Groups
from .noise import Noise
from .population import Batch, Scatter, carrying
from .scan import GenericResidual, Remaining, generic_residual
from .select import Search
from .setup import Setup


@dataclass(frozen=True)
class NullModel:
    """The null model with all that is searched, in the space of its noise, and the generic columns
    (N, C) of `forms` in the outputs' units.
    """

    setup: Setup
    noises: tuple[Noise, ...]
    search: Search
    generic: Remaining
    forms: Groups

    @cached_property
    def null_fit(self) -> Fit:
        """The null fit: the model without any effect."""
        return self.search.fitter.fit(())

    @cached_property
    def residual_forms(self) -> GenericResidual:
        """The generic forms tested against the residual of the null fit."""
        return generic_residual(self.null_fit, self.search.fitter, self.generic)

    @property
    def detected(self) -> bool:
        """Whether a generic form is significant in the residual of the null fit."""
        return bool(self.residual_forms.evidence.max(initial=0.0) > self.search.thresholds.generic)

    @cached_property
    def batch(self) -> Batch:
        """The units as a batch of a population."""
        return Batch(self.setup, self.search)

    def with_scatter(self, effect: Scatter) -> NullModel:
        """The same for a model that contains an effect on the scatter."""
        setup, fitter = carrying(self.setup, effect), self.search.fitter
        moved = fitter.space.whiten(self.setup.residual - setup.residual)
        search = replace(self.search, fitter=fitter.of_record(fitter.y - moved))
        return replace(self, setup=setup, search=search)

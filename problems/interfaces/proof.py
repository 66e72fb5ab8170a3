"""What bounds of the cost are proven with; by default nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from .base import Interface

if TYPE_CHECKING:
    from ..forms import Form


class Provable(Interface):
    """The convex form of a problem, and an exact front."""

    def form(self) -> Form | None:
        """The convex form that bounds of the cost are proven with, None where there is none."""
        return None

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        """True values (n, r) of the requirements of the form, from the outputs of designs.

        With its own limit, a requirement has the value of that limit plus what is missing.
        """
        nothing = np.full(len(designs), -np.inf)
        return np.stack(
            [
                nothing if np.isfinite(most) else self._problem.values(designs, outputs, name)
                for name, most in zip(form.outputs, form.own_limits, strict=True)
            ],
            axis=1,
        )

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Variables (n,) from features of the form (n,), where these are not variables."""
        return dict(columns)

    def stand_in_limit(self, name: str, high: float) -> float:
        """The upper limit of the requirement of the form that stands for a limit on an output."""
        return high

    def guide(self) -> Form | None:
        """A convex form close to the problem, to begin a search from; it proves nothing."""
        return self.form()

    def unproven(self) -> str:
        """Why an objective that might have a convex form has none here; empty where not known."""
        return ""

    def exact_front(self) -> Array | None:
        """The exact front (k, objectives) where it is known, else None."""
        return None

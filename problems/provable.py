"""What a problem provides for proofs and for searches by gradients; by default nothing."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ..declarations import Variable
    from .forms import Form

Array = NDArray[np.float64]


class Provable:
    """The convex form of a problem, its derivatives, and designs to begin a search from."""

    variables: tuple[Variable, ...]

    @abstractmethod
    def values(self, designs: Array, outputs: Mapping[str, Array], name: str) -> Array:
        """An output or variable (n,) by name."""

    def exact_front(self) -> Array | None:
        """The exact front (k, objectives) where it is known, else None."""
        return None

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
                nothing if np.isfinite(most) else self.values(designs, outputs, name)
                for name, most in zip(form.outputs, form.own_limits, strict=True)
            ],
            axis=1,
        )

    def unproven(self) -> str:
        """Why an objective that might have a convex form has none here; empty where not known."""
        return ""

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Variables (n,) from features of the form (n,), where these are not variables."""
        return dict(columns)

    def guide(self) -> Form | None:
        """A convex form close to the problem, to begin a search from; it proves nothing."""
        return self.form()

    def starts(self) -> Array:
        """Full designs (k, all variables) that a search by gradients does well to begin from."""
        return np.empty((0, len(self.variables)))

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of the outputs for which the model gives them."""
        return {}

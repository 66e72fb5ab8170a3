"""Full designs of a problem as tables hold them: whole numbers as such, choices by name."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..declarations import Variable

Array = NDArray[np.float64]


class Tabled:
    """A column for each variable, and the designs that such a table holds."""

    variables: tuple[Variable, ...]

    @abstractmethod
    def column(self, designs: Array, name: str) -> Array:
        """One variable (n,) of full designs (n, all variables)."""

    def designs_frame(self, designs: Array) -> pd.DataFrame:
        """Full designs (n, all variables) as a table holds them, a column per variable."""
        return pd.DataFrame({v.name: self._shown(v, designs) for v in self.variables})

    def _shown(self, variable: Variable, designs: Array) -> Any:
        """A variable (n,) as tables hold it: whole numbers as such, choices by name."""
        values = self.column(designs, variable.name)
        if variable.labels:
            return np.array(variable.labels, dtype=object)[values.astype(int)]
        return values.astype(np.int64) if variable.integer else values

    def designs_of(self, frame: pd.DataFrame) -> Array:
        """Full designs (n, all variables) of a table as `frame` makes it."""
        columns = [
            frame[v.name].map({label: at for at, label in enumerate(v.labels)})
            if v.labels
            else frame[v.name]
            for v in self.variables
        ]
        return np.asarray(np.stack(columns, axis=1), dtype=float)

"""Values of a calculation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ....declarations import Scalar, Value, number
from ....errors import Fault, nearest, raise_all
from ..calculation import Calculation, Computed
from .recipe import Recipe, Recomputed, continuous

KEPT = 64
"""Results of calculations without chance that a process keeps."""


@dataclass(frozen=True)
class ByCalculation(Recipe):
    """Quantities of a calculation at parameters by name; the defaults are the document's case."""

    kind: type[Calculation]
    parameters: tuple[tuple[str, Value], ...]
    quantities: tuple[str, ...]
    place: str = "quantity"
    """Where the names of the quantities stand, for faults."""

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        computed = self._computed(rng)
        known = computed.quantities
        raise_all(
            Fault(
                self.place,
                f'"{name}" is not a quantity of {self.kind.name}{nearest(name, known)}; it computes {", ".join(known)}',
            )
            for name in self.quantities
            if name not in known
        )
        tables = {f"{self.kind.name}_{table.name}": table for table in computed.tables}
        return Recomputed(tuple(known[name] for name in self.quantities), tables)

    def _computed(self, rng: np.random.Generator) -> Computed:
        if self.kind.sampled:
            return self.kind().compute(dict(self.parameters), rng)
        return _without_chance(self.kind, tuple(map(_hashable, self.parameters)))

    @property
    def by(self) -> str:
        return f"calculation {self.kind.name}"

    def shift_units(self) -> dict[str, str | None]:
        return continuous(self.kind.parameters)

    def shifted(self, name: str, step: float) -> ByCalculation:
        values = self.kind().completed(dict(self.parameters))
        moved = dict(self.parameters) | {name: number(values[name]) + step}
        return replace(self, parameters=tuple(moved.items()))


Hashable = Scalar | tuple[float, ...] | frozenset[tuple[str, float]]
"""A value that can be a key: a table is the set of its entries."""


def _hashable(item: tuple[str, Value]) -> tuple[str, Hashable]:
    name, value = item
    return name, (frozenset(value.items()) if isinstance(value, Mapping) else value)


@lru_cache(maxsize=KEPT)
def _without_chance(kind: type[Calculation], parameters: tuple[tuple[str, Hashable], ...]) -> Computed:
    """A result that does not depend on random numbers."""
    values: dict[str, Value] = {
        name: dict(value) if isinstance(value, frozenset) else value for name, value in parameters
    }
    return kind().compute(values, np.random.default_rng(0))

"""The parts of a task as tolevo is told them: a convex form, a problem, a configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tolevo.models.costs import Reciprocal
from tolevo.problems.declaration import Declaration
from tolevo.problems.forms import Feature, Form, Way
from tolevo.problems.settings import Settings
from tolevo.problems.tolerance_problem import ToleranceProblem
from tolevo.section import Kind, Output, Variable

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Costs a + b/t, each (parts, ways), nan where a part has fewer ways; sensitivities s (parts,).

    All tolerances lie between `low` and `high`; the variation is sqrt(sum_j s_j^2 t_j^2).
    """

    a: Array
    b: Array
    s: Array
    low: float
    high: float

    @property
    def ways(self) -> list[int]:
        """Number of ways of each part."""
        return [int(count) for count in np.isfinite(self.a).sum(axis=1)]

    def curves(self, part: int) -> list[Reciprocal]:
        pairs = zip(self.a[part].tolist(), self.b[part].tolist(), strict=True)
        return [Reciprocal(a, b) for a, b in pairs if np.isfinite(a)]

    def form(self) -> Form:
        """What `exact` works on."""
        features = tuple(
            Feature(f"t_{part}", self._ways(part), f"process_{part}" if count > 1 else "")
            for part, count in enumerate(self.ways)
        )
        return Form(("variation",), features, np.zeros(1), np.zeros(1), "cost and root sum square")

    def _ways(self, part: int) -> tuple[Way, ...]:
        spread = (float(self.s[part]),)
        return tuple(
            Way(curve, self.low, self.high, (0.0,), spread, choice=float(at))
            for at, curve in enumerate(self.curves(part))
        )

    def tables(self) -> dict[str, Any]:
        """The same parts as the configuration of a `stack`; its tolerances are three sigma."""
        return {
            "problem": "stack",
            "requirement": {"name": "gap", "unit": "mm", "method": "rss"},
            "part": [self._table(part) for part in range(len(self.s))],
        }

    def _table(self, part: int) -> dict[str, Any]:
        ways = [
            {"t_min": self.low, "t_max": self.high, "cost": {"model": "reciprocal", "a": curve.a, "b": curve.b}}
            for curve in self.curves(part)
        ]
        named: dict[str, Any] = {"name": f"part_{part}", "sensitivity": float(self.s[part])}
        if len(ways) == 1:
            return named | ways[0]
        return named | {"process": [{"name": f"way_{at}"} | way for at, way in enumerate(ways)]}


class Watched(ToleranceProblem):
    """A problem that tells `note` the objectives (n, m) of every batch that it evaluates.

    Problems that a search derives from it, as on other units, tell nobody. One that is `formless`
    knows no convex form of itself. Designs that break a limit are told of as lying beyond `edge`
    (m,), where there is one.
    """

    note: Callable[[Array], None] = staticmethod(lambda values: None)
    formless = False
    edge: Array | None = None

    def watched(self, note: Callable[[Array], None], formless: bool = False) -> Self:
        self.note, self.formless = note, formless
        return self

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        super()._evaluate(x, out, *args, **kwargs)
        self.note(out["F"] if self.edge is None else beyond(out["F"], out["G"], self.edge))

    def form(self) -> Form | None:
        return None if self.formless else super().form()

    def guide(self) -> Form | None:
        return None if self.formless else super().guide()


def beyond(f: Array, g: Array, edge: Array) -> Array:
    """Objectives (n, m), beyond `edge` (m,) where a constraint (n, any number) is broken.

    The further the more it breaks, so that all designs that keep the limits come first (Deb 2000).
    """
    broken = np.maximum(g, 0.0).sum(axis=1)[:, None]
    return np.where(broken > 0.0, edge * (1.0 + broken), f)


class PartsProblem(ToleranceProblem):
    """Cost and variation of parts, by the function that all contenders are given."""

    def __init__(self, parts: Parts, evaluate: Callable[[Array], Array], settings: Settings | None = None) -> None:
        self.parts, self.evaluated = parts, evaluate
        kind, choice = Kind.HALF_WIDTH, Kind.CHOICE
        variables = (
            *(Variable(f"t_{part}", "mm", kind, parts.low, parts.high, "tolerance")
              for part in range(len(parts.s))),
            *(Variable(f"process_{part}", "", choice, 0.0, count - 1.0, "process", integer=True)
              for part, count in enumerate(parts.ways) if count > 1),
        )  # fmt: skip
        outputs = (Output("cost", "", "cost"), Output("variation", "mm", "root sum square"))
        self.declaration = Declaration(variables, outputs, objectives=("cost", "variation"))
        super().__init__(settings)

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        cost, variation = self.evaluated(designs).T
        return {"cost": cost, "variation": variation}

    def gradient(self, designs: Array) -> dict[str, Array]:
        count = len(self.parts.s)
        t, square = designs[:, :count], self.parts.s**2
        chosen = np.zeros(t.shape, dtype=int)
        chosen[:, np.array(self.parts.ways) > 1] = designs[:, count:].astype(int)
        found = {name: np.zeros_like(designs) for name in ("cost", "variation")}
        found["cost"][:, :count] = -self.parts.b[np.arange(count), chosen] / t**2
        found["variation"][:, :count] = square * t / np.sqrt(t**2 @ square)[:, None]
        return found

    def form(self) -> Form | None:
        return self.parts.form()


class WatchedParts(Watched, PartsProblem):
    """Parts whose evaluations are noted."""

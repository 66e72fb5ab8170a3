"""A term without a name, which the data need in addition to the named effects.

A term is a shape over one variable, perhaps times another one and times the direction. It describes
the rows that it was fitted on; beyond their range its value is that at the end (splines) or
extrapolates as its power.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from hashlib import sha256
from typing import Any

import numpy as np
import scipy

from ...section import Array
from ..measurable import Role
from .effect import Action, Effect, EffectParameter, Measurements, Target, Values
from .measurements import SESSION, labels_of, path_starts

SHAPES = ("constant", "spline", "power", "step", "wave", "swing", "product", "levels", "curve", "plays")


@dataclass(frozen=True, slots=True)
class Term:
    """A term: added to `output`, a function of the column `variable` x of the given `shape`.

    - `constant`: 1;
    - `spline`: cubic B-splines with `knots`;
    - `curve`: straight from knot to knot, with `heights` there;
    - `power`: z^exponent of z = |x - zero| / scale, with the sign of x - zero where `signed`;
    - `step`: 1 from zero on;
    - `wave`: cosine and sine of `order` times x, an angle;
    - `swing`: cosine and sine of `order` times (x - zero) / scale;
    - `levels`: a level for each of `labels` in the column, which add up to 0: one column for each
      label but the first, 1 there and -1 at the first; in rows of another label, or of a table
      without sessions, all of them are 0;
    - `plays`: a Prandtl-Ishlinskii operator: by how much plays of half-widths `radii` stay behind z =
      (x - zero) / scale along the path of the rows. The weights are not negative, unless they are by how
      much an effect's form is off; a negative scale turns their sense (friction elements);
    - `product`: z w, z^2 w, z w^2, z^2 w^2 of z = (x - zero) / scale and w, which `times` gives.

    The whole is multiplied by w^times_exponent of w = (y - times_zero) / times_scale of the column
    `times`, where it is given (`times_magnitude`: of its magnitude), and by the direction where it
    `turns`.
    """

    output: str
    variable: str
    shape: str
    exponent: float = 1.0
    zero: float = 0.0
    scale: float = 1.0
    signed: bool = False
    order: float = 0.0
    knots: tuple[float, ...] = ()
    heights: tuple[float, ...] = ()
    radii: tuple[float, ...] = ()
    labels: tuple[str, ...] = ()
    times: str = ""
    times_exponent: float = 1.0
    times_zero: float = 0.0
    times_scale: float = 1.0
    times_magnitude: bool = False
    turns: bool = False

    @property
    def count(self) -> int:
        """Columns."""
        if self.shape == "spline":
            return len(self.knots) + 2
        if self.shape == "levels":
            return len(self.labels) - 1
        if self.shape == "plays":
            return len(self.radii)
        return {"wave": 2, "swing": 2, "product": 4}.get(self.shape, 1)

    @property
    def variables(self) -> tuple[str, ...]:
        """Columns of the table that it is a function of, without the direction."""
        return (self.variable, self.times) if self.times else (self.variable,)

    def columns(self, measurements: Measurements) -> Array:
        """Its columns (n, count)."""
        column = self._shape(measurements)
        if self.times and self.shape != "product":
            column = column * (self._second_factor(measurements) ** self.times_exponent)[:, None]
        if self.turns:
            column = column * np.asarray(measurements[Role.DIRECTION], dtype=float)[:, None]
        return np.asarray(column, dtype=float)

    def _second_factor(self, measurements: Measurements) -> Array:
        scaled = (np.asarray(measurements.table[self.times], dtype=float) - self.times_zero) / self.times_scale
        return np.asarray(np.abs(scaled) if self.times_magnitude else scaled)

    def _shape(self, measurements: Measurements) -> Array:
        if self.shape == "constant":
            return np.ones((len(measurements), 1))
        if self.shape == "wave":
            return wave(self.order * np.asarray(measurements[Role.ANGLE], dtype=float))
        if self.shape == "levels":
            return self._levels(measurements)
        x = np.asarray(measurements.table[self.variable], dtype=float)
        if self.shape == "spline":
            ends = np.r_[[self.knots[0]] * 3, self.knots, [self.knots[-1]] * 3]
            inside = np.clip(x, self.knots[0], self.knots[-1])
            return np.asarray(scipy.interpolate.BSpline.design_matrix(inside, ends, 3).toarray())
        if self.shape == "curve":
            return np.asarray(np.interp(x, self.knots, self.heights))[:, None]
        if self.shape == "step":
            return np.asarray(x >= self.zero, dtype=float)[:, None]
        z = (x - self.zero) / self.scale
        if self.shape == "plays":
            return plays(measurements, z, self.radii)
        if self.shape == "swing":
            return wave(self.order * z)
        if self.shape == "product":
            w = self._second_factor(measurements)
            return np.column_stack([z * w, z * z * w, z * w * w, z * z * w * w])
        size = np.abs(z) ** self.exponent
        return (np.sign(z) * size if self.signed else size)[:, None]

    def _levels(self, measurements: Measurements) -> Array:
        if self.variable not in measurements.table:
            return np.zeros((len(measurements), self.count))
        names, which = labels_of(measurements.table[self.variable])
        matches = np.asarray(names[which][:, None] == np.array(self.labels), dtype=float)
        return np.asarray(matches[:, 1:] - matches[:, :1])

    def table(self, coefficients: Array) -> dict[str, Any]:
        """The `[[unresolved]]` table of it."""
        defaults = {entry.name: entry.default for entry in fields(self)}
        stated = {key: value for key, value in asdict(self).items() if value != defaults[key]}
        lists = {"knots": self.knots, "heights": self.heights, "radii": self.radii, "labels": self.labels}
        stated |= {name: list(elements) for name, elements in lists.items() if elements}
        return {**stated, "coefficients": [float(coefficient) for coefficient in coefficients]}


def wave(phase: Array) -> Array:
    """Cosine and sine (n, 2) of a phase (n,)."""
    return np.column_stack([np.cos(phase), np.sin(phase)])


def plays(measurements: Measurements, x: Array, radii: Sequence[float]) -> Array:
    """By how much (n, k) plays of these half-widths stay behind a driving column x (n,), at rest where a
    path of the rows begins.
    """
    from .memory_kernel import behind_plays  # imports numba

    order = measurements.in_order
    along = behind_plays(np.ascontiguousarray(x[order]), path_starts(measurements), np.array(radii, dtype=float))
    off = np.empty_like(along)
    off[order] = along
    return off


class Unresolved(Effect):
    """A term as an effect with linear parameters only.

    `mix` (count, m) combines its columns from those of the term: the part that a named effect
    explains is removed from them, so that its parameter is unaffected.
    """

    family = "unresolved"
    holds_at_ends = True
    cause = "a term without a name"

    def __init__(self, term: Term, mix: Array | None = None) -> None:
        self.term = term
        self.mixed = mix is not None
        self.mix = np.eye(term.count) if mix is None else mix
        self.name = str(term)  # type: ignore[misc]
        if mix is not None:
            self.name += f" {sha256(mix.tobytes()).hexdigest()[:12]}"  # type: ignore[misc]

    def own_applies(self, target: Target) -> bool:
        """Only where its columns and its output exist."""
        names = {SESSION, *(column.name for column in target.columns)}
        turns = not self.term.turns or Role.DIRECTION in target.roles()
        outputs = {output.name for output in target.outputs}
        return {*self.term.variables} <= names and turns and self.term.output in outputs

    def place(self, target: Target) -> None:
        """It never acts inside a model."""

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        unit = next(output.unit for output in target.outputs if output.name == self.term.output)
        low = 0.0 if self.term.shape == "plays" and not self.mixed else -np.inf
        return tuple(EffectParameter(f"c{k + 1}", unit, "coefficient", low) for k in range(self.mix.shape[1]))

    def columns(self, measurements: Measurements) -> Array:
        """Columns (n, m) of its parameters."""
        return np.asarray(self.term.columns(measurements) @ self.mix)

    def coefficients(self, values: Values) -> Array:
        """Coefficients of the term (count,)."""
        weights = np.array([values.get(f"c{k + 1}", 0.0) for k in range(self.mix.shape[1])])
        return np.asarray(self.mix @ weights)

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        return Action(output={self.term.output: self.term.columns(measurements) @ self.coefficients(values)})


def unresolved_of(table: Mapping[str, Any]) -> tuple[Unresolved, dict[str, float]]:
    """A term and its parameters from its checked `[[unresolved]]` table."""
    stated = {key: value for key, value in table.items() if key != "coefficients"}
    stated |= {name: tuple(stated[name]) for name in ("knots", "heights", "radii", "labels") if name in stated}
    values = {f"c{k + 1}": float(coefficient) for k, coefficient in enumerate(table["coefficients"])}
    return Unresolved(Term(**stated)), values

"""A term without a name, which the data need in addition to the named effects.

A term is a shape over one variable, perhaps times another one and times the direction. It describes
the rows that it was fitted on; beyond their range its value is that at the end (splines) or
extrapolates as its power.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from hashlib import sha256
from typing import Any

import numpy as np
import scipy

from ...section import Array
from ...units import converted
from ..measurable import Column, Role
from .effect import Action, Effect, EffectParameter, Measurements, Target, Values
from .measurements import SESSION, fixed_unit, labels_of, path_starts

CURVED = ("spline", "power", "curve")
"""Shapes of terms of one variable that together are a curve over it."""
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

    @property
    def words(self) -> str:
        """Its shape and its variables in words."""
        names = " and ".join(self.variables)
        kinds = {
            "constant": "an offset",
            "spline": f"a smooth curve over {self.variable}",
            "power": f"{self.variable} to the power {self.exponent:.3g}",
            "step": f"a step at {self.variable} = {self.zero:.4g}",
            "wave": f"a wave of order {self.order:g} of {self.variable}",
            "swing": f"a swing of {self.order:g} cycles over {self.variable}",
            "product": f"a product of {names}",
            "curve": f"a curve over {self.variable}",
            "levels": f"a separate level for each {self.variable}",
            "plays": f"a memory of {self.count} play{'s' * (self.count > 1)} over {self.variable}, without a name",
        }
        text = kinds[self.shape].removesuffix(" to the power 1")
        if self.shape == "power":
            signs = (self.exponent % 2 == 1) == self.signed
            text += "" if signs or self.zero else ", odd" if self.signed else ", of the magnitude"
        if self.times and self.shape != "product":
            power = f"^{self.times_exponent:g}" if self.times_exponent != 1.0 else ""
            text += f" times {self.times}{power}"
        return text + (", opposite in the two directions" if self.turns else "")

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
            return cubic_splines(x, np.array(self.knots))
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


LEVELS, STEP, SWING = "levels", "step", "swing"
"""Shapes of a form over labels, an order and the time: a separate level for each label, a step, a
slow wave."""
ODD, EVEN, FROM_ZERO, FROM_LEAST = "odd", "even", "from zero", "from its least"
"""Shapes of a power: of a signed input odd or even, of another one from zero or its least."""


@dataclass(frozen=True, slots=True)
class Form:
    """Meaning of a group of generic columns: `kind` as in a `Region`, over `variable` and
    `further_variables`.

    `shape` is one of those above; a step comes `after` so many `of` all. `powers` are those of the
    two inputs of a single product. A wave may grow `by` a column or role to the power `by_power`.
    """

    kind: str
    variable: str
    order: float = np.nan
    direction: str = ""
    further_variables: tuple[str, ...] = ()
    shape: str = ""
    after: int = 0
    of: str = ""
    powers: tuple[int, int] | None = None
    by: str = ""
    by_power: int = 1

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of all variables."""
        return (self.variable, *self.further_variables)

    @property
    def words(self) -> list[str]:
        """The form in words: what it is, and its details."""
        if self.shape == LEVELS:
            return [f"a separate level for each {self.variable}"]
        what = {
            "order": f"a wave of order {self.order:g} of {self.variable}",
            "distribution": "an offset of all units",
            "direction": "an offset that changes sign with the direction",
            "product": f"a product of {' and '.join(self.variables)}",
            "trend": f"a change along {self.variable}",
            "memory": f"a memory of the path of {self.variable}",
        }.get(self.kind, f"a dependence on {self.variable}")
        details = [what]
        if self.kind == "power":
            details.append(f"about its power {self.order:.3g}, {self.shape}")
        elif self.shape == STEP:
            details.append(f"step after {self.after} of {self.of}")
        elif self.shape == SWING:
            details.append(f"a swing of {self.order:g} cycles")
        if self.powers is not None:
            details.append(f"powers {self.powers[0]} and {self.powers[1]}")
        if self.by:
            details.append(f"times {self.by}" + (" squared" if self.by_power == 2 else ""))
        if self.direction and self.kind != "direction":
            details.append("opposite in the two directions")
        return details


def cubic_splines(x: Array, knots: Array) -> Array:
    """Cubic B-splines (n, k + 2) of values (n,) over k knots; beyond the ends as there."""
    ends = np.r_[[knots[0]] * 3, knots, [knots[-1]] * 3]
    return np.asarray(scipy.interpolate.BSpline.design_matrix(np.clip(x, knots[0], knots[-1]), ends, 3).toarray())


def knots(values: Array, count: int) -> Array:
    """The ends of `count` stretches of values (n,) with equally many rows."""
    return np.asarray(np.unique(np.quantile(values, np.linspace(0, 1, count + 1))))


def spline(values: Array, count: int) -> Array:
    """Cubic B-splines (n, count + 3) of values (n,), their knots at quantiles."""
    inner = knots(values, count)
    if len(inner) < 3:
        return values[:, None].astype(float)
    return cubic_splines(values, inner)


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
    off: Array = np.empty_like(along)
    off[order] = along
    return off


RADII = tuple(np.geomspace(0.005, 0.45, 24).tolist())
"""Half-widths of the plays of a memory, in ranges of the driving column: a play of half the range rests.
A form has every other one, a term the few that it needs."""
MOST_PLAYS = 6
"""Plays of a memory without a name, at most."""


def fewest_plays(columns: Array, y: Array, price: float) -> tuple[float, list[int]]:
    """The least score, squares and `price` for each, of non-negative weights of some columns (m, m) to y (m,),
    and which ones these are: the least useful are left out one by one.
    """
    weights, off = scipy.optimize.nnls(columns, y)
    kept, rss = np.flatnonzero(weights).tolist(), float(off) ** 2
    while len(kept) > 1:
        fewer = [[k for k in kept if k != out] for out in kept]
        least, smaller = min((float(scipy.optimize.nnls(columns[:, some], y)[1]) ** 2, some) for some in fewer)
        if len(kept) <= MOST_PLAYS and least - rss > price:
            break
        rss, kept = least, smaller
    return rss + price * len(kept), kept


MOST_KNOTS = 60
"""Knots of a curve, at most."""
EXACT = 1e-3
"""Deviation at which no more knots are added, as a fraction of the largest value."""


NO_CURVE = 0.02
"""Deviation from which points are no function of one variable, as a fraction of their rms."""


def broken_line(x: Array, y: Array) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Knots and heights of a broken line through points (n,), of magnitude 1 at most, and its rms
    error relative to the points. Knots are added one by one where the error is largest (Douglas and
    Peucker, Cartographica 10, 1973).
    """
    order = np.argsort(x, kind="stable")
    x, first = np.unique(x[order], return_index=True)
    y = y[order][first] / max(float(np.abs(y).max()), 1e-300)
    at = [0, len(x) - 1]
    while True:
        deviations = y - np.interp(x, x[at], y[at])
        worst = int(np.argmax(np.abs(deviations)))
        if abs(deviations[worst]) < EXACT or len(at) >= MOST_KNOTS:
            break
        at = sorted([*at, worst])
    off = float(np.sqrt(np.mean(deviations**2) / max(float(np.mean(y**2)), 1e-300)))
    return tuple(x[at].tolist()), tuple(y[at].tolist()), off


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


def acts_over(effect: Effect, inputs: Iterable[Column], target: Target) -> tuple[frozenset[str], bool]:
    """The inputs that an effect is a function of, that along whose path it has a memory too, and whether it follows
    the direction as well.
    """
    if isinstance(effect, Unresolved):
        return frozenset(effect.term.variables), effect.term.turns
    roles = effect.acts_in(target)
    return frozenset(c.name for c in inputs if c.role in roles - {Role.DIRECTION}), Role.DIRECTION in roles


@dataclass(frozen=True)
class Resemblance:
    """Effects `names` that a curve resembles, and the fraction of its squares that they explain."""

    names: tuple[str, ...] = ()
    fraction: float = 0.0

    def __str__(self) -> str:
        return f"{100.0 * self.fraction:.0f} % like {' and '.join(self.names)}" if self.names else ""


def unresolved_of(table: Mapping[str, Any]) -> tuple[Unresolved, dict[str, float]]:
    """A term and its parameters from its checked `[[unresolved]]` table."""
    stated = {key: value for key, value in table.items() if key != "coefficients"}
    stated |= {name: tuple(stated[name]) for name in ("knots", "heights", "radii", "labels") if name in stated}
    values = {f"c{k + 1}": float(coefficient) for k, coefficient in enumerate(table["coefficients"])}
    return Unresolved(Term(**stated)), values


# An effect of one's own with the form of terms: as the text of a formula, or of a plugin.


@dataclass(frozen=True, slots=True)
class Language:
    """How columns, functions and the direction are written."""

    column: Callable[[str], str]
    direction: Callable[[Sequence[Column]], str]
    abs: str
    cos: str
    sin: str
    max: str
    min: str


STEEP = 1e9
"""Slope of a step, and of the sign of a speed, in a formula, which has neither."""
POINTS = 13
"""Points of a smooth curve in a text."""


def _direction(columns: Sequence[Column]) -> str:
    """The direction in a formula: its column, or the sign of a speed."""
    names = {column.role: column.name for column in reversed(columns)}
    return names.get(Role.DIRECTION, f"max(-1, min(1, {STEEP:g} * {names.get(Role.SPEED, '')}))")


FORMULA = Language(str, _direction, "abs", "cos", "sin", "max", "min")
CODE = Language(
    lambda name: f"table[{name!r}]",
    lambda _: "measurements[own.Role.DIRECTION]",
    *("np.abs", "np.cos", "np.sin", "np.maximum", "np.minimum"),
)


@dataclass(frozen=True, slots=True)
class Offer:
    """An effect of one's own with the form of `terms` of one output, their `coefficients` in it and its size
    free, over `columns` of the table; `words` say the form.
    """

    terms: Sequence[Term]
    coefficients: Sequence[Array]
    columns: Sequence[Column]
    words: str

    @property
    def name(self) -> str:
        """A name until its cause is known."""
        variables = dict.fromkeys(name for term in self.terms for name in term.variables)
        return re.sub(r"\W+", "_", f"{self.terms[0].output}_of_{'_'.join(variables)}").strip("_")

    def formula(self) -> str:
        """An `[[effect]]` table whose letter `tolevo gap` fits; empty where no formula has the form: of levels,
        plays, and columns with names that no formula can have.
        """
        names = [column.name for column in self.columns]
        text = self._text(FORMULA)
        words = {name for term in self.terms for name in term.variables}
        if not text or not all(re.fullmatch(r"[A-Za-z_]\w*", name) for name in words):
            return ""
        letter = next(letter for letter in "acbkpqrsuw" if letter not in names)
        lines = f'name = "{self.name}"', f'output = "{self.terms[0].output}"', f'formula = "{letter} * ({text})"'
        return "\n".join(("[[effect]]", *lines, ""))

    def plugin(self) -> str:
        """A class; empty for levels of labels, which no other record has."""
        roles = [c.role for c in self.columns if any(c.name in term.variables for term in self.terms)]
        roles += [Role.DIRECTION] * any(term.turns for term in self.terms)
        needs = " ".join(f"own.Role.{role.name}," for role in dict.fromkeys(roles))
        title = "".join(part[:1].upper() + part[1:] for part in self.name.split("_"))
        text = self._text(CODE)
        return (
            text
            and f'''import numpy as np
from tolevo import plugins as own


class {title}(own.OneColumn):
    """{self.words[:1].upper()}{self.words[1:]}."""

    name, family, needs = "{self.name}", "own", ({needs})
    cause = "Found in a record; state the cause here."
    weight = own.Weight("size", "1 where it is as in that record", low=-np.inf)

    def column(self, measurements, values, target):
        table = measurements.table
        return {text}
'''
        )

    def _text(self, to: Language) -> str:
        """The sum of the terms; empty where the language has no form of one."""
        texts = []
        for term, weights in zip(self.terms, self.coefficients, strict=True):
            parts = _parts(term, weights, self.columns, to)
            factor = [to.direction(self.columns)] if term.turns else []
            if term.times and term.shape != "product":
                w = _scaled(to.column(term.times), term.times_zero, term.times_scale)
                factor.append(f"{f'{to.abs}({w})' if term.times_magnitude else w}**{term.times_exponent:.6g}")
            whole = f"({' + '.join(parts)})" if factor and len(parts) > 1 else " + ".join(parts)
            texts.append(" * ".join([whole, *factor]) if parts else "")
        return " + ".join(texts) if all(texts) else ""


def _scaled(name: str, zero: float, scale: float) -> str:
    """(x - zero) / scale of a column as text."""
    moved = f"({name} {'-' if zero > 0.0 else '+'} {abs(zero):.8g})" if zero else name
    return moved if scale == 1.0 else f"({moved} / {scale:.8g})"


def _parts(term: Term, weights: Array, columns: Sequence[Column], to: Language) -> list[str]:
    """The columns of a term times their weights as text, without further factors."""
    x, w = to.column(term.variable), _scaled(to.column(term.times), term.times_zero, term.times_scale)
    z = _scaled(x, term.zero, term.scale)
    if term.shape in ("spline", "curve"):
        return [_curve(term, weights, x, to)]
    if term.shape == "plays" and to is CODE:
        radii, sizes = (", ".join(f"{v:.6g}" for v in values) for values in (term.radii, weights))
        return [f"own.plays(measurements, {z}, [{radii}]) @ np.array([{sizes}])"]
    phase = f"{_radians(term, columns):.12g} * {x}" if term.shape == "wave" else f"{term.order:.8g} * {z}"
    step = f"{to.max}(0, {to.min}(1, {STEEP:g} * ({x} - ({term.zero!r})) + 1))"
    forms = {
        "constant": [""],
        "power": [_power(z, term, to)],
        "step": [step],
        "product": [f"{z} * {w}", f"{z}**2 * {w}", f"{z} * {w}**2", f"{z}**2 * {w}**2"],
    } | {key: [f"{to.cos}({phase})", f"{to.sin}({phase})"] for key in ("wave", "swing")}
    pairs = zip(weights, forms.get(term.shape, []), strict=False)
    return [f"{weight:.8g}" + f" * {form}" * bool(form) for weight, form in pairs]


def _radians(term: Term, columns: Sequence[Column]) -> float:
    """The phase of a wave [rad] per unit of the column that it is over."""
    column = next(column for column in columns if column.name == term.variable)
    return term.order * column.sense * float(converted(1.0, column.unit, fixed_unit(column)))


def _power(z: str, term: Term, to: Language) -> str:
    if term.exponent == int(term.exponent) and (term.exponent % 2 == 1) == term.signed:
        return f"{z}**{term.exponent:.0f}" if term.exponent != 1.0 else z
    if not term.signed:
        return f"{to.abs}({z})**{term.exponent:.8g}"
    return f"{z} * {to.max}(1e-12, {to.abs}({z}))**({term.exponent - 1.0:.8g})"


def _curve(term: Term, weights: Array, x: str, to: Language) -> str:
    """A spline or a curve as a broken line, level beyond its ends."""
    at = np.linspace(term.knots[0], term.knots[-1], POINTS) if term.shape == "spline" else np.array(term.knots)
    heights = replace(term, times="", turns=False).columns(Measurements({term.variable: at}, {})) @ weights
    if to is CODE:
        points, values = (", ".join(f"{v:.6g}" for v in each) for each in (at, heights))
        return f"np.interp({x}, [{points}], [{values}])"
    bends = np.diff(np.diff(heights) / np.diff(at), prepend=0.0, append=0.0)
    turns = "".join(f" + {bend:.6g} * max(0, {x} - {knot:.6g})" for bend, knot in zip(bends, at, strict=True))
    return f"({heights[0]:.6g}{turns})".replace("- -", "+ ").replace("+ -", "- ")

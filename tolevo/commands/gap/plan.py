"""The plan of a gap analysis: options, progress, `[columns]` of a table, and confounded columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ...configuration.plugins import sign_of
from ...models.effects.effect import Effect
from ...models.effects.measurements import Active
from ...models.gear import Gear
from ...models.measurable import Column, MeasurableModel, Role
from ...problems.settings import Labels
from ...section import Section
from ...units import dimension, fits
from .records import Drawing

if TYPE_CHECKING:
    import pandas as pd

    from ...tables import ColumnUse

ROLES = (*map(str, Role), "measured", "predicted", "std", "ignore")
"""The roles that `[columns]` gives."""
ROLE_UNITS = {
    "angle": ("rad", "m"),
    "torque": ("N m",),
    "force": ("N",),
    "speed": ("rpm", "m/s"),
    "temperature": ("degC",),
    "time": ("s",),
    "payload": ("kg",),
    "position": ("m",),
}
"""The units of a column of a role in effects; the second is that of linear motion."""


@dataclass(frozen=True, slots=True)
class ColumnRole:
    """Role and unit of a column of a table; `of` is the output of a prediction or noise.

    `sense` is -1 where its sign is opposite to the convention (docs/conventions.md).
    """

    role: str
    unit: str = ""
    of: str = ""
    sense: int = 1


@dataclass(frozen=True, slots=True)
class GapSettings:
    """How the loop decides.

    `false_rate` is the probability that noise alone passes the threshold, over the whole library;
    `simulations` the number of noise records it is estimated from. `set_distance` bounds the score,
    likelihood and price of parameters, of effects that are reported together. `practical_limit`
    ends the loop: the rms that a further effect explains, as a fraction of the noise. `bootstrap`
    replicates give the intervals, 0 for none. Records of more than `rows_used` rows are thinned
    while effects are searched, to one random row per stretch. `effects_at_most` and `terms_at_most` are
    the largest numbers of effects, and of generic terms in addition to them. `empirical` searches a formula where
    no effect is identified. `parts_out_of_limits` is assumed: the fraction of an input's parts that
    may be out of its limits unnoticed.
    """

    false_rate: float = 0.01
    simulations: int = 2000
    set_distance: float = 8.0
    practical_limit: float = 0.02
    bootstrap: int = 0
    interval: float = 0.9
    rows_used: int = 6000
    effects_at_most: int = 6
    terms_at_most: int = 3
    empirical: bool = False
    parts_out_of_limits: float = 0.75


@dataclass(frozen=True, slots=True)
class Span:
    """The range of an input of the next measurement, in its column's unit: from `low` to `high`, or
    one of `values` where there are any.
    """

    low: float
    high: float
    values: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class NextPlan:
    """Options of a next measurement: the number of `readings`, and their `ranges` by column.

    `effects` are those to be detected where none is identified, `amounts` the sizes of effects that
    matter: the rms in the outputs' unit on the rows of the data.
    """

    readings: int = 40
    ranges: Mapping[str, Span] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    amounts: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class GapPlan:
    """A resolved gap analysis; `configuration` is the TOML text that repeats it.

    `model` is None for `model = "table"`, whose columns `columns` describes; `rebuild` makes it
    again from other `parameters`, of which the configuration itself set
    `stated_parameters`. `free` maps the parameters that may be recalibrated to their half-widths,
    `library` are the effects considered, `own` those that the configuration states by a formula.
    `noise` holds a known standard deviation by output, `blocks` is "auto" or a column. `run` are
    the raw tables of the configuration whose allocation the corrected model is to repeat (empty for
    none), `tables` the resolved ones of the model, `active` the effects that are in it already,
    `zero` the offsets of outputs that have a zero, `sense` is -1 for outputs of reversed sign,
    `gear` that of a table. `counterparts` states what each effect of a corrected configuration does
    in the problem of `run`; None without it. `next_measurement` is None where none was requested.
    `uses` gives the use of the columns of a file in a model; `drawing` is the one that units are
    simulated by; `labels` are those of the mechanism for readers.
    """

    model_name: str
    model: MeasurableModel | None
    seed: int = 0
    parameters: Mapping[str, Any] = field(default_factory=dict)
    stated_parameters: Mapping[str, Any] = field(default_factory=dict)
    free: Mapping[str, float] = field(default_factory=dict)
    library: tuple[str, ...] = ()
    own: tuple[Effect, ...] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    blocks: str = "auto"
    columns: Mapping[str, ColumnRole] = field(default_factory=dict)
    drop_bad_rows: bool = False
    settings: GapSettings = field(default_factory=GapSettings)
    run: Mapping[str, Any] = field(default_factory=dict)
    active: tuple[Active, ...] = ()
    zero: Mapping[str, float] = field(default_factory=dict)
    sense: Mapping[str, int] = field(default_factory=dict)
    gear: Gear | None = None
    rebuild: Callable[[Mapping[str, Any]], MeasurableModel] | None = None
    counterparts: Callable[[str], Mapping[str, str]] | None = None
    tables: Mapping[str, Any] = field(default_factory=dict)
    configuration: str = ""
    uses: Mapping[str, ColumnUse] = field(default_factory=dict)
    next_measurement: NextPlan | None = None
    drawing: Drawing | None = None
    labels: Labels = Labels()


def output_of(name: str, columns: Mapping[str, ColumnRole]) -> str | None:
    """The measured column that a predicted or std column belongs to, None where it is not clear."""
    measured = [n for n, column in columns.items() if column.role == "measured"]
    if of := columns[name].of:
        return of if of in measured else None
    stem = name.removesuffix(f"_{columns[name].role}")
    if stem in measured:
        return stem
    return measured[0] if len(measured) == 1 else None


COLLINEAR_CORRELATION = 0.98
"""Correlation above which two columns carry the same information."""


def alike(first: pd.Series[Any], second: pd.Series[Any]) -> bool:
    """Whether two columns of numbers are equal but for rounding."""
    a, b = first.to_numpy(dtype=float), second.to_numpy(dtype=float)
    spread = max(float(np.ptp(a)), float(np.abs(a).max(initial=0.0)) * 1e-6)
    return bool(np.abs(a - b).max(initial=0.0) <= 1e-9 * spread)


def _is_one_way(speed: pd.Series) -> bool:
    """Whether what moves does so at a positive speed."""
    return bool((speed >= 0.0).all() and (speed > 0.0).any())


def column_messages(frame: pd.DataFrame, columns: tuple[Column, ...]) -> list[str]:
    """Sentences about columns that are constant, equal or strongly correlated."""
    numbers = [c.name for c in columns if not c.text and c.role is not Role.REPEAT]
    moving = [name for name in numbers if np.ptp(frame[name].to_numpy(dtype=float))]
    notes = [
        f"{name} is the same in every row: how the gap depends on it is not in the record"
        for name in numbers
        if name not in moving
    ]
    if Role.DIRECTION not in {c.role for c in columns}:
        speeds = [c.name for c in columns if c.role is Role.SPEED and _is_one_way(frame[c.name])]
        one_way = "is never negative, and there is no direction: rows that move count as motion in +"
        notes += [f"{name} {one_way}" for name in speeds]
    if len(moving) < 2:
        return notes
    values = np.argsort(np.argsort(frame[moving].to_numpy(dtype=float), axis=0), axis=0)
    size = np.atleast_2d(np.abs(np.corrcoef(values, rowvar=False)))
    close = [(i, k) for i, k in combinations(range(len(moving)), 2) if size[i, k] > COLLINEAR_CORRELATION]
    for i, k in close:
        first, second = moving[i], moving[k]
        same = "is a copy of" if alike(frame[first], frame[second]) else "follows"
        notes.append(f"{first} {same} {second}: their effects are confounded")
    if not close:
        notes += _collinearity_sentence(frame[moving])
    return notes


def _collinearity_sentence(frame: pd.DataFrame) -> list[str]:
    """A sentence about columns of which one is a linear combination of the others."""
    scaled = (frame - frame.mean()) / frame.std()
    values, vectors = np.linalg.eigh(np.corrcoef(scaled.to_numpy(dtype=float), rowvar=False))
    if values[0] > 1e-3:
        return []
    collinear = [name for name, x in zip(frame.columns, vectors[:, 0], strict=True) if abs(x) > 0.1]
    return [f"{', '.join(collinear)} are collinear: their effects are confounded"]


@dataclass(frozen=True, slots=True)
class GapProgress:
    """The current phase; for replicates how many are done, of how many, the remaining time [s]."""

    phase: str
    done: int = 0
    total: int = 0
    remaining: float | None = None


Report = Callable[[GapProgress], None]


def ignore_progress(progress: GapProgress) -> None:
    """Ignore the progress."""


PLAIN = ("unit", "lot", "repeat", "direction", "ignore")
"""Roles without a unit: labels, signs and counts."""
UNSIGNED = ("unit", "lot", "repeat", "ignore", "std", "time", "temperature", "payload")
"""Roles of what has no opposite."""


def read_columns(top: Section) -> dict[str, ColumnRole]:
    """Role and unit by column."""
    section = top.section("columns")
    names = section.all_keys()
    columns = {name: _column(section.section(name)) for name in names}
    valid = {name: column for name, column in columns.items() if column is not None}
    without_role = [name for name in names if columns[name] is None and "role" not in section.section(name)]
    if not names:
        top.fault("columns", 'is missing: model = "table" needs role and unit of each column')
    elif len(valid) + len(without_role) == len(columns):
        _check(section, valid)
    return valid


def _column(section: Section) -> ColumnRole | None:
    role = section.text("role", ROLES)
    unit = section.text("unit") or ""
    of = section.text("of") or ""
    sense = sign_of(section, "sense") or 1
    section.finish()
    if role is None:  # at fault, or no role: the column is not used, and a note says so
        return None
    if sense < 0 and role in UNSIGNED:
        section.fault("sense", f"has no meaning: a column of role {role} has no sign")
    choices = ROLE_UNITS.get(role)
    try:
        if unit and choices and not any(fits(unit, choice) for choice in choices):
            listed = " or ".join(f'"{choice}"' for choice in choices)
            section.fault("unit", f'must be a unit of {role} such as {listed}, got "{unit}"')
        elif unit and role not in PLAIN:
            dimension(unit)
    except ValueError as error:
        section.fault("unit", str(error))
    if choices and not unit:
        section.fault("unit", f'is missing: a column of role {role} needs a unit, such as "{choices[0]}"')
    return ColumnRole(role, unit, of, sense)


def _check(section: Section, columns: dict[str, ColumnRole]) -> None:
    """Measured and predicted columns pair; single roles are given once."""
    by = {role: [n for n, c in columns.items() if c.role == role] for role in ROLES}
    if not by["measured"]:
        section.fault("", 'no column has the role "measured"')
    if not by["predicted"]:
        section.fault("", 'no column has the role "predicted"; without a model the table must contain the prediction')
    for role in ("direction", "time", "unit", "lot", "repeat"):
        if len(by[role]) > 1:
            section.fault("", f'the role "{role}" is given to {", ".join(by[role])}: only one column can have it')
    for role in ("predicted", "std"):
        for name in by[role]:
            output = output_of(name, columns)
            if output is None and by["measured"]:
                section.section(name).fault("of", f"is missing: name the measured column that {name} belongs to")
            elif output is not None and columns[output].unit and columns[name].unit:
                _check_prediction_unit(section, name, output, columns)


def _check_prediction_unit(section: Section, name: str, output: str, columns: dict[str, ColumnRole]) -> None:
    """A prediction is in a unit of the same dimension as its measurement."""
    unit, output_unit = columns[name].unit, columns[output].unit
    try:
        if not fits(unit, output_unit):
            section.section(name).fault("unit", f'"{unit}" does not fit {output}, which is in "{output_unit}"')
    except ValueError:
        return  # the unknown unit is reported where it stands

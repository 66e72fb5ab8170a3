"""The plan of a gap analysis: options, progress, and confounded columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ...configuration.columns import ColumnRole
from ...models.effects.effect import Effect
from ...models.effects.measurements import Active
from ...models.gear import Gear
from ...models.measurable import Column, MeasurableModel, Role
from ...problems.settings import Labels
from .records import Drawing

if TYPE_CHECKING:
    import pandas as pd

    from ...tables import ColumnUse


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


COLLINEAR_CORRELATION = 0.98
"""Correlation above which two columns carry the same information."""


def alike(first: pd.Series[Any], second: pd.Series[Any]) -> bool:
    """Whether two columns of numbers are equal but for rounding."""
    a, b = first.to_numpy(dtype=float), second.to_numpy(dtype=float)
    spread = max(float(np.ptp(a)), float(np.abs(a).max(initial=0.0)) * 1e-6)
    return bool(np.abs(a - b).max(initial=0.0) <= 1e-9 * spread)


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
        speeds = [c.name for c in columns if c.role is Role.SPEED and frame[c.name].min() >= 0.0 < frame[c.name].max()]
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

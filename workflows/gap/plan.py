"""The options of a gap analysis: a resolved configuration, without the data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ...gap_drawing_records import Drawing
from ...models.effects.compose import Active
from ...models.gear import Gear
from ...models.measurable import MeasurableModel, Role
from ...problems.settings import Labels
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
    while effects are searched, to one random row per stretch. `empirical` searches a formula where
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
    `library` are the effects considered.
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

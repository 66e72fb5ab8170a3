"""A configuration that has been read, checked and completed."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import tomli_w

from ..algorithms.settings import AlgorithmSettings, Budget
from ..commands.run.choice import ChoiceSettings
from ..errors import Fault, InputError, raise_all
from ..models.gear import Gear
from ..models.measurable import Column, MeasuredTable, Role
from ..problems.settings import Settings
from ..section import Output, Section
from .columns import ColumnRole, output_of, read_columns
from .parameters import GEAR, UNRESOLVED, read_effects, read_gear, read_unresolved, resolved_gear
from .plugins import RECORD, SENSE, ZERO, read_labels, read_record, read_sense, read_zero
from .resolved import resolved_measurement

if TYPE_CHECKING:
    from ..commands.run.plan import RunPlan
    from ..problems.tolerance_problem import ToleranceProblem
    from .starts import Start

START = "start"
"""The key that names designs to begin from."""


@dataclass(frozen=True)
class Configuration:
    """The contents of a TOML file.

    `problem` and `algorithm` are None where the configuration is `model = "..."` alone. `resolved`
    holds every value, defaults included: reading it again gives the same configuration.
    """

    model_name: str
    settings: Settings
    references: str = "documents"
    problem_name: str = ""
    problem: ToleranceProblem | None = None
    algorithm_name: str = ""
    algorithm: AlgorithmSettings | None = None
    engine: str = "pymoo"
    budget: Budget = field(default_factory=Budget)
    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    start: Start | None = None
    resolved: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def plan(self) -> RunPlan:
        """The plan of `tolevo run`. The configuration must have a problem."""
        from ..commands.run.plan import RunPlan

        assert self.problem is not None
        assert self.algorithm is not None
        return RunPlan(
            problem=self.problem,
            algorithm=self.algorithm,
            budget=self.budget,
            seed=self.seed,
            references=self.references != "none",
            reference_search=self.references == "ga",
            configuration=self.toml(),
            title=self.problem_name,
            engine=self.engine,
            choice=self.choice,
            start=None if self.start is None or not len(self.start.x) else self.start.x,
            start_notes=() if self.start is None else self.start.notes,
        )

    @property
    def seed(self) -> int:
        """The seed of everything random."""
        return self.settings.seed

    def toml(self) -> str:
        """The resolved configuration as TOML."""
        return tomli_w.dumps(dict(self.resolved))

    def tables(self) -> dict[str, Any]:
        """The resolved configuration as in a file; an object in the place of a name is kept."""
        read = tomllib.loads(self.toml())
        original = {"problem": self.resolved["problem"]} if "problem" in self.resolved else {}
        return read | original

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the resolved configuration."""
        return hashlib.sha256(self.toml().encode()).hexdigest()


# `model = "table"`: a configuration whose predictions are columns of the table itself.


TABLE = "table"
LABELS = ("unit", "lot")


def read_table_model(top: Section, seed: int, faults: list[Fault]) -> Configuration:
    """The configuration of a table, as `simulate` takes it. Raises InputError with every fault."""
    top.accept(("model", "effect", UNRESOLVED, ZERO, GEAR, SENSE, RECORD))
    for key in ("parameters", "variables"):
        if top.take(key) is not None:
            top.fault(key, 'belongs to a model; model = "table" has none')
    labels, before = read_labels(top), len(faults)
    columns = read_columns(top)
    gear = read_gear(top)
    unknown = [Output(name, "", "") for name in top.section("columns").all_keys() if name not in columns]
    columns = _apply_senses(columns, read_sense(top, (*outputs_of(columns), *unknown)), top)
    if len(faults) > before:  # its effects cannot be checked without its columns
        top.finish()
        raise InputError(faults)
    model = table_model(columns, gear)
    effects = read_effects(top, model, TABLE) + read_unresolved(top, model, TABLE)
    zero, record = read_zero(top, model.outputs), read_record(top)
    top.finish()
    raise_all(faults)
    settings = Settings(
        seed=seed, effects=effects, definition=columns, zero=zero, gear=gear, labels=labels, record=record
    )
    resolved = {
        "model": TABLE,
        **labels.stated(),
        "seed": seed,
        "columns": {name: _column_table(column) for name, column in columns.items()},
        **resolved_gear(gear),
        **resolved_measurement(settings),
    }
    return Configuration(model_name=TABLE, settings=settings, resolved=resolved)


def table_model(columns: Mapping[str, ColumnRole], gear: Gear | None = None) -> MeasuredTable:
    """The model of a table with these columns."""
    by = {
        role: [n for n, c in columns.items() if c.role == role] for role in ("measured", "predicted", "std", "ignore")
    }
    apart = {name for names in by.values() for name in names}
    inputs = tuple(
        Column(name, column.unit, column.role, True, column.role in LABELS, Role(column.role), column.sense)
        for name, column in columns.items()
        if name not in apart
    )
    predictions = {str(output_of(name, dict(columns))): (name, columns[name].unit) for name in by["predicted"]}
    turned = tuple(name for name in by["predicted"] if columns[name].sense < 0)
    ignored = (*by["std"], *by["ignore"])
    return MeasuredTable(inputs, outputs_of(columns), predictions, ignored, gear, turned)


def outputs_of(columns: Mapping[str, ColumnRole]) -> tuple[Output, ...]:
    """The measured columns as outputs."""
    return tuple(Output(n, c.unit, "measured") for n, c in columns.items() if c.role == "measured")


def _apply_senses(columns: dict[str, ColumnRole], sense: Mapping[str, int], top: Section) -> dict[str, ColumnRole]:
    """The columns with the sense that `[sense]` gives of outputs."""
    for name in sense:
        if name in columns and columns[name].sense < 0:
            top.section(SENSE).fault(name, f"is given twice: here and in columns.{name}")
    return {n: replace(c, sense=sense.get(n, c.sense)) for n, c in columns.items()}


def _column_table(column: ColumnRole) -> dict[str, Any]:
    parts: dict[str, Any] = {"role": column.role, "unit": column.unit, "of": column.of}
    turned = {"sense": column.sense} if column.sense < 0 else {}
    return {key: value for key, value in parts.items() if value} | turned

"""The settings of a problem: plain frozen records, made by the configuration or by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import inf
from typing import Any

from ..declarations import Value
from ..models.capability import PartSample
from ..models.costs import CostCurve
from ..models.effects.compose import Active
from ..models.gear import Gear
from ..models.inputs import Distribution
from ..models.machines.offers import Offer
from ..tables import ColumnUse
from .promise import Promise

METHODS = ("moments", "convolution", "monte_carlo")


@dataclass(frozen=True, slots=True)
class VariableSetting:
    """A variable fixed at `value`, or searched in [low, high]; None means the problem's default.

    `mid` is that of the zone on the drawing; `sample` is what measured parts say about the process.
    """

    value: float | None = None
    low: float | None = None
    high: float | None = None
    distribution: Distribution | None = None
    mid: float | None = None
    sample: PartSample | None = field(default=None, compare=False)

    @property
    def centre(self) -> float | None:
        """Mean of a centred distribution over parts: the mid-limit, and how far it is missed."""
        if self.mid is None or self.sample is None:
            return self.mid
        return self.mid + self.sample.offset


@dataclass(frozen=True, slots=True)
class Bound:
    """A limit on an output: low <= output <= high."""

    low: float = -inf
    high: float = inf


@dataclass(frozen=True, slots=True)
class PropagationSetting:
    """How spread is propagated: one of `METHODS`, one-sided coverage, sample size."""

    method: str = "convolution"
    coverage: float = 0.9973
    samples: int = 65_536


@dataclass(frozen=True, slots=True)
class Labels:
    """What readers know a mechanism by: its name, a description, the number of its drawing."""

    name: str = ""
    description: str = ""
    drawing: str = ""

    def stated(self) -> dict[str, str]:
        """Those that are stated, by key."""
        return {key: value for key, value in asdict(self).items() if value}


@dataclass(frozen=True, slots=True)
class Money:
    """Currency of the costs, empty where they are relative; names of curves that are assumptions,
    and the assumed price of one unit of theirs.
    """

    currency: str = ""
    assumed: tuple[str, ...] = ()
    scale: float | None = None


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that distinguishes one instance of a problem from its defaults.

    Names that a mapping leaves out keep the problem's default; `objectives` empty means the
    problem's own. `definition` is what a problem that is written in the configuration (`stack`)
    was read from; `effects` are active in the model; `zero` is what an instrument adds to outputs
    of the model, `sense` is -1 of those with the opposite sign; `gear` is that of a table,
    `columns` says what the columns of a file are, `labels` what readers know the mechanism by;
    `money` is what the costs are in, `notes` say how the configuration was understood, `machines`
    make tolerances of a problem that is not a stack, `promise` is what such a problem promises.
    """

    parameters: Mapping[str, Value] = field(default_factory=dict)
    variables: Mapping[str, VariableSetting] = field(default_factory=dict)
    costs: Mapping[str, CostCurve] = field(default_factory=dict)
    propagation: PropagationSetting = PropagationSetting()
    objectives: tuple[str, ...] = ()
    limits: Mapping[str, Bound] = field(default_factory=dict)
    seed: int = 0
    definition: Any = None
    effects: tuple[Active, ...] = ()
    zero: Mapping[str, float] = field(default_factory=dict)
    sense: Mapping[str, int] = field(default_factory=dict)
    gear: Gear | None = None
    columns: Mapping[str, ColumnUse] = field(default_factory=dict)
    labels: Labels = Labels()
    money: Money = Money()
    notes: tuple[str, ...] = ()
    machines: Mapping[str, tuple[Offer, ...]] = field(default_factory=dict)
    promise: Promise | None = None

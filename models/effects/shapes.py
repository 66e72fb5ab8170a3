"""Effects that are sums of known columns: the base of most effects."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from math import atan2, degrees, hypot, inf, pi
from typing import ClassVar

import numpy as np

from ...section import Array, Output
from ..measurable import Role
from .effect import FEW, Action, Effect, EffectParameter, Measurements, Target, Values, quantity, value_or_zero

Columns = Mapping[str, Callable[[], Array]]
"""Columns (n,) by the stems of their weights, each computed when it is called."""
REFERENCE_TEMPERATURE = 20.0
"""[degC], ISO 1: the reference temperature of lengths."""
POSITIONS = ("angle", "length")
"""Kinds of outputs of effects that twist, shift, or lag behind the motion."""


@dataclass(frozen=True, slots=True)
class Weight:
    """A linear parameter of each output; its unit is that of the output divided by `per`."""

    stem: str
    meaning: str
    per: str = ""
    low: float = 0.0
    high: float = inf

    def of(self, output: Output, target: Target) -> EffectParameter:
        """The parameter of one output."""
        stem = target.prefix(output) + self.stem
        unit = f"{output.unit or 1}/{self.per}" if self.per else output.unit
        return quantity(stem, unit, self.meaning, self.low, self.high)


class Shape(Effect):
    """Acts at every output: the sum over its weights of the weight times its column."""

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        weights = self.weights(target)
        linear = [weight.of(output, target) for output in self.reached(target) for weight in weights]
        return (*linear, *self.shape_parameters(target))

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        columns = self.columns(measurements, values, target)
        weights = self.weights(target)
        actions = {}
        for output in self.reached(target):
            total = np.zeros(len(measurements))
            for weight in weights:
                size = value_or_zero(values, weight.of(output, target).name)
                if size != 0.0:
                    total = total + size * columns[weight.stem]()
            actions[output.name] = total
        return Action(output=actions)

    def plain(self, target: Target) -> bool:
        """Whether it is the sum of its columns at the outputs, and nothing else."""
        kind = type(self)
        unchanged = kind.act is Effect.act and kind.own_action is Shape.own_action
        return unchanged and kind.own_parameters is Shape.own_parameters and self.place(target) is None

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        """The nonlinear parameters, common to all outputs."""
        return ()

    @abstractmethod
    def weights(self, target: Target) -> tuple[Weight, ...]:
        """The linear parameters of one output."""

    @abstractmethod
    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        """The column (n,) of each weight, by its stem."""


class OneColumn(Shape):
    """One weight, whose column is `column`."""

    weight: Weight

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (self.weight,)

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        return {self.weights(target)[0].stem: lambda: self.column(measurements, values, target)}

    @abstractmethod
    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        """The column (n,) that the weight multiplies."""


class SignedSpeed(OneColumn):
    """In proportion to the speed, with the sign of the motion: v d."""

    needs: ClassVar[tuple[Role, ...]] = (Role.SPEED, Role.DIRECTION)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.SPEED] * measurements[Role.DIRECTION])


class Orders(Shape):
    """Waves over the angle: cosine and sine of each order, so many waves per turn.

    The orders are fixed (`orders`), or those of the gear (`follows`: names of its orders, and the
    multiple of each). The parameters are the two components, which are linear; `described`
    gives the amplitude (above or at 0) and phase of amplitude cos(order angle - phase).
    """

    orders: ClassVar[tuple[float, ...]] = ()
    follows: ClassVar[tuple[tuple[str, float], ...]] = ()
    needs: ClassVar[tuple[Role, ...]] = (Role.ANGLE,)

    def own_applies(self, target: Target) -> bool:
        """Only rotating outputs, not those of a manipulator, have waves over the angle."""
        return turns(target) and bool(self.orders_of(target)) and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return no_waves(target, *(name for name, _ in self.follows))

    def lacks(self, measurements: Measurements, target: Target) -> str:
        angle = measurements[Role.ANGLE] if Role.ANGLE in measurements else np.array([0.0, inf])
        few = min(self.orders_of(target), default=inf) * float(np.ptp(angle)) < pi
        return FEW if few else super().lacks(measurements, target)

    def orders_of(self, target: Target) -> tuple[float, ...]:
        """Its orders in this target; none where the gear does not have them."""
        if not self.follows:
            return self.orders
        if target.gear is None or not target.gear.has(*(name for name, _ in self.follows)):
            return ()
        return tuple(times * target.gear.orders[name] for name, times in self.follows)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return tuple(
            Weight(f"{part}_{order_key(order)}", f"{meaning} component of order {order:.6g}", self.per(target), -inf)
            for order in self.orders_of(target)
            for part, meaning in (("cos", "cosine"), ("sin", "sine"))
        )

    def per(self, target: Target) -> str:
        """The unit that the components are divided by."""
        return ""

    def factor(self, measurements: Measurements) -> Array | float:
        """The factor of the waves."""
        return 1.0

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        return {
            f"{part}_{order_key(order)}": partial(self._wave, measurements, order, function)
            for order in self.orders_of(target)
            for part, function in (("cos", np.cos), ("sin", np.sin))
        }

    def _wave(self, measurements: Measurements, order: float, function: Callable[[Array], Array]) -> Array:
        return self.factor(measurements) * function(order * measurements[Role.ANGLE])

    def described(self, values: Values, target: Target) -> dict[str, tuple[float, str]]:
        description: dict[str, tuple[float, str]] = {}
        for output in self.reached(target):
            by_stem = {w.stem: w.of(output, target) for w in self.weights(target)}
            for key in map(order_key, self.orders_of(target)):
                at = f"{target.prefix(output)}%s_{key}"
                description |= polar(values, by_stem[f"cos_{key}"], by_stem[f"sin_{key}"], at)
        return description


def polar(values: Values, c: EffectParameter, s: EffectParameter, at: str) -> dict[str, tuple[float, str]]:
    """Amplitude and phase [deg] of two components; `at` is the template of their names."""
    x, y = value_or_zero(values, c.name), value_or_zero(values, s.name)
    phase = degrees(atan2(y, x))
    return {at % "amplitude": (hypot(x, y), c.unit), at % "phase": (phase, "deg")}


def order_key(order: float) -> str:
    """An order as written in names of parameters: 39, 97_5."""
    return f"{order:.6g}".replace(".", "_")


def turns(target: Target) -> bool:
    """Whether the angle is that of a rotating output, not that of an arm of a manipulator."""
    return target.units.get(Role.ANGLE, "rad") == "rad" and target.model != "manipulator_pose"


def no_waves(target: Target, *names: str) -> str:
    """Why there are no waves of these orders over the angle."""
    if not turns(target):
        return "the angle is not that of a rotating output"
    if target.gear is None:
        return "no [gear] states the orders"
    lacking = [name for name in names if not target.gear.has(name)]
    return f"a gear of kind {target.gear.kind} has no {' or '.join(lacking)}"


class Load:
    """Torque, or force where there is no torque."""

    @staticmethod
    def role(target: Target) -> Role | None:
        """The role that the load has in the table, None where it has none."""
        roles = target.roles()
        return next((role for role in (Role.TORQUE, Role.FORCE) if role in roles), None)

    @staticmethod
    def applies(target: Target, needs: Iterable[Role]) -> bool:
        """Whether the table has the needed roles; a force may take the place of the torque."""
        return Load.role(target) is not None and {*needs} - {Role.TORQUE} <= target.roles()

    @staticmethod
    def unit(target: Target) -> str:
        """Its unit."""
        return "N" if Load.role(target) is Role.FORCE else "Nm"

    @staticmethod
    def of(measurements: Measurements) -> Array:
        """The load (n,) [N m or N]."""
        return np.asarray(measurements[Role.TORQUE if Role.TORQUE in measurements else Role.FORCE])

    @staticmethod
    def share(target: Target, low: float, high: float) -> tuple[float, float]:
        """Bounds of a load as fractions of the largest load, which a known table gives."""
        role = Load.role(target)
        largest = target.largest.get(role, 0.0) if role else 0.0
        return (low * largest, high * largest) if largest > 0.0 else (0.0, inf)


STEADY = 0.1
"""Standard deviation of the magnitude of a load, as a fraction of its mean, under which what grows with it does not
show: a friction that does not grow with the load is never so exactly the same.
"""


def lacks_loads(measurements: Measurements) -> str:
    """Why rows do not show what grows with the magnitude of the load; empty where they do."""
    size = np.abs(Load.of(measurements))
    return "the load is nearly the same in every row" if np.std(size) < STEADY * np.mean(size) else ""


class LoadShape(OneColumn):
    """One weight times a function of the load."""

    needs: ClassVar[tuple[Role, ...]] = (Role.TORQUE,)

    def own_applies(self, target: Target) -> bool:
        return Load.applies(target, self.needs)


def warming(measurements: Measurements) -> Array:
    """tau (n,) [K]: temperature less 20 degC, which is not fitted."""
    return np.asarray(measurements[Role.TEMPERATURE]) - REFERENCE_TEMPERATURE


def speed_unit(target: Target) -> str:
    """The unit of the speed: m/s for linear motion."""
    return target.units.get(Role.SPEED, "rpm")

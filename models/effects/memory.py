"""Effects with memory: hysteresis, creep and backlash, which depend on the rows before.

Their rows are a path, in the order of time or of the table: the driving column changes in small steps. The
driving column x is the travel where the output is a force or a torque, else the load, the command or
the angle. A path begins at rest, unloaded, in each session.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ..measurable import Role
from .effect import EffectParameter, Measurements, Target, Values, kind_of, quantity
from .measurements import path_of, path_starts, play_along_path
from .shapes import POSITIONS, Columns, OneColumn, Shape, Weight, speed_unit

FORCES = ("force", "torque", "current")
"""Kinds of outputs that friction acts on; a motor current stands for its torque."""
LOADS = (Role.TORQUE, Role.FORCE, Role.INPUT)
SHORTEST, LONGEST = 0.001, 0.2
"""Range of a presliding length, as a fraction of the travel."""


class Memory(Shape):
    """Follows a driving column along the path of the rows."""

    family = "memory"
    of_rows = True
    drives: ClassVar[tuple[Role, ...]] = (Role.ANGLE,)
    """Roles that may drive it, the first one that the table has as a path does."""

    of_reversals: ClassVar[bool] = True
    """Whether it shows only where the driving column turns back."""

    def driven_by(self, target: Target) -> Role | None:
        """The role of the driving column; None where the table has none, or its rows are no path."""
        roles = target.paths if target.largest else target.travelled()
        return next((role for role in self.drives if role in roles), None)

    def acts_in(self, target: Target | None = None) -> set[Role]:
        driving = self.driven_by(target) if target is not None else None
        load = {Role.FORCE} if driving is Role.TORQUE else set()
        return super().acts_in(target) | ({driving} if driving else set()) | load

    def own_applies(self, target: Target) -> bool:
        role = self.driven_by(target)
        shows = role in target.reversing or not (self.of_reversals and target.largest)
        return role is not None and shows and Role.POSITION not in target.roles() and super().own_applies(target)

    def lacks_path(self, target: Target) -> str:
        return "" if self.driven_by(target) is not None else self.own_reason(target)

    def own_reason(self, target: Target) -> str:
        if not target.travelled() & {*self.drives}:
            return f"no column of the role {' or '.join(map(str, self.drives))}"
        if self.driven_by(target) is not None:
            return "its memory shows only where the driving column turns back, at least twice"
        return "its memory needs rows in the order of time or of measuring, close to each other"

    def driving_unit(self, target: Target) -> str:
        """The unit of the driving column."""
        role = self.driven_by(target)
        if role is Role.ANGLE and role not in target.units:
            return "m" if speed_unit(target) == "m/s" else "rad"
        return target.units.get(role, "") if role else ""

    def fraction(self, target: Target, stem: str, meaning: str, low: float, high: float) -> EffectParameter:
        """A nonlinear parameter in the unit of the driving column, within fractions of its range."""
        reach = target.paths.get(self.driven_by(target) or Role.ANGLE, 0.0)
        ends = (low * reach, high * reach) if reach > 0.0 else (0.0, inf)
        return quantity(stem, self.driving_unit(target), meaning, *ends, linear=False)

    def path(self, measurements: Measurements, target: Target) -> tuple[NDArray[np.int64], Array, NDArray[np.bool_]]:
        """The order (n,) of the rows, the driving column (n,) in that order, and where a path begins."""
        order = measurements.in_order
        x = path_of(measurements, self.driven_by(target) or self.drives[0], target.units)
        return order, np.ascontiguousarray(x[order]), path_starts(measurements)


def in_rows(order: NDArray[np.int64], along: Array) -> Array:
    """Values (n,) along a path in the order of the rows."""
    values = np.empty(len(along))
    values[order] = along
    return values


class Presliding(Memory, OneColumn):
    """Friction that builds up over a presliding length; its level may follow the speed."""

    dimensions = FORCES
    weight = Weight("level", "c, friction in motion")
    reach = "length"

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        meaning = "L, travel over which friction builds up after a reversal"
        return (self.fraction(target, "length", meaning, SHORTEST, LONGEST),)

    def level(self, measurements: Measurements, values: Values, target: Target) -> Array:
        """Friction (n,) in steady motion, over the weight."""
        return np.ones(len(measurements))

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        from .memory_kernel import carry  # imports numba

        order, x, starts = self.path(measurements, target)
        length = max(values[self.shape_parameters(target)[0].name], np.finfo(float).tiny)
        steps = np.where(starts, 0.0, np.diff(x, prepend=x[:1]))
        level = self.level(measurements, values, target)[order]
        kept = np.exp(-np.abs(steps) / (length * level))
        return in_rows(order, carry(np.where(starts, 0.0, kept), np.sign(steps) * level * (1.0 - kept)))


class Dahl(Presliding):
    """Friction that follows a reversal as an exponential of the travel, at any speed."""

    name = "dahl_friction"
    cause = "Contacts and balls deform elastically after a reversal before they slip."
    formula = "c z, dz/dx = (1 - z sgn(dx))/L"
    mistaken_for = ("friction_hysteresis", "lugre_friction", "bouc_wen_hysteresis", "delay")
    reference = "Dahl, AIAA J. 14, 1976"


class LuGre(Presliding):
    """Presliding friction whose level falls with the speed."""

    name = "lugre_friction"
    cause = "The bristles of a contact bend before they slip, and slip more easily at speed."
    formula = "c z, dz/dx = (1 - z sgn(dx)/g)/L, g = 1 + q exp(-(v/v_s)^2)"
    needs = (Role.SPEED,)
    mistaken_for = ("dahl_friction", "stribeck", "bouc_wen_hysteresis", "delay")
    reference = "Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Autom. Control 40, 1995"

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        fastest = target.largest.get(Role.SPEED, 0.0)
        ends = (0.01 * fastest, 0.7 * fastest) if fastest > 0.0 else (0.0, inf)
        return (
            *super().shape_parameters(target),
            quantity("excess_share", "", "q, excess of friction at rest over c", 0.05, 3.0, linear=False),
            quantity("speed", speed_unit(target), "v_s, speed at which it has fallen", *ends, linear=False),
        )

    def level(self, measurements: Measurements, values: Values, target: Target) -> Array:
        _, excess, speed = (values[number.name] for number in self.shape_parameters(target))
        v = np.asarray(measurements[Role.SPEED], dtype=float) / max(speed, np.finfo(float).tiny)
        return np.asarray(1.0 + excess * np.exp(-(v**2)))


class BoucWen(Memory, OneColumn):
    """Smooth hysteresis whose loops do not depend on the rate."""

    name = "bouc_wen_hysteresis"
    cause = "Joints, springs or actuators slip in part, and follow another curve after each reversal."
    formula = "a z, dz/dx = (1 - (b sgn(dx z) + 1 - b) |z|^n)/L"
    drives = (*LOADS, Role.ANGLE)
    reach = "length"
    mistaken_for = ("dahl_friction", "friction_hysteresis", "delay")
    reference = "Wen, J. Eng. Mech. Div. ASCE 102, 1976"
    weight = Weight("amplitude", "a, half of the loop when it has slipped", low=-inf)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        opposes = all(kind_of(output.unit) in FORCES for output in target.outputs)
        return (replace(self.weight, low=0.0) if opposes else self.weight,)  # friction opposes the motion

    def driven_by(self, target: Target) -> Role | None:
        """The travel where a force is measured."""
        role = super().driven_by(target)
        forces = all(kind_of(output.unit) in ("force", "torque") for output in target.outputs)
        roles = target.paths if target.largest else target.travelled()
        return Role.ANGLE if forces and Role.ANGLE in roles else role

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (
            self.fraction(target, "length", "L, way over which it slips after a reversal", 0.01, 1.0),
            quantity("share", "", "b, share that depends on the sense of the way", 0.5, 1.0, linear=False),
            quantity("exponent", "", "n, sharpness of the corner", 1.0, 2.0, linear=False, choices=(1.0, 2.0)),
        )

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        from .memory_kernel import bouc_wen  # imports numba

        order, x, starts = self.path(measurements, target)
        length, share, exponent = (values[number.name] for number in self.shape_parameters(target))
        steps = np.where(starts, np.nan, np.diff(x, prepend=x[:1]))
        return in_rows(order, bouc_wen(steps, max(length, np.finfo(float).tiny), share, exponent))


class LoadCreep(Memory, OneColumn):
    """Delayed elastic deflection: a spring beside a damper, driven by the history of the load."""

    name = "load_creep"
    dimensions = POSITIONS
    cause = "Polymers, joints and actuators yield further while the load lasts, and recover when it is gone."
    formula = "a u, du/dt = (T - u)/t1"
    needs = (Role.TIME,)
    drives = LOADS
    of_reversals = False
    reach = "time"
    mistaken_for = ("torsional_compliance", "creep", "delay", "double_load_creep")
    reference = "Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976"
    stems: ClassVar[Mapping[str, str]] = {"time": "t1, time in which it yields"}

    def weights(self, target: Target) -> tuple[Weight, ...]:
        per = self.driving_unit(target)
        names = ("creep",) if len(self.stems) == 1 else ("fast_creep", "slow_creep")
        return tuple(Weight(name, "deflection per unit of a load that lasts", per, -inf) for name in names)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        last = target.largest.get(Role.TIME, 0.0)
        pace = target.pace
        splits = np.geomspace(2.0 * pace, 0.5 * last, len(self.stems) + 1) if last > 4.0 * pace > 0.0 else None
        lows = [0.0] * len(self.stems) if splits is None else splits[:-1].tolist()
        highs = [inf] * len(self.stems) if splits is None else splits[1:].tolist()
        return tuple(
            quantity(stem, "s", meaning, low, high, linear=False)
            for (stem, meaning), low, high in zip(self.stems.items(), lows, highs, strict=True)
        )

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        names = [number.name for number in self.shape_parameters(target)]
        stems = [weight.stem for weight in self.weights(target)]
        return {
            stem: lambda name=name: self._yielded(measurements, values[name], target)  # type: ignore[misc]
            for stem, name in zip(stems, names, strict=True)
        }

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return self._yielded(measurements, values[self.shape_parameters(target)[0].name], target)

    def _yielded(self, measurements: Measurements, constant: float, target: Target) -> Array:
        """The load (n,) that has been yielded to, the load linear between rows."""
        from .memory_kernel import carry  # imports numba

        order, x, starts = self.path(measurements, target)
        time = np.asarray(measurements[Role.TIME], dtype=float)[order]
        step = np.maximum(np.diff(time, prepend=time[:1]), 0.0) / max(constant, np.finfo(float).tiny)
        kept = np.exp(-step)
        mean = np.where(step > 0.0, -np.expm1(-step) / np.maximum(step, np.finfo(float).tiny), 1.0)
        added = np.where(starts, -x, -np.diff(x, prepend=x[:1]) * mean)
        return in_rows(order, x + carry(np.where(starts, 0.0, kept), added))


class DoubleLoadCreep(LoadCreep):
    """Delayed elastic deflection with a fast and a slow time constant."""

    name = "double_load_creep"
    cause = "Two parts under the load yield with different time constants."
    formula = "a u1 + b u2, du_i/dt = (T - u_i)/t_i"
    mistaken_for = ("load_creep", "creep", "delay", "torsional_compliance")
    together = 2
    reach = "fast_time"  # at its least the fast part follows the load at once: a compliance
    stems: ClassVar[Mapping[str, str]] = {"fast_time": "t1, of the fast part", "slow_time": "t2, of the slow part"}


COARSE, FIRST, FEWEST, KEPT, CLOSER = 200, 128, 32, 60, 7
"""Points of a grid of each of two numbers; the part of the rows it is searched in first, as a divisor, and how many at
least; around how many sets of points that jump in the same rows the search goes on, and how often in all rows, half as
far from each other at a time.
"""
SHOWN = 0.5
"""Fraction of the squares left by a play that does not stick, under which jumps are there: of noise, and of a smooth
loop, more is left.
"""


def _pairs(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """All pairs (n^2, 2) of values (n,)."""
    return np.stack(np.meshgrid(values, values, indexing="ij"), -1).reshape(-1, 2)


class BacklashStickSlip(Memory, OneColumn):
    """A driven table that stays behind by a play, sticks, and jumps."""

    name = "stick_slip_backlash"
    dimensions = POSITIONS
    cause = "The drive crosses its backlash and winds up before the table breaks away, and jumps."
    formula = "b (y - x)/w; y rests until |x - y| > w + s, and slips to |x - y| = w"
    drives = (Role.ANGLE, Role.INPUT)
    mistaken_for = ("friction_hysteresis", "lost_motion", "delay")
    reference = "Armstrong-Helouvry, Control of Machines with Friction, 1991"
    weight = Weight("half_width", "b, half of the backlash", low=-inf)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (
            self.fraction(target, "play", "w, half of the play of the input", SHORTEST, LONGEST),
            self.fraction(target, "breakaway", "s, wind-up at which it breaks away", SHORTEST, LONGEST),
        )

    def read_from(self, gap: Array, measurements: Measurements, target: Target) -> dict[str, float]:
        """The play and the wind-up whose jumps are where those of a gap are: searched on a coarse grid in its first
        rows, and closer by, in twice as many rows at a time, since a jump depends on all before.
        """
        from .memory_kernel import left_by_stick_slip  # imports numba

        order, x, starts = self.path(measurements, target)
        y, numbers = gap[order], self.shape_parameters(target)
        low, high = np.log([(number.low, number.high) for number in numbers]).T
        spacing, rows = (high - low) / (COARSE - 1), min(max(len(y) // FIRST, FEWEST), len(y))

        def left(points: Array, rows: int) -> Array:
            """Fraction of the squares of the first rows that each point leaves."""
            return np.asarray(left_by_stick_slip(x[:rows], starts[:rows], np.exp(points), y[:rows]))

        grid = points = low + spacing * _pairs(np.arange(COARSE))
        whole = apart = np.broadcast_to(spacing, grid.shape)  # by how much points are apart from their neighbours
        play, closer = float(left(grid[::COARSE], len(y)).min()), 0
        while True:
            fractions = left(points, rows)
            closer += rows == len(y)
            if closer > CLOSER:
                values = np.exp(points[int(np.argmin(fractions))]).tolist()
                shown = float(fractions.min()) < SHOWN * play
                return dict(zip((number.name for number in numbers), values, strict=True)) if shown else {}
            levels, which = np.unique(np.round(fractions, 9), return_inverse=True)
            around, widths = ([], []) if rows == len(y) else ([grid], [whole])
            for same in (which == k for k in range(min(KEPT, len(levels)))):  # which jump in the same rows
                half = np.maximum(0.5 * np.ptp(points[same], axis=0), apart[same].max(axis=0))
                around += [points[same][:1], points[same].mean(axis=0) + 0.5 * half * _pairs(np.arange(-2, 3))]
                widths += [np.broadcast_to(0.5 * half, (len(part), 2)) for part in around[-2:]]
            points, apart = np.clip(np.concatenate(around), low, high), np.concatenate(widths)
            rows = min(2 * rows, len(y))

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        from .memory_kernel import stick_slip  # imports numba

        order, x, starts = self.path(measurements, target)
        width, breakaway = (max(values[n.name], np.finfo(float).tiny) for n in self.shape_parameters(target))
        return in_rows(order, stick_slip(x, starts, width, breakaway) / width)


class DeadZoneFriction(Memory, OneColumn):
    """A dead zone that the load crosses later than it should, since friction holds part of it."""

    name = "dead_zone_with_friction"
    dimensions = POSITIONS
    cause = "Clearance is crossed only after the load has overcome the friction that holds the parts."
    formula = "c clip(play(T, f)/T0, -1, 1)"
    drives = LOADS
    mistaken_for = ("bearing_clearance", "lost_motion", "friction_hysteresis", "delay")
    reference = "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996"
    weight = Weight("half_width", "c, half of the dead zone")

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (
            self.fraction(target, "load", "T0, load that takes up the clearance", 0.01, 0.25),
            self.fraction(target, "friction", "f, load that friction holds", 0.01, 0.25),
        )

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        up, held = (max(values[n.name], np.finfo(float).tiny) for n in self.shape_parameters(target))
        load = path_of(measurements, self.driven_by(target) or self.drives[0], target.units)
        return np.clip(play_along_path(measurements, load, held) / up, -1.0, 1.0)

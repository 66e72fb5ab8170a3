"""Changes that effects make in the transmission error of adjusted units.

Effects of the assembly act in it, but for the dead band of `adjustment_backlash`, which is not
linear. Others are evaluated over one turn of the output at the problem's torque and speed, as they
act on the model `rv_transmission`: what varies over the turn is present in every unit.

- Order 40 meets that of the angles, c . x, and adds as a vector: |c . x + m|.
- Other orders together add half of their peak to peak. That is an upper bound. It is close
  for a single wave: a crest of order 39 falls so close to one of order 40 that at most 0.3 % of the
  wave is missed, 1.2 % for order 78. Multiples of 40 are locked to it and may even
  make it smaller, by as much as they have; and where several orders are added, their crests need
  not meet in one place.

Contributions that are constant over the turn change nothing, nor does the instrument.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Array
from ...models.assembly.assemble import Departures
from ...models.effects.compose import Active
from ...models.effects.effect import Target
from ...models.effects.measurements import measurements_of, target_from
from ...models.measurable import Column, Role
from ...models.rv_reducer.transmission import RvTransmission
from ...units import ARCSEC

ORDER = 40
"""Waves per turn of the output that the angles of cranks cause."""
SAMPLES = 2**14
"""Angles of the turn: over 100 per wave of the highest order (121) and per pitch of a pin."""
SMALLEST = 1e-9
"""[arcsec] A wave below this is numerical noise."""
TE = RvTransmission.outputs[0].name
ACTING = {
    "adjustment_gain_error": "adjustments achieve {:.4g} of what is commanded",
    "chain_coupling": "chain 1 moves by {:.4g} times the movement of chain 2 at its installation",
    "springback": "{:.4g} of the total adjustment returns at the end",
}
"""Linear departures of the assembly, and their descriptions."""


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """Waves that are added to every unit's transmission error over the turn of the output.

    Its order 40 is Re[`wave` exp(40 j theta)], `half_range_of_others` half the peak to
    peak of all else [rad].
    """

    wave: complex
    half_range_of_others: float


def departures_with(departures: Departures, effects: Iterable[Active]) -> Departures:
    """The departures of the assembly with those of the effects."""
    values = [effect.values for effect in effects]
    gain, coupling, springback = (sum(by_name.get(name, 0.0) for by_name in values) for name in ACTING)
    return Departures(
        gain_error=departures.gain_error + gain,
        coupling=departures.coupling + coupling,
        springback=departures.springback + springback,
    )


def waves_of(effects: Iterable[Active], torque: float, speed: float) -> Waves:
    """What effects add, at a torque [N m] that resists the motion and an output speed [rpm]."""
    over = sum((_over_turn(effect, torque, speed) for effect in effects), np.zeros(SAMPLES))
    lines = np.fft.rfft(over)
    wave = complex(2.0 * lines[ORDER] / SAMPLES)
    lines[ORDER] = 0.0
    rest = float(0.5 * np.ptp(np.fft.irfft(lines, SAMPLES)))
    return Waves(wave * ARCSEC if abs(wave) > SMALLEST else 0j, rest * ARCSEC if rest > SMALLEST else 0.0)


def _over_turn(active: Active, torque: float, speed: float) -> Array:
    """What one effect adds over a turn (SAMPLES,) [arcsec]; zero where it adds no wave."""
    table = {
        "output_angle_deg": 360.0 * np.arange(SAMPLES) / SAMPLES,
        "torque_Nm": np.full(SAMPLES, torque),
        "output_speed_rpm": np.full(SAMPLES, speed),
        "direction": np.ones(SAMPLES),
    }
    columns = tuple(column for column in RvTransmission.columns if column.name in table)
    target = target_from("rv_transmission", RvTransmission.outputs, columns)
    target = replace(target, gear=RvTransmission.gear)
    if not _adds_waves(active, target, columns):
        return np.zeros(SAMPLES)
    action = active.effect.act(measurements_of(columns, table), active.values, target)
    return np.asarray(action.output.get(TE, np.zeros(SAMPLES)))


def _adds_waves(active: Active, target: Target, columns: tuple[Column, ...]) -> bool:
    """Whether the effect adds to the output of a unit here, and its parameters are those of it."""
    effect, angled = active.effect, Role.ANGLE in active.effect.needs
    if effect.family == "instrument" or not angled or not effect.applies(target):
        return False
    names = {parameter.name for parameter in effect.parameters(target)}
    return set(active.values) <= names


def sentence(active: Active, torque: float, speed: float) -> str:
    """What one effect does here, empty where it does nothing."""
    departures = [(name, active.values.get(name, 0.0)) for name in ACTING]
    sentences = [
        ACTING[name].format(1.0 + size if name == "adjustment_gain_error" else size)
        for name, size in departures
        if size != 0.0
    ]
    waves = waves_of([active], torque, speed)
    size, rest = abs(waves.wave) / ARCSEC, waves.half_range_of_others / ARCSEC
    if size > 0.0:
        sentences.append(f"every unit has {size:.4g} arcsec of order 40, which adds to that of the angles as a vector")
    if rest > 0.0:
        sentences.append(
            f"every unit has {rest:.4g} arcsec (half peak to peak) of other orders, which adds in full: an upper bound"
        )
    if not sentences:
        return ""
    at = f", at {torque:g} Nm and {speed:g} rpm" if max(size, rest) > 0.0 else ""
    return "; ".join(sentences) + at

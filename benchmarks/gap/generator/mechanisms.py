"""What hides in the records of a rotating unit: mechanisms with their full nonlinearity.

Each draws its own dimensions and returns what it adds to the reading [arcsec]. Nothing here is
shared with the models and effects of the project.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.gap.generator.tables import Array, Points

ARCSEC = np.pi / 648000.0


@dataclass(frozen=True)
class Injected:
    """What a mechanism adds (n,), and the names that may stand beside its own."""

    added: Array
    beside: tuple[str, ...] = ()


Mechanism = Callable[[np.random.Generator, Points], Injected]


def inverse(force: Callable[[Array], Array], at: Array, reach: float) -> Array:
    """Deflections at which a rising force law has the values `at`, within +- reach."""
    x = np.linspace(-reach, reach, 40001)
    return np.interp(at, force(x), x)


def torsional_compliance(rng: np.random.Generator, at: Points) -> Injected:
    """A shaft in series that stiffens a little: T = K x (1 + s (x/x_m)^2)."""
    largest = rng.uniform(2.0, 40.0)
    stiffness, s = at.largest_torque / largest, rng.uniform(0.0, 0.03)
    twist = inverse(lambda x: stiffness * x * (1.0 + s * (x / largest) ** 2), at.torque,
                    1.2 * largest)  # fmt: skip
    return Injected(twist)


def hertz_stiffening(rng: np.random.Generator, at: Points) -> Injected:
    """Point contacts F = k x^(3/2), pressed by the torque from either side."""
    k = at.largest_torque / rng.uniform(2.0, 40.0) ** 1.5
    reach = 1.2 * (at.largest_torque / k) ** (2.0 / 3.0)
    twist = inverse(lambda x: k * np.sign(x) * np.abs(x) ** 1.5, at.torque, reach)
    return Injected(twist)


def lost_motion(rng: np.random.Generator, at: Points) -> Injected:
    """Free play, taken up on the flank that the torque loads; oil holds it near zero."""
    half, oil = rng.uniform(2.0, 30.0), 0.003 * at.largest_torque
    return Injected(half * np.tanh(at.torque / oil))


def bearing_clearance(rng: np.random.Generator, at: Points) -> Injected:
    """A journal centred by a soft spring, stopped by stiff races with a rounded onset."""
    half = rng.uniform(2.0, 30.0)
    taken_up = rng.uniform(0.06, 0.45) * at.largest_torque
    race, onset = at.largest_torque / (0.02 * half), 0.02 * half

    def force(x: Array) -> Array:
        pressed = onset * np.logaddexp(0.0, (np.abs(x) - half) / onset)
        pressed -= onset * np.logaddexp(0.0, -half / onset)
        return taken_up * x / half + race * np.sign(x) * pressed

    return Injected(inverse(force, at.torque, 1.5 * half))


def friction_hysteresis(rng: np.random.Generator, at: Points) -> Injected:
    """Dry friction that each reading approaches over a few presliding lengths (Dahl)."""
    a = rng.uniform(2.0, 20.0)
    lengths = rng.uniform(5.0, 12.0, len(at))
    return Injected(a * at.direction * (1.0 - 2.0 * np.exp(-lengths)))


def load_sharing(rng: np.random.Generator, at: Points) -> Injected:
    """A stiffness that waves 78 times a turn: what it adds to the mean wind-up."""
    wave = rng.uniform(0.02, 0.10) * np.cos(2.0 * at.pin * at.angle + rng.uniform(0.0, 2.0 * np.pi))
    windup = at.torque * rng.uniform(0.3, 0.8)
    return Injected(windup / (1.0 + wave) - windup * np.mean(1.0 / (1.0 + wave)))


def eccentric(angle: Array, arcsec: float, phase: float, radius: float) -> Array:
    """Reading error [arcsec] of a circle of that radius [mm] mounted off its centre."""
    off = arcsec * ARCSEC * radius
    s, c = off * np.sin(angle + phase), radius + off * np.cos(angle + phase)
    return np.arctan2(s, c) / ARCSEC


def output_eccentricity(rng: np.random.Generator, at: Points) -> Injected:
    """The ring of the encoder sits off the axis."""
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return Injected(eccentric(at.angle, rng.uniform(3.0, 60.0), phase, 90.0))


def pin_circle_runout(rng: np.random.Generator, at: Points) -> Injected:
    """The eccentrics meet an off-centre pin circle 39 times a turn."""
    size, phase = rng.uniform(1.0, 12.0), rng.uniform(0.0, 2.0 * np.pi)
    return Injected(size * np.sin(at.pin * at.angle + phase))


def eccentric_error(rng: np.random.Generator, at: Points) -> Injected:
    """One eccentric cut at a wrong phase: its disc centre is e (cos(a + delta) - cos a) away."""
    crank, phase = at.crank * at.angle + rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1e-4, 5e-3)
    away = (np.cos(crank + phase) - np.cos(crank)) * 1.3
    return Injected(away / (2.0 * 36.0) / ARCSEC)


def two_disc_error(rng: np.random.Generator, at: Points) -> Injected:
    """An error common to both discs: only even harmonics remain, 78 and some 80."""
    one, other = rng.uniform(0.0, 2.0 * np.pi, 2)
    size, share = rng.uniform(1.0, 10.0), rng.uniform(0.3, 0.9)
    first = np.sin(2.0 * at.pin * at.angle + one)
    return Injected(size * (first + share * np.sin(2.0 * at.crank * at.angle + other)))


def sun_runout(rng: np.random.Generator, at: Points) -> Injected:
    """The sun runs out, in the carrier's frame 120 and in that of the housing 121 times a turn."""
    one, other = rng.uniform(0.0, 2.0 * np.pi, 2)
    size, share = rng.uniform(1.0, 10.0), rng.uniform(0.3, 0.9)
    first = np.sin(at.over * at.angle + one)
    return Injected(size * (first + share * np.sin((at.over + 1.0) * at.angle + other)))


def pitch_defect(rng: np.random.Generator, at: Points) -> Injected:
    """One bad pin: a bump (1 + cos)/2 each time that an eccentric passes it."""
    width, place = rng.uniform(0.5, 1.2), rng.uniform(0.0, 2.0 * np.pi)
    away = np.angle(np.exp(1j * (at.pin * at.angle - place)))
    bump = np.where(np.abs(away) < width, 0.5 + 0.5 * np.cos(np.pi * away / width), 0.0)
    return Injected(rng.uniform(3.0, 30.0) * bump)


EXCITED = ("pin_circle_runout", "eccentric_error", "two_disc_error", "two_disc_error", "sun_runout")
"""What makes the first five of `excitations`."""


def structural_resonance(rng: np.random.Generator, at: Points) -> Injected:
    """A driven oscillator: whichever order meets its frequency is amplified and lags."""
    which = int(rng.choice(len(EXCITED)))
    order = at.excitations[which]
    own = order / 60.0 * rng.uniform(0.35, 0.8) * at.speed.max()
    ratio = order * at.speed / 60.0 / own
    response = 1.0 / (1.0 - ratio**2 + 2j * rng.uniform(0.02, 0.06) * ratio)
    phase = order * at.angle + rng.uniform(0.0, 2.0 * np.pi)
    moving = np.abs(response) * np.cos(phase + at.direction * np.angle(response))
    return Injected(rng.uniform(0.5, 3.0) * moving, (EXCITED[which],))


def viscous_friction(rng: np.random.Generator, at: Points) -> Injected:
    """Oil drag winds the unit up in proportion to its speed."""
    a = rng.uniform(0.05, 1.0)
    return Injected(a * at.speed * at.direction)


def windage(rng: np.random.Generator, at: Points) -> Injected:
    """Churned oil: a drag with the square of the speed."""
    a = rng.uniform(0.001, 0.02)
    return Injected(a * at.speed * np.abs(at.speed) * at.direction)


def read_out_lag(rng: np.random.Generator, at: Points) -> Injected:
    """The output is sampled late: it has moved on by then."""
    late = rng.uniform(2e-6, 1e-4)
    output = at.direction * at.speed * 2.0 * np.pi / 60.0
    return Injected((output * 100.0 - output * (100.0 - late)) / ARCSEC)


def differential_thermal_expansion(rng: np.random.Generator, at: Points) -> Injected:
    """Discs warmer than the housing by a share of the temperature: half the backlash moves."""
    share = rng.uniform(0.05, 0.6)
    grown = 64.0 * ((1.0 + 11.5e-6 * share) ** at.tau - 1.0)
    backlash = 2.0 * np.sqrt(1.0 - 0.8125**2) * grown / (1.3 * 39.0)
    return Injected(-0.5 * backlash / ARCSEC * at.direction)


def thermal_friction(rng: np.random.Generator, at: Points) -> Injected:
    """Drag of an oil whose viscosity falls as Arrhenius says, against that at 20 degC."""
    activation = rng.uniform(2500.0, 6000.0)
    thinner = np.exp(activation * (1.0 / (at.tau + 293.15) - 1.0 / 293.15))
    return Injected(rng.uniform(3.0, 30.0) * (thinner - 1.0) * at.direction)


def wear(rng: np.random.Generator, at: Points) -> Injected:
    """Flanks recede with the work done (Archard): the backlash grows on either side."""
    gone = np.cumsum(np.abs(at.torque) * at.speed * np.gradient(at.time))
    return Injected(rng.uniform(2.0, 30.0) * gone / gone[-1] * at.direction)


def drift(rng: np.random.Generator, at: Points) -> Injected:
    """The zero of the read-out walks."""
    a = rng.uniform(2.0, 30.0) / at.time[-1]
    return Injected(a * at.time)


def creep(rng: np.random.Generator, at: Points) -> Injected:
    """A sum of exponential relaxations with times spread over the decades: nearly a logarithm."""
    slowest = np.log10(at.time[-1])
    times = np.logspace(slowest + rng.uniform(-3.0, -2.0), slowest + 2.0, 60)
    relaxed = 1.0 - np.exp(-at.time[:, None] / times)
    return Injected(rng.uniform(0.3, 3.0) * relaxed.mean(axis=1) * 10.0)


def encoder_harmonics(rng: np.random.Generator, at: Points) -> Injected:
    """An encoder whose ring is oval and eccentric: orders 2 and 4, some 1."""
    phases, size = rng.uniform(0.0, 2.0 * np.pi, 3), rng.uniform(2.0, 15.0)
    parts = size * np.array([rng.uniform(0.0, 0.5), 1.0, rng.uniform(0.2, 0.7)])
    waves = np.sin(np.outer(at.angle, [1.0, 2.0, 4.0]) + phases)
    return Injected(waves @ parts)


ROTATING: dict[str, Mechanism] = {
    one.__name__: one
    for one in (
        torsional_compliance, hertz_stiffening, lost_motion, bearing_clearance,
        friction_hysteresis, load_sharing, output_eccentricity, pin_circle_runout,
        eccentric_error, two_disc_error, sun_runout, pitch_defect, structural_resonance,
        viscous_friction, windage, read_out_lag, differential_thermal_expansion,
        thermal_friction, wear, drift, creep, encoder_harmonics,
    )
}  # fmt: skip

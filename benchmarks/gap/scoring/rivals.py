"""What each name of the library looks like in a record, by the formulas of the notes.

Own code of the trial's: the scorer asks with it what a record can tell apart, the baselines name
with it. It shares nothing with the effects of the project, nor with the hidden mechanisms.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
from scipy.optimize import minimize, nnls

from benchmarks.gap.generator.assemblies import Faults, departure
from benchmarks.gap.generator.kinds import smooth
from benchmarks.gap.generator.populations import Units
from benchmarks.gap.generator.tables import Array, Points
from benchmarks.gap.scoring.manipulator_rivals import MANIPULATOR_RIVALS
from benchmarks.gap.scoring.rival import Columns, fixed
from benchmarks.gap.scoring.rival import Rival as Rival

Which = Callable[[Points], tuple[float, ...]]
EXCITATIONS = 6


def torque_law(law: Callable[[Array], Array]) -> Columns:
    return lambda at, _: law(at.torque)[:, None]


def clipped(at: Points, p: Array) -> Array:
    return np.asarray(np.clip(at.torque / (p[0] * at.largest_torque), -1.0, 1.0)[:, None])


def waves(at: Points, _: Array, which: Which, loaded: bool = False) -> Array:
    turns = np.outer(at.angle, which(at))
    found = np.hstack([np.cos(turns), np.sin(turns)])
    return np.asarray(found * at.torque[:, None] if loaded else found)


def bump(at: Points, p: Array) -> Array:
    away = np.abs(np.angle(np.exp(1j * (at.pin * at.angle - p[0]))))
    return np.where(away < p[1], np.cos(0.5 * np.pi * away / p[1]) ** 2, 0.0)[:, None]


def resonant(at: Points, p: Array, which: int) -> Array:
    """A wave of that order through an oscillator at p[0] of the largest speed, damping p[1]."""
    ratio = at.speed / (p[0] * at.speed.max())
    answer = 1.0 / (1.0 - ratio**2 + 2j * p[1] * ratio)
    phase = at.excitations[which] * at.angle + at.direction * np.angle(answer)
    wave = np.abs(answer) * np.exp(1j * phase)
    return np.column_stack([wave.real, wave.imag])


def flipped(law: Callable[[Points, Array], Array]) -> Columns:
    """A law that changes sign with the direction."""
    return lambda at, p: (law(at, p) * at.direction)[:, None]


def thinning(at: Points, p: Array) -> Array:
    return np.asarray(np.expm1(-p[0] * at.tau))


def logarithm(at: Points, p: Array) -> Array:
    return np.asarray(np.log1p(at.time / (p[0] * at.time[-1]))[:, None])


def play_less_torque(at: Points, p: Array) -> Array:
    """The play operator of the torque, its half-width p[0] of the largest, less the torque."""
    half, output, found = p[0] * at.largest_torque, 0.0, np.empty(len(at))
    for row, torque in enumerate(at.torque.tolist()):
        output = min(max(output, torque - half), torque + half)
        found[row] = output
    return (found - at.torque)[:, None]


def products(at: Points, _: Array) -> Array:
    """Load times speed, with the load's sign and against the motion."""
    signed = at.torque * at.speed
    return np.column_stack([signed, np.abs(signed) * at.direction])


def falling(at: Points, p: Array) -> Array:
    """Friction at rest above that in motion, and that in motion."""
    rest = np.exp(-((at.speed / (p[0] * at.speed.max())) ** 2))
    return np.column_stack([rest * at.direction, at.direction])


SHARES = tuple(np.geomspace(0.02, 0.5, 12).tolist())
LOADED = (
    Rival("torsional_compliance", torque_law(lambda t: t)),
    Rival("hertz_stiffening", torque_law(lambda t: np.cbrt(t) * np.cbrt(np.abs(t)))),
    Rival("lost_motion", torque_law(np.sign)),
    Rival("bearing_clearance", clipped, fixed(SHARES)),
)
TIMED = (
    Rival("drift", lambda at, _: at.time[:, None]),
    Rival("creep", logarithm, fixed(tuple(np.geomspace(1e-4, 1.0, 12).tolist()))),
)
FLIPPED = (
    Rival("viscous_friction", flipped(lambda at, _: at.speed)),
    Rival("read_out_lag", flipped(lambda at, _: at.speed), either_sign=True),
    Rival("windage", flipped(lambda at, _: at.speed**2)),
    Rival("thermal_friction", flipped(thinning), fixed((0.005, 0.01, 0.02, 0.04, 0.07, 0.1))),
    Rival("wear", flipped(lambda at, _: at.time)),
)
EXPANSION = Rival("differential_thermal_expansion", flipped(lambda at, _: at.tau),
                  either_sign=True)  # fmt: skip
ANGLES = (
    Rival("load_sharing", partial(waves, which=lambda at: (2.0 * at.pin,), loaded=True), linear=2),
    Rival("output_eccentricity", partial(waves, which=lambda _: (1.0,)), linear=2),
    Rival("pin_circle_runout", partial(waves, which=lambda at: (at.pin,)), linear=2),
    Rival("eccentric_error", partial(waves, which=lambda at: (at.crank,)), linear=2),
    Rival("two_disc_error", partial(waves, which=lambda at: at.excitations[2:4]), linear=4),
    Rival("sun_runout", partial(waves, which=lambda at: at.excitations[4:]), linear=4),
    Rival("encoder_harmonics", partial(waves, which=lambda _: (1.0, 2.0, 4.0)), linear=6),
    Rival("pitch_defect", bump,
          (tuple(np.linspace(0.0, 2.0 * np.pi, 25)[:-1].tolist()), (0.5, 1.2))),
)  # fmt: skip
RESONANT = tuple(
    Rival("structural_resonance", partial(resonant, which=which),
          (tuple(np.linspace(0.3, 0.9, 25).tolist()), (0.02, 0.06)), linear=2)
    for which in range(EXCITATIONS)
)  # fmt: skip
HYSTERESIS = Rival("friction_hysteresis", flipped(lambda at, _: np.ones(len(at))))
LOOP = Rival("friction_hysteresis", play_less_torque, fixed((0.02, 0.05, 0.1, 0.15, 0.2, 0.3)))
PRESSED = Rival("load_friction", flipped(lambda at, _: np.abs(at.torque)))
WARM_ZERO = Rival("thermal_zero", lambda at, _: at.tau[:, None], either_sign=True)
IN_MOTION = (
    Rival("load_viscous", products, linear=2),
    Rival("stribeck", falling, fixed((0.02, 0.05, 0.1, 0.2, 0.4, 0.7)), linear=2, positive=True),
)
LATE = Rival(
    "delay",
    lambda at, p: (smooth(at.sooner(p[0] * at.pace)) - smooth(at))[:, None],
    fixed((-8.0, -4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0, 8.0)),
    linear=0,
)
"""A channel that comes late: what it adds is no multiple of anything."""
WITHOUT_GEAR = (*LOADED, *TIMED, *FLIPPED, EXPANSION, PRESSED, WARM_ZERO, *IN_MOTION, HYSTERESIS)
ROTATING_RIVALS = (*WITHOUT_GEAR, *ANGLES, *RESONANT)
UNKNOWN_RIVALS = (
    *WITHOUT_GEAR,
    *(one for one in ANGLES if one.name in ("output_eccentricity", "encoder_harmonics")),
    *(Rival("gear_order", partial(waves, which=which), linear=2)
      for which in (lambda at: (at.pin,), lambda at: (at.crank,))),
)  # fmt: skip
LOCKED_RIVALS = (*LOADED, *TIMED, FLIPPED[-1], EXPANSION, PRESSED, WARM_ZERO, LOOP)


def of_lots(at: Units, _: Array) -> Array:
    return np.asarray(at.lot[:, None] == np.arange(1, at.lot.max() + 1), dtype=float)


BATCH_RIVALS = (
    *(
        Rival(name, lambda at, _: np.ones((len(at), 1)), either_sign=True)
        for name in ("process_mean_shift", "gauge_bias")
    ),
    Rival("tool_wear_drift", lambda at, _: at.number[:, None], either_sign=True),
    Rival("spread_inflation", lambda at, _: (at.drawn - at.drawn.mean())[:, None]),
    *(Rival(name, of_lots, either_sign=True) for name in ("lot_offset", "lot_mixture")),
    Rival("differential_thermal_expansion", lambda at, _: at.tau[:, None], either_sign=True),
)


def tangent(fault: str) -> Columns:
    """What a little of a fault of the assembly adds, per unit of it."""
    return lambda at, _: departure(at, Faults(**{fault: 1e-4}))[:, None] / 1e-4


ASSEMBLY_RIVALS = (
    Rival("adjustment_gain", tangent("gain"), either_sign=True),
    Rival("chain_coupling", tangent("coupling"), either_sign=True),
    Rival("springback", tangent("back")),
    Rival("adjustment_backlash", lambda at, p: departure(at, Faults(play=float(p[0])))[:, None],
          fixed(tuple(np.geomspace(0.02, 1.0, 15).tolist())), linear=0),
)  # fmt: skip
FIRST = {
    "torsional_compliance": "compliance", "hertz_stiffening": "at_1", "lost_motion": "half_width",
    "bearing_clearance": "half_width", "drift": "rate", "creep": "rate", "wear": "rate",
    "viscous_friction": "rate", "read_out_lag": "rate", "windage": "rate",
    "thermal_friction": "half_width", "differential_thermal_expansion": "rate",
    "load_sharing": "cos_78", "output_eccentricity": "cos_1", "pin_circle_runout": "cos_39",
    "eccentric_error": "cos_40", "two_disc_error": "cos_78", "sun_runout": "cos_120",
    "encoder_harmonics": "cos_1", "process_mean_shift": "shift", "tool_wear_drift": "rate",
    "spread_inflation": "growth", "adjustment_gain": "adjustment_gain",
    "chain_coupling": "chain_coupling", "springback": "springback", "joint_zero_offset": "zero_1",
    "arm_length_error": "length_1", "base_tilt": "x_", "gravity_sag": "compliance_1",
    "thermal_growth": "expansion", "drive_eccentricity": "drive_cos_1",
    "joint_clearance": "joint_clearance", "gauge_bias": "dr_offset", "load_friction": "rate",
    "load_viscous": "signed", "stribeck": "excess", "thermal_zero": "rate", "gear_order": "cos",
}  # fmt: skip
"""How the published name of the parameter begins that the first column's coefficient is."""


def first_parameter(name: str, kind: str) -> str:
    """The parameter whose interval is judged, empty where none is."""
    if name == "friction_hysteresis":
        return "half_width" if KIND_TURNS[kind] else "compliance"
    return FIRST.get(name, "")


KIND_TURNS: dict[str, bool] = dict.fromkeys(
    (
        "rotating",
        "bench",
        "friction",
        "own gear",
        "unknown gear",
        "late",
        "presliding",
        "yielding",
        "plays",
        "rv_transmission",
    ),
    True,
)
KIND_TURNS |= dict.fromkeys(("lost_motion", "rv_lost_motion"), False)
RIVALS: dict[str, tuple[Rival, ...]] = {
    "rotating": ROTATING_RIVALS,
    "own gear": ROTATING_RIVALS,
    "unknown gear": UNKNOWN_RIVALS,
    "late": (*WITHOUT_GEAR, LATE),
    "bench": ROTATING_RIVALS,
    "friction": (HYSTERESIS, *FLIPPED, PRESSED, *TIMED, *IN_MOTION),
    "presliding": (HYSTERESIS, *FLIPPED, PRESSED, *TIMED, *IN_MOTION),
    "yielding": WITHOUT_GEAR,
    "plays": (HYSTERESIS, *FLIPPED, PRESSED, *TIMED, *IN_MOTION),
    "rv_transmission": ROTATING_RIVALS,
    "lost_motion": LOCKED_RIVALS,
    "rv_lost_motion": LOCKED_RIVALS,
    "rv_batch": BATCH_RIVALS,
    "assembly": ASSEMBLY_RIVALS,
    "manipulator_pose": MANIPULATOR_RIVALS,
}


@lru_cache(maxsize=8)
def basis_of(key: bytes, rows: int) -> Array:
    """Orthonormal basis of the columns that the bytes are."""
    free = np.frombuffer(key).reshape(rows, -1)
    if free.shape[1] == 0:
        return free
    vectors, values, _ = np.linalg.svd(free / np.linalg.norm(free, axis=0), full_matrices=False)
    return vectors[:, values > 1e-9 * values[0]]


def without(free: Array, what: Array) -> Array:
    """What no combination of the columns `free` makes."""
    basis = basis_of(np.ascontiguousarray(free).tobytes(), len(free))
    return np.asarray(what - basis @ (basis.T @ what))


def left_at(rival: Rival, p: Array, at: Any, free: Array, what: Array) -> float:
    """Squares of `what` (n,), already without `free`, that the rival leaves at p."""
    columns = without(free, rival.columns(at, p))
    if columns.shape[1] == 1:
        norm = float((columns**2).sum())
        slope = float(columns[:, 0] @ what) / norm if norm > 1e-12 else 0.0
        slope = slope if rival.either_sign else max(slope, 0.0)
        return float(((what - slope * columns[:, 0]) ** 2).sum())
    solved = amplitudes(rival, columns, what)
    return float(((what - columns @ solved) ** 2).sum())


def amplitudes(rival: Rival, columns: Array, what: Array) -> Array:
    """Least-squares amplitudes (m,) of several columns (n, m)."""
    if rival.positive:
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        return np.asarray(nnls(columns / size, what)[0] / size)
    return np.asarray(np.linalg.lstsq(columns, what, rcond=None)[0], dtype=np.float64)


def coefficients(rival: Rival, p: Array, at: Any, free: Array, what: Array) -> Array:
    """Least-squares coefficients (m,) of the rival's columns beside the free parameters."""
    columns = without(free, rival.columns(at, p))
    return amplitudes(rival, columns, without(free, what))


def least_left(rival: Rival, at: Any, free: Array, what: Array) -> tuple[float, Array]:
    """The least that the rival leaves, its nonlinear parameters fitted, and where."""
    what = without(free, what)
    starts = list(rival.starts())
    found = [left_at(rival, p, at, free, what) for p in starts]
    best = int(np.argmin(found))
    if not rival.grids:
        return found[best], starts[best]
    low = [min(grid) for grid in rival.grids]
    high = [max(grid) for grid in rival.grids]

    def left(p: Array) -> float:
        return left_at(rival, p, at, free, what)

    fitted = minimize(
        left, starts[best], method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={"maxiter": 25 * len(low), "xatol": 1e-4, "fatol": 1e-6 * found[best]},
    )  # fmt: skip
    return float(fitted.fun), np.asarray(fitted.x)

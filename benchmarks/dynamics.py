# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Steady states of torsional vibration against `solve_ivp`: `python benchmarks/dynamics.py`.

One unit with part errors, its tabulated mesh, on one thread. scipy integrates the same table, read
between the output angles by cubic interpolation, from rest at the quasi-static twist through the
transient and one output turn; its method and tolerance are the fastest of those tried whose TE
amplitude is as near to a tight integration as that of the steady state (0.5 % at most).
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import math
import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any, Literal, cast

import numba
import numpy as np
from scipy.integrate import solve_ivp

from tolevo.models.rv_reducer.dynamics import Oscillator, TabulatedMesh, Train, steady_state, tabulate_mesh
from tolevo.models.rv_reducer.lost_motion import unit_under_load as loaded_unit
from tolevo.section import Array

SAMPLES, TORQUE, ACCURACY = 4000, 412.0, 5e-3
RPM = (10.0, 15.0, 30.0)
SETTLED = 1e-3
"""What is left of the transient when the turn begins that is read."""
BATCH = np.linspace(10.0, 40.0, 64)
TIGHT = 1e-9
UNIT = {"pin_circle_runout_um": 5.0, "eccentric_phase_1_mrad": 1.0, "sharing_percent": 10.0}
Motion = Callable[[float, Array], Any]
Method = Literal["RK45", "DOP853"]


TRIED: tuple[tuple[Method, float], ...] = (
    ("RK45", 1e-3),
    ("RK45", 1e-4),
    ("RK45", 1e-5),
    ("DOP853", 1e-3),
    ("DOP853", 1e-5),
    ("DOP853", 1e-6),
)


def numpy_motion(mesh: TabulatedMesh, inertia: float, c: float, speed: float) -> Motion:
    """Right-hand side with arrays: four output angles around the present one at once."""
    step, n = mesh.nodes[1] - mesh.nodes[0], mesh.samples
    near, fact = np.arange(-1, 3), np.array([-6.0, 2.0, -2.0, 6.0])
    others = np.array([[0, 1, 2], [-1, 1, 2], [-1, 0, 2], [-1, 0, 1]])

    def motion(t: float, y: Array) -> Array:
        place = (speed * t / (2.0 * np.pi)) % 1.0 * n
        first = int(place)
        at = (first + near) % n
        weight = np.prod(place - first - others, axis=1) / fact
        node = (np.arcsinh(y[0] / mesh.scale) - mesh.nodes[0]) / step
        cell = int(node)
        u = node - cell
        low, high = mesh.torques[cell, at], mesh.torques[cell + 1, at]
        rise, fall = step * mesh.slopes[cell, at], step * mesh.slopes[cell + 1, at]
        chord = high - low
        torque = low + u * (chord + (1 - u) * ((rise - chord) * (1 - u) - (fall - chord) * u))
        return np.array([y[1], (TORQUE - torque @ weight - c * y[1]) / inertia])

    return motion


@numba.njit(cache=False)
def _acceleration(
    angle: float, twist: float, rate: float, torques: Array, slopes: Array, scale: float,
    first_node: float, step: float, inertia: float, c: float, torque: float,
) -> float:  # fmt: skip
    n = torques.shape[1]
    place = (angle / (2.0 * math.pi)) % 1.0 * n
    first = int(place)
    f = place - first
    weight = (
        -f * (f - 1.0) * (f - 2.0) / 6.0,
        (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
        -(f + 1.0) * f * (f - 2.0) / 2.0,
        (f + 1.0) * f * (f - 1.0) / 6.0,
    )
    node = (math.asinh(twist / scale) - first_node) / step
    cell = int(node)
    u = node - cell
    held = 0.0
    for k in range(4):
        at = (first + k - 1) % n
        low, chord = torques[cell, at], torques[cell + 1, at] - torques[cell, at]
        bend = (step * slopes[cell, at] - chord) * (1.0 - u)
        bend -= (step * slopes[cell + 1, at] - chord) * u
        held += weight[k] * (low + u * (chord + (1.0 - u) * bend))
    return (torque - held - c * rate) / inertia


def compiled_motion(mesh: TabulatedMesh, inertia: float, c: float, speed: float) -> Motion:
    """The same right-hand side, compiled."""
    step, start = float(mesh.nodes[1] - mesh.nodes[0]), float(mesh.nodes[0])

    @numba.njit
    def motion(t: float, y: Array) -> tuple[float, float]:
        pull = _acceleration(speed * t, y[0], y[1], torques, slopes, scale, start, step, inertia, c,
                             TORQUE)  # fmt: skip
        return y[1], pull

    torques, slopes, scale = mesh.torques, mesh.slopes, mesh.scale
    return cast(Motion, motion)


def integrated(motion: Motion, start: Array, settle: float, turn: float, method: Method, rtol: float) -> float:
    """TE amplitude [rad] of the turn after the transient; the turn begins at t = 0."""
    times = turn * np.arange(SAMPLES) / SAMPLES
    found = solve_ivp(motion, (-settle, turn), start, method, times, rtol=rtol, atol=rtol * 1e-4)
    return 0.5 * float(np.ptp(found.y[0]))


def seconds(function: Callable[[], Any], turns: int) -> tuple[float, Any]:
    """Median CPU time [s], and what the function returned."""
    times, found = [], None
    for _ in range(turns):
        start = time.process_time()
        found = function()
        times.append(time.process_time() - start)
    return median(times), found


def fastest(motion: Motion, start: Array, settle: float, turn: float, exact: float) -> str:
    """CPU time and name of the fastest integration that is accurate enough, and its error."""
    best = (math.inf, "", 0.0)
    for method, rtol in TRIED:
        run = partial(integrated, motion, start, settle, turn, method, rtol)
        spent, amplitude = seconds(run, 1)
        error = abs(amplitude / exact - 1.0)
        if error <= ACCURACY and spent < best[0]:
            best = (spent, f"{method}, rtol {rtol:g}", error)
    return f"{best[0]:.3f} s ({best[1]}, {100.0 * best[2]:.2f} %)"


def compare(mesh: TabulatedMesh, rpm: float, each: float) -> None:
    train, speed = Train(), rpm * 2.0 * math.pi / 60.0
    points = Oscillator.of(mesh, train, np.array(TORQUE), np.array(speed))
    inertia, c = float(points.inertia[0]), float(points.damping[0])
    alone, state = seconds(lambda: steady_state(mesh, points, 1e-8), 7)
    start = np.array([float(mesh.equilibrium(np.array(TORQUE)).mean()), 0.0])
    settle, turn = -2.0 * inertia / c * math.log(SETTLED), 2.0 * math.pi / speed
    compiled = compiled_motion(mesh, inertia, c, speed)
    compiled(0.0, start)  # compiles
    exact = integrated(compiled, start, 3.0 * settle, turn, "DOP853", TIGHT)
    amplitude = 0.5 * float(np.ptp(state.twist))
    print(f"{rpm:g} rpm: amplitude {amplitude / math.radians(1 / 3600):.3f} arcsec, "
          f"{100.0 * abs(amplitude / exact - 1.0):.2f} % off; {1e3 * alone:.1f} ms alone, "
          f"{1e3 * each:.1f} ms in a batch of {len(BATCH)}")  # fmt: skip
    for name, motion, wanted in (("numpy", numpy_motion(mesh, inertia, c, speed), 100), ("compiled", compiled, 10)):
        text = fastest(motion, start, settle, turn, exact)
        ratio = float(text.split()[0])
        print(f"  solve_ivp, {name} right-hand side: {text}; ratio {ratio / alone:.0f} alone, "
              f"{ratio / each:.0f} in the batch (at least {wanted} wanted)")  # fmt: skip


def main() -> None:
    mesh = tabulate_mesh(loaded_unit(UNIT).mesh(SAMPLES), 2058.0)
    speed = BATCH * 2.0 * np.pi / 60.0
    many = Oscillator.of(mesh, Train(), np.array(TORQUE), speed)
    each = seconds(lambda: steady_state(mesh, many, 1e-8), 3)[0] / len(BATCH)
    for rpm in RPM:
        compare(mesh, rpm, each)


if __name__ == "__main__":
    main()

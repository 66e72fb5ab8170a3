# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Speed of the loaded contact on one thread: `python benchmarks/contact.py`.

Quasi-static transmission error of 1000 units at 256 crank angles, 80 contacts each, against a loop
of scipy's `brentq` at its default tolerance over points whose gaps are given to it for nothing.
Times are CPU times of this process, so that other work on the computer counts less; the loop is
measured on a part, in turns with the compiled batch, and extrapolated as printed.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from statistics import median

import numpy as np
from scipy.optimize import brentq

from tolevo.models.rv_reducer.contact.contact import LoadedContact
from tolevo.models.rv_reducer.contact.geometry import Mesh, PartErrors
from tolevo.section import Array

UNITS, ANGLES, TORQUE = 1000, 256, 412.0
PART = 400
BRACKET = (-0.01, 0.01)
TURNS = 5


def part_errors(units: int, rng: np.random.Generator) -> PartErrors:
    """Errors of every kind, of the size that parts have."""

    def normal(sigma: float, *shape: int) -> Array:
        return sigma * rng.standard_normal((units, *shape))

    return PartErrors(
        pin_radius=normal(0.3e-6, 1, 40),
        hole_radius=normal(0.5e-6, 1, 40),
        radial_position=normal(1e-6, 1, 40),
        tangential_position=normal(1e-6, 1, 40),
        equidistance=normal(0.3e-6, 2),
        shift=normal(0.3e-6, 2),
        pitch=np.abs(normal(2e-6, 2)),
        pitch_phase=normal(3.0, 2),
        disc_offset=normal(0.3e-6, 2),
        disc_offset_phase=normal(3.0, 2),
        angle=normal(1e-5, 2),
        crank_phase=normal(1e-4, 2, 2),
        eccentricity=normal(0.5e-6, 2, 2),
        bearing_clearance=np.abs(normal(0.5e-6, 2, 2)),
        circle_radius=normal(1e-6),
        circle_offset=normal(1e-6),
    )


@dataclass(frozen=True, slots=True)
class Point:
    """One unit at one angle, as a loop over points would have it."""

    gap: Array
    lever: Array
    turn: Array
    play: Array
    stiffness: float
    compliance: float
    torque: float

    def rigid(self, at: float) -> float:
        """Torque that is left at a rotation, discs rigid on the carrier."""
        closed = self.lever * (at + self.turn)[:, None] - self.gap
        held = np.sum(self.stiffness * np.maximum(0.0, closed) * self.lever)
        return float(held) - self.torque

    def mesh(self, disc: int, x: float) -> float:
        """Torque of one disc at its own rotation."""
        arm = self.lever[disc]
        return self.stiffness * float(np.sum(np.maximum(0.0, arm * x - self.gap[disc]) * arm))

    def balance(self, x: float, disc: int, turned: float) -> float:
        """Torque between mesh and spring of one disc, the carrier turned."""
        pulled, free = turned - x, self.play[disc]
        spring = np.sign(pulled) * max(0.0, abs(pulled) - free) / self.compliance
        return float(self.mesh(disc, x) - spring)

    def on_springs(self, at: float) -> float:
        """Torque that is left at a rotation, each disc in balance on its spring."""
        held = 0.0
        for disc, turned in enumerate(at + self.turn):
            held += self.mesh(disc, float(brentq(self.balance, *BRACKET, args=(disc, turned))))
        return held - self.torque


def point_by_point(mesh: Mesh, points: list[tuple[int, int]], rigid: bool) -> Array:
    """Rotations by brentq; discs on springs with play need one inside the other."""
    found = []
    for unit, angle in points:
        one = Point(
            mesh.gaps.gap[unit, angle],
            mesh.gaps.lever[angle],
            mesh.gaps.turn[unit, angle],
            mesh.gaps.play[unit, 0],
            mesh.stiffness.item(),
            mesh.compliance.item(),
            TORQUE / mesh.ratio,
        )
        found.append(float(brentq(one.rigid if rigid else one.on_springs, *BRACKET)))
    return np.array(found) / mesh.ratio


def seconds(function: Callable[[], object]) -> float:
    start = time.process_time()
    function()
    return time.process_time() - start


def compare(name: str, contact: LoadedContact, errors: PartErrors, count: int) -> None:
    angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    rng = np.random.default_rng(1)
    rigid = bool(np.all(np.isinf(contact.series_stiffness)))
    points = [(int(rng.integers(10)), int(rng.integers(ANGLES))) for _ in range(count)]
    mesh = contact.mesh(errors.of_units(slice(0, 10)), angles)
    found = contact.rotation(errors, angles, TORQUE)  # compiles, or loads what was compiled
    loop = partial(point_by_point, mesh, points, rigid)
    at = tuple(np.array(points).T)
    print(f"{name}: largest difference {np.max(np.abs(loop() - found[at])):.1e} rad from the loop")
    run = partial(contact.rotation, errors, angles, TORQUE)
    times = [(seconds(run), seconds(loop)) for _ in range(TURNS)]
    fast, slow = (median(column) for column in zip(*times, strict=True))
    slow *= UNITS * ANGLES / count
    print(f"  kernel {fast:.2f} s, brentq {slow:.0f} s")
    print(f"  ratio: {slow / fast:.0f} (at least 300 wanted)")


def main() -> None:
    errors = part_errors(UNITS, np.random.default_rng(0))
    contact = LoadedContact()
    stiff = replace(contact, series_stiffness=np.inf)
    tight = replace(errors, bearing_clearance=0.0)  # the plain equation of the physics notes
    compare("discs rigid on the carrier", stiff, tight, PART)
    compare("discs on springs, with play", contact, errors, PART // 10)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of the process: {peak:.0f} MiB (at most 500 wanted)")


if __name__ == "__main__":
    main()

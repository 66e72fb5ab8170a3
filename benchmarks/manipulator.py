# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Speed of the manipulator's maps and exact pose on one core: `python benchmarks/manipulator.py`.

What is compared is measured in turns, in this one process and on one thread, so that whatever else
the computer does meets both; the ratio is of the medians. Loops are measured on a part and
extrapolated, as printed.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from statistics import median

import numpy as np

from tolevo.models.manipulator.forward import exact_pose
from tolevo.models.manipulator.geometry import Manipulator, TaskRing
from tolevo.models.manipulator.maps import SOURCES, first_order
from tolevo.section import Array

POSES, MACHINES, TURNS = 10_000, 100_000, 7
STEP = 1e-6


def seconds(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def interleaved(fast: Callable[[], object], slow: Callable[[], object]) -> tuple[float, float]:
    """Median wall times [s] of both, measured in turns."""
    for function in (fast, slow):  # the first call touches memory for the first time
        function()
    times = [(seconds(fast), seconds(slow)) for _ in range(TURNS)]
    return median(one for one, _ in times), median(other for _, other in times)


def differences_one_by_one(machine: Manipulator, r: float, z: float) -> list[Array]:
    """Central differences at one pose, a source at a time."""
    columns = []
    for at in range(len(SOURCES)):
        error = np.zeros(len(SOURCES))
        error[at] = STEP
        high, low = exact_pose(machine, r, z, 0.0, error), exact_pose(machine, r, z, 0.0, -error)
        columns.append((high.position - low.position) / (2.0 * STEP))
    return columns


def differences_at_once(machine: Manipulator, r: float, z: float) -> Array:
    """Central differences at one pose, all 126 perturbed machines in one batch."""
    errors = STEP * np.concatenate([np.eye(len(SOURCES)), -np.eye(len(SOURCES))])
    found = exact_pose(machine, r, z, 0.0, errors).position
    return (found[: len(SOURCES)] - found[len(SOURCES) :]) / (2.0 * STEP)


def compare_maps(machine: Manipulator, rng: np.random.Generator) -> None:
    ring = TaskRing()
    r, z = rng.uniform(*ring.r, POSES), rng.uniform(*ring.z, POSES)
    for name, slow, count in (
        ("a loop over poses and sources", differences_one_by_one, 1),
        ("a loop over poses, all sources at once", differences_at_once, 40),
    ):
        part = list(zip(r[:count].tolist(), z[:count].tolist(), strict=True))
        batch, loop = interleaved(partial(first_order, machine, r, z), partial(looped, slow, machine, part))
        loop *= POSES / count
        print(f"maps of {POSES} poses: {batch * 1e3:.0f} ms; differences, {name}: {loop:.0f} s")
        print(f"ratio: {loop / batch:.0f} (at least 500 wanted; loop extrapolated from {count})")


def looped(
    slow: Callable[[Manipulator, float, float], object], machine: Manipulator, part: list[tuple[float, float]]
) -> None:
    for r, z in part:
        slow(machine, r, z)


def compare_newton(machine: Manipulator, rng: np.random.Generator) -> None:
    scale = np.array([5e-5 if source.unit == "um" else 1e-4 for source in SOURCES])
    errors, count = scale * rng.normal(size=(MACHINES, len(SOURCES))), 200
    part = errors[:count]
    batch, loop = interleaved(
        lambda: exact_pose(machine, 0.5, 0.2, 0.0, errors),
        lambda: [exact_pose(machine, 0.5, 0.2, 0.0, one) for one in part],
    )
    loop *= MACHINES / count
    print(f"exact poses of {MACHINES} machines: {batch:.2f} s; one by one: {loop:.0f} s")
    print(f"ratio: {loop / batch:.0f} (at least 100 wanted; loop extrapolated from {count})")


def main() -> None:
    for name, machine in (("M1", Manipulator()), ("M2", replace(Manipulator(), follow_up="rod"))):
        print(f"model {name}")
        compare_maps(machine, np.random.default_rng(0))
        compare_newton(machine, np.random.default_rng(1))


if __name__ == "__main__":
    main()

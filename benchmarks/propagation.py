# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Speed of the propagation on one core: `python benchmarks/propagation.py`.

Everything compared is measured in this one process, one after the other, on one thread.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import resource
import time
import tracemalloc
from collections.abc import Callable

import numpy as np

from tolevo.models.propagation import ClippedSum, Moments, MonteCarlo, Propagated
from tolevo.models.rv_reducer.backlash import Allocation, BacklashModel
from tolevo.models.rv_reducer.cycloid import LINEAR_ERRORS
from tolevo.units import ARCMIN, UM

BATCH, ROWS, REPEATS = 100_000, 300, 5
COVERAGE = 0.9973

REST = ("crank_bearing", "involute_grade", "stagger", "dr_rp", "dr_p")


def random_allocation(n: int, rng: np.random.Generator) -> Allocation:
    names = (*LINEAR_ERRORS, "eccentricity")
    return Allocation(
        half_width={name: rng.uniform(0.5, 10.0, n) * UM for name in names},
        crank_bearing=rng.uniform(0.5, 20.0, n) * UM,
        involute_grade=rng.integers(4, 9, n).astype(np.float64),
        stagger=rng.uniform(0.0, 0.4, n) * ARCMIN,
        dr_rp=np.full(n, -40.0 * UM),
        dr_p=np.full(n, -70.0 * UM),
    )


def row(allocation: Allocation, i: int) -> Allocation:
    at = slice(i, i + 1)
    half = {name: value[at] for name, value in allocation.half_width.items()}
    rest = (getattr(allocation, name)[at] for name in REST)
    return Allocation(half, *rest)


def best(function: Callable[[], object]) -> float:
    """Shortest of REPEATS wall times [s]: the one least disturbed."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def by_moments(model: BacklashModel, allocation: Allocation) -> Propagated:
    return Moments().propagate(model.total(allocation), COVERAGE, ARCMIN)


def compare_batch_with_rows(model: BacklashModel) -> None:
    allocation = random_allocation(BATCH, np.random.default_rng(0))
    single = [row(allocation, i) for i in range(ROWS)]
    batch = best(lambda: by_moments(model, allocation))
    rows = best(lambda: [by_moments(model, one) for one in single])
    tracemalloc.start()
    by_moments(model, allocation)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    extrapolated = rows * BATCH / ROWS
    print(f"moments, {BATCH} designs in one batch: {batch:.3f} s")
    print(f"moments, by rows: {extrapolated:.1f} s (extrapolated from {ROWS} rows: {rows:.3f} s)")
    print(f"ratio: {extrapolated / batch:.0f} (at least 200 wanted)")
    print(f"peak memory of the batch: {peak / 2**20:.0f} MiB (under 1024 wanted)")


def sample_speed(model: BacklashModel, samples: int, n: int) -> None:
    total: ClippedSum = model.total(random_allocation(n, np.random.default_rng(1)))
    errors = len(total.clipped) + len(total.free)
    method = MonteCarlo.draw(samples, errors, np.random.default_rng(0))
    seconds = best(lambda: method.propagate(total, COVERAGE, ARCMIN))
    speed = n * method.points[..., 0].size / seconds
    print(
        f"quasi-Monte Carlo, {n} designs x {method.points[..., 0].size} units x {errors} errors: "
        f"{speed / 1e6:.1f} million units/s per core (at least 20 wanted)"
    )


def memory_bandwidth() -> None:
    source = np.zeros(1 << 25)
    target = np.zeros_like(source)
    seconds = best(lambda: np.copyto(target, source))
    bandwidth = 2.0 * source.nbytes / seconds
    print(f"copy of 256 MiB: {bandwidth / 1e9:.1f} GB/s, {bandwidth / 8e6:.0f} million float64/s")


def main() -> None:
    model = BacklashModel()
    compare_batch_with_rows(model)
    for samples, n in ((1 << 14, 1000), (1 << 16, 200)):
        sample_speed(model, samples, n)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of the process before the bandwidth test: {own:.0f} MiB")
    memory_bandwidth()


if __name__ == "__main__":
    main()

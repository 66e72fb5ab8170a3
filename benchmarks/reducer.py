# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""A million reducers through all three stages on one core: `python benchmarks/reducer.py`.

Measured beside the drawing of their random numbers alone, in turns, in this one process; times are
CPU times, so that other work on the computer counts less, and the median of `TURNS`.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import resource
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from tolevo.models.inputs import Distribution, Normal
from tolevo.models.propagation import ClippedSum
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.batch import PART, batch, units
from tolevo.units import ARCMIN

UNITS, TURNS, ERRORS = 1_000_000, 15, 11
PROMISED = 2.0


def document(laws: dict[str, Distribution]) -> ClippedSum:
    """Document B's zones, all errors uniform unless `laws` says otherwise."""
    design = {v.name: np.array([float(v.document or 0.0)]) for v in declared.VARIABLES}
    model = declared.backlash_model({"reading": "printed"}, None, laws)
    return model.total(declared.allocation(design))


def draw() -> None:
    """The random numbers of the units, as they are drawn for them."""
    rng = np.random.default_rng(0)
    for start in range(0, UNITS, PART):
        rng.random((ERRORS, min(PART, UNITS - start)))


def draw_normal() -> None:
    """The same number of normal ones."""
    rng = np.random.default_rng(0)
    for start in range(0, UNITS, PART):
        rng.standard_normal((ERRORS, min(PART, UNITS - start)))


def go_through(total: ClippedSum) -> None:
    for part in units(total, UNITS, np.random.default_rng(0)):
        _ = part.effective


def with_statistics(total: ClippedSum) -> None:
    edges = np.linspace(0.0, 2.0 * ARCMIN, 51)
    batch(total, UNITS, ARCMIN, edges, np.random.default_rng(0))


def seconds(work: Callable[[], None]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def ratio(work: Callable[[], None], drawing: Callable[[], None]) -> tuple[float, float, float]:
    """Median CPU seconds of both, and the median of their ratio turn by turn."""
    pairs = [(seconds(drawing), seconds(work)) for _ in range(TURNS)]
    draws, works = zip(*pairs, strict=True)
    return median(draws), median(works), median(b / a for a, b in pairs)


def main() -> None:
    uniform = document({})
    normal = document({name: Normal() for name in (*declared.ERRORS, "crank_bearing")})
    cases = {
        "uniform, through all three stages": (lambda: go_through(uniform), draw),
        "uniform, with moments, counts and histogram": (lambda: with_statistics(uniform), draw),
        "normal errors, through all three stages": (lambda: go_through(normal), draw_normal),
    }
    for name, (work, drawing) in cases.items():
        drawn, done, share = ratio(work, drawing)
        wanted = f" (at most {PROMISED:g} wanted)" if drawing is draw and "three" in name else ""
        print(
            f"{UNITS} units x {ERRORS} errors, {name}: {1e3 * done:.0f} ms over {1e3 * drawn:.0f} "
            f"ms of drawing, ratio {share:.2f}{wanted}"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"peak memory of the process: {peak:.0f} MiB")


if __name__ == "__main__":
    main()

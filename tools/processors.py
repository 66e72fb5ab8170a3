"""The numerical tests and the exact results as on other processors: `python -m tools.processors [--quick]`.

OpenBLAS chooses its kernel by the processor, numpy its loops, and numba its instructions; these differ in their last
digits. The environment names those of another processor. Those that this one cannot run are named and left out.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


class Kernel(NamedTuple):
    """What /proc/cpuinfo lists where a kernel of OpenBLAS runs, and what numpy and numba take such a processor for."""

    flags: tuple[str, ...]
    loops: tuple[str, ...]
    instructions: str


KERNELS = {
    "Prescott": Kernel(("pni",), (), "x86-64-v2"),
    "Sandybridge": Kernel(("avx",), (), "sandybridge"),
    "Haswell": Kernel(("avx2", "fma"), ("X86_V3",), "haswell"),
    "SkylakeX": Kernel(("avx512f", "avx512dq", "avx512bw", "avx512vl"), ("X86_V3", "X86_V4"), "skylake-avx512"),
}
"""Kernels of OpenBLAS for x86-64; numpy needs x86-64-v2."""
THREADS = 1, 2
ROOMS = ("tests/models", "tests/problems", "tests/algorithms")
"""Tests whose results linear algebra decides."""
QUICK_KERNELS = "Prescott", "Haswell"
QUICK = (
    "tests/problems/test_pose_accuracy.py::test_at_two_tightest_limits_all_that_contributes_to_either_is_paid_for",
    "tests/problems/test_pose_accuracy.py::test_at_the_tightest_limit_only_what_contributes_to_it_is_paid_for",
    "tests/algorithms/exact/test_continuation.py::test_front_falls",
    "tests/algorithms/exact/test_programme_by_hand.py::test_limits_are_kept_to_the_last_digit",
)
"""Tests where a rounding decided once, for a part of less than a minute."""
EXACT = (
    "pose_accuracy",
    "robot_arm",
    "robot_arm_puma560",
    "robot_arm_ur5",
    "robot_manipulator",
    "rv40e_proven_least_cost",
)
"""Shipped configurations that are solved exactly."""
SAME = 1e-6
"""Relative difference of exact results between kernels that is allowed."""
POINTS = 40


def main(arguments: list[str]) -> int:
    """Exit status 1 where a test fails or a result differs."""
    if arguments[:1] == ["results"]:
        print(json.dumps(_results(arguments[1:])))
        return 0
    quick = "--quick" in arguments
    kernels = _runnable(QUICK_KERNELS if quick else tuple(KERNELS))
    failed = [
        kernel
        for kernel in kernels
        for threads in THREADS[: 1 if quick else None]
        if not _tested(kernel, threads, quick)
    ]
    differing = _differences(kernels, EXACT[:1] if quick else EXACT)
    print("\n".join([*(f"{kernel}: tests fail" for kernel in failed), *differing]) or "the same on every kernel")
    return int(bool(failed or differing))


def _runnable(kernels: tuple[str, ...]) -> list[str]:
    """The kernels that this processor can run; a line for each of the others."""
    place = Path("/proc/cpuinfo")
    lines = place.read_text(encoding="utf-8").splitlines() if place.is_file() else []
    flags = next((set(line.split()) for line in lines if line.startswith("flags")), set[str]())
    for kernel in kernels:
        if missing := [flag for flag in KERNELS[kernel].flags if flag not in flags]:
            print(f"{kernel}: left out, because this processor has no {', '.join(missing)}", flush=True)
    return [kernel for kernel in kernels if flags.issuperset(KERNELS[kernel].flags)]


def _tested(kernel: str, threads: int, quick: bool) -> bool:
    """Whether the tests pass on a kernel."""
    print(f"== {kernel}, threads: {threads}", flush=True)
    what = [*QUICK, "--quiet"] if quick else [*ROOMS, "--quiet", "--numprocesses", "logical", "--dist", "worksteal"]
    command = [sys.executable, "-m", "pytest", *what, "-m", "not slow"]
    return subprocess.run(command, env=_environment(kernel, threads), check=False).returncode == 0  # noqa: S603


def _environment(kernel: str, threads: int) -> dict[str, str]:
    extensions: Any = np.show_config(mode="dicts")
    loops = extensions["SIMD Extensions"]["found"]
    return os.environ | {
        "OPENBLAS_CORETYPE": kernel,
        "OPENBLAS_NUM_THREADS": str(threads),
        "NPY_DISABLE_CPU_FEATURES": " ".join(loop for loop in loops if loop not in KERNELS[kernel].loops),
        "NUMBA_CPU_NAME": KERNELS[kernel].instructions,
        "NUMBA_CPU_FEATURES": "",  # those of the processor that is named
    }


def _differences(kernels: list[str], names: tuple[str, ...]) -> list[str]:
    """A line for each configuration whose results differ between kernels by more than `SAME`."""
    command = [sys.executable, "-m", "tools.processors", "results", *names]
    results = {}
    for kernel in kernels:
        environment = _environment(kernel, 1)
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)  # noqa: S603
        results[kernel] = json.loads(done.stdout)
    lines = []
    for name in names if results else ():
        first, *others = (np.array(result[name]) for result in results.values())
        size = np.max(np.abs(first), axis=0)
        alike = all(other.shape == first.shape for other in others)
        most = max((float(np.max(np.abs(other - first) / size)) for other in others), default=0.0) if alike else np.inf
        print(f"{name}: {len(first)} points differ by at most {most:.1e}", flush=True)
        lines += [f"{name}: differs between {', '.join(results)} by {most:.1e}"] if most > SAME else []
    return lines


def _results(names: list[str]) -> dict[str, list[list[float]]]:
    """Objectives of the exact front, or of the least cost, of each configuration."""
    import tolevo
    from tolevo.algorithms.exact.solver import Exact
    from tolevo.algorithms.search import search
    from tolevo.algorithms.settings import Budget

    fronts = {}
    for name in names:
        configuration = tolevo.read(f"configs/{name}.toml")
        assert configuration.problem is not None
        result = search(configuration.problem, Exact(points=POINTS), Budget(), configuration.seed)
        f = configuration.problem.tested(result.chosen)[0] if len(result.chosen) else result.f
        fronts[name] = f[np.lexsort(f.T[::-1])].tolist()
    return fronts


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Peak memory of `tolevo run` in a fresh process: `python -m benchmarks.memory CONFIG [--set ...]`.

Linux counts it in KiB (getrusage(2)); libraries that are mapped count where they are touched.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

LIMIT = 300.0
"""MiB that a front of 1000 points may take."""


def peak(arguments: list[str]) -> tuple[float, int]:
    """Peak resident memory [MiB] of one run and its children, and the points of its front.

    It is that of the largest child of this process: call it once in a process.
    """
    with tempfile.TemporaryDirectory() as place:
        out = Path(place, "run")
        command = [sys.executable, "-m", "tolevo", "run", *arguments, "--quiet", "--out", str(out)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        points = len((out / "front.csv").read_text(encoding="utf-8").splitlines()) - 1
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0, points


def main() -> None:
    memory, points = peak(sys.argv[1:])
    print(f"{points} points, peak memory {memory:.0f} MiB (under {LIMIT:.0f} wanted)")


if __name__ == "__main__":
    main()

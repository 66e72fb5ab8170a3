"""Peak memory of `tolevo run` in a fresh process: `python -m benchmarks.memory [CONFIG ...]`.

Without a configuration it is `exact` with 1000 points on a stack of the 9 parts of the comparison.
Linux counts it in KiB (getrusage(2)); libraries that are mapped count where they are touched.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import tomli_w

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


def nine_parts(folder: str) -> str:
    """Path of a configuration of the 9 parts in `folder`."""
    from .tasks.cost_rss import cost_rss

    parts = cost_rss(9).parts
    assert parts is not None
    path = Path(folder, "nine_parts.toml")
    algorithm = {"algorithm": {"name": "exact", "points": 1000}}
    path.write_text(tomli_w.dumps(parts.tables() | algorithm), encoding="utf-8")
    return str(path)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        memory, points = peak(sys.argv[1:] or [nine_parts(folder)])
    print(f"{points} points, {memory:.0f} MiB peak memory (under {LIMIT:.0f} wanted)")


if __name__ == "__main__":
    main()

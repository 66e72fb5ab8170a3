"""One process against two Dask workers: `python -m benchmarks.wide [--designs N]`.

Designs of `rv_reducer`, uniform in the search ranges, evaluated at the accuracy of a search: by
`tolevo evaluate` alone, and by the same command with a scheduler and two workers of one thread each
on the loopback. Printed are wall time, CPU time and largest resident memory of every process,
whether both files are the same bytes, and two ratios: that of the wall times, which says something
on two idle cores only, and that of CPU times (one process against the busiest of the others), which
is what the wall times come to on such cores.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from .scaling import write_designs
from .study import cluster, cpu_of

CONFIGURATION = 'problem = "rv_reducer"\n'
PROMISED, MOST_MIB = 1.7, 1024.0


@dataclass(frozen=True)
class Used:
    """What a process took: CPU time [s], largest resident memory [MiB]."""

    cpu_s: float
    memory_mib: float


def used(pid: int) -> Used:
    """What a living process has taken so far."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return Used(cpu_of([pid]), float(line.split()[1]) / 1024.0)
    raise SystemExit(f"process {pid} has ended")


def evaluated(folder: Path, out: str, *words: str) -> tuple[float, Used]:
    """Wall time [s] of `tolevo evaluate`, and what its process took."""
    command = [sys.executable, "-m", "tolevo", "evaluate", "c.toml", "d.parquet", "--out", out,
               "--quality", "search", "--quiet", *words]  # fmt: skip
    start = time.monotonic()
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, taken = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"the command ended with {process.returncode}")
    cpu = taken.ru_utime + taken.ru_stime
    return time.monotonic() - start, Used(cpu, taken.ru_maxrss / 1024.0)


def told(name: str, taken: Used) -> None:
    print(f"  {name:<10} {taken.cpu_s:8.1f} s CPU {taken.memory_mib:6.0f} MiB", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=100_000)
    count = parser.parse_args().designs
    with tempfile.TemporaryDirectory(prefix="wide-") as name:
        folder = Path(name)
        write_designs(folder, CONFIGURATION, count)
        print(f"{count:,} designs; load {os.getloadavg()[0]:.1f}", flush=True)
        alone_s, alone = evaluated(folder, "alone.parquet")
        print(f"one process: {alone_s:.1f} s")
        told("command", alone)
        with cluster() as (address, pids):
            wide_s, command = evaluated(folder, "wide.parquet", "--dask", address)
            others = [used(pid) for pid in pids]
        print(f"two workers: {wide_s:.1f} s; load {os.getloadavg()[0]:.1f}")
        for role, one in zip(("scheduler", "worker", "worker"), others, strict=True):
            told(role, one)
        told("command", command)
        digests = {hashlib.sha256((folder / f"{one}.parquet").read_bytes()).hexdigest()
                   for one in ("alone", "wide")}  # fmt: skip
    most = max(one.memory_mib for one in (alone, command, *others))
    total = sum(one.cpu_s for one in (command, *others))
    busiest = max(*(one.cpu_s for one in others), command.cpu_s, total / 2.0)
    print(f"same bytes: {len(digests) == 1}; largest memory {most:.0f} MiB (promised: under "
          f"{MOST_MIB:.0f}); wall {alone_s / wide_s:.2f} times, by CPU time on two idle cores "
          f"{alone.cpu_s / busiest:.2f} times (promised: {PROMISED})")  # fmt: skip


if __name__ == "__main__":
    main()

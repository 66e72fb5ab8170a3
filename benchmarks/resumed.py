"""`python -m benchmarks.resumed [--moments 10] COMMAND ...`: what an interrupt costs, and whether it changes anything.

COMMAND are the words of a command without `--out`: `run configs/pose_accuracy.toml`. It runs once as a
whole; then, for each of some moments that are spread evenly over its CPU time, it is interrupted as by
Ctrl-C and resumed. CPU of both over that of the whole run, and files that differ in anything but time.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

PROMISED = 1.2
"""CPU of an interrupted and a resumed run over that of one run, at most."""
TICKS = os.sysconf("SC_CLK_TCK")
OF_THE_CLOCK = {"manifest.json", "unfinished.json", "checkpoint.npz", "steps.npz", "report.html", "study.sqlite"}
"""Files that hold the time of day, names of processes, or pages of them."""
SECONDS = re.compile(rb'"(?:\w*seconds\w*|started|ended|version)": ?[^,\n}]+|"files": ?\{[^}]*\}')


def cpu(words: Sequence[str], out: Path, after: float = np.inf) -> float:
    """CPU [s] of a command that is interrupted `after` some of it."""
    command = [sys.executable, "-m", "tolevo", *words, "--out", str(out), "--quiet", "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    sent = False
    while True:
        pid, _, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            return usage.ru_utime + usage.ru_stime
        used = Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        if not sent and (int(used[11]) + int(used[12])) / TICKS >= after:
            process.send_signal(signal.SIGINT)
            sent = True
        time.sleep(0.1)


def files(out: Path) -> dict[str, bytes]:
    """Files in which nothing depends on the clock, by name."""
    return {
        str(path.relative_to(out)): _without_clock(path)
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.name not in OF_THE_CLOCK and path.suffix not in {".png", ".xlsx", ".svg", ".pdf"}
    }


def _without_clock(path: Path) -> bytes:
    if path.suffix == ".parquet":
        table = pd.read_parquet(path)
        return table[[name for name in table if not _is_clock(str(name))]].to_csv().encode()
    if path.suffix != ".csv":
        return SECONDS.sub(b"", path.read_bytes())
    rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    kept = [at for at, name in enumerate(rows[0] if rows else ()) if not _is_clock(name)]
    return repr([[row[at] for at in kept if at < len(row)] for row in rows]).encode()


def _is_clock(column: str) -> bool:
    return "seconds" in column or column.endswith("cpu_s")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for every moment; exit status 1 where a result differs or a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moments", type=int, default=10)
    parser.add_argument("command", nargs=argparse.REMAINDER)
    given = parser.parse_args(arguments)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in the background
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, "whole")
        cpu(given.command, whole)  # bytecode and compiled functions are kept from now on
        shutil.rmtree(whole)
        one = [cpu(given.command, whole)]
        expected, ratios, same = files(whole), [], True
        for moment in np.linspace(0.0, 1.0, given.moments + 2)[1:-1].tolist():
            out = Path(folder, "again")
            first = cpu(given.command, out, moment * one[0])
            second = cpu([*given.command, "--resume"], out)
            found = files(out)
            differing = sorted(name for name in {*found, *expected} if found.get(name) != expected.get(name))
            ratios.append((first + second) / np.median(one))
            same = same and not differing
            print(
                json.dumps({
                    "at": round(moment, 2), "first": round(first, 2), "second": round(second, 2),
                    "ratio": round(ratios[-1], 3), "differing": differing,
                }),
                flush=True,
            )  # fmt: skip
            shutil.rmtree(out)
            if len(ratios) % 3 == 0:  # the speed of a machine changes
                shutil.rmtree(whole)
                one.append(cpu(given.command, whole))
    print(f"{' '.join(given.command)}: {np.median(one):.1f} s, ratio {min(ratios):.2f} to {max(ratios):.2f}")
    return int(not same or max(ratios) > PROMISED)


if __name__ == "__main__":
    sys.exit(main())

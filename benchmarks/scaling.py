"""How CPU time and memory grow: `python -m benchmarks.scaling [--quick] [--write FOLDER]`.

Every point is a command in a process of its own (CPU time with that of its workers, largest
resident memory of one process), less what the smallest size takes where the exponent is fitted: the
start of Python is no growth. `--write` puts the table and the figure into a folder.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from tolevo.problems.tolerance_problem import designs_frame

Array = NDArray[np.float64]
MILLION = 1_000_000

BACKLASH = 'problem = "rv_backlash"\nreferences = "none"\n[parameters]\nreading = "printed"\n'
SEARCH = '[algorithm]\nname = "nsga2"\nengine = "array"\n'
PART = """[[part]]
name = "p{at}"
nominal = {nominal}
unit = "mm"
sensitivity = {sign}
t_min = 0.01
t_max = 0.25
cost = {{ model = "reciprocal", a = 1.0, b = {b} }}
"""
STUDY = """
seeds = {seeds}
response = ["hypervolume"]
[run]
problem = "pose_accuracy"
references = "none"
[run.algorithm]
name = "nsga2"
engine = "array"
population = 20
generations = 20
[design]
kind = "one_at_a_time"
[vary]
"algorithm.mutation.eta" = [10.0, 20.0]
"""
GAP = """
model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
[settings]
bootstrap = 0
"""


@dataclass(frozen=True)
class Case:
    """A command against one size: `prepared` writes its input and returns its words."""

    name: str
    of: str
    sizes: tuple[int, ...]
    quick: tuple[int, ...]
    prepared: Callable[[Path, int], list[str]]


def written(path: Path, rows: int, columns_of: Callable[[int, int], dict[str, Array]]) -> None:
    """A Parquet file, written a million rows at a time by their start and count: the largest memory
    of this process counts as that of a command which it begins.
    """
    parts = [(start, min(MILLION, rows - start)) for start in range(0, rows, MILLION)]
    tables = (pa.table(columns_of(start, count)) for start, count in parts)
    first = next(tables)
    with pq.ParquetWriter(path, first.schema) as writer:
        for table in chain([first], tables):
            writer.write_table(table)


def simulate(folder: Path, rows: int) -> list[str]:
    """Rows of a Parquet file."""
    rng = np.random.default_rng(0)

    def columns_of(start: int, count: int) -> dict[str, Array]:
        torque = np.round(rng.uniform(-300.0, 300.0, count))
        return {"torque_Nm": torque, "direction": np.sign(torque) + (torque == 0.0)}

    written(folder / "points.parquet", rows, columns_of)
    (folder / "c.toml").write_text('model = "rv_lost_motion"\n', encoding="utf-8")
    return ["simulate", "c.toml", "points.parquet", "--out", "o", "--partitioned"]


def units(folder: Path, rows: int) -> list[str]:
    """Units of a batch."""

    def columns_of(start: int, count: int) -> dict[str, Array]:
        return {"unit": np.arange(start, start + count, dtype=float)}

    written(folder / "u.parquet", rows, columns_of)
    (folder / "c.toml").write_text('model = "rv_batch"\n', encoding="utf-8")
    return ["simulate", "c.toml", "u.parquet", "--out", "o", "--partitioned"]


def write_designs(folder: Path, configuration: str, count: int) -> None:
    """A configuration, c.toml, and designs that are uniform in its search ranges, d.parquet."""
    import tolevo

    (folder / "c.toml").write_text(configuration, encoding="utf-8")
    problem = tolevo.read(folder / "c.toml").problem
    assert problem is not None
    share = np.random.default_rng(0).random((count, problem.n_var))
    full = problem.complete(problem.xl + share * (problem.xu - problem.xl))
    designs_frame(problem, full).to_parquet(folder / "d.parquet", index=False)


def evaluate(folder: Path, rows: int) -> list[str]:
    """Designs of a closed form, at the accuracy of a search."""
    write_designs(folder, BACKLASH, rows)
    return ["evaluate", "c.toml", "d.parquet", "--out", "o", "--partitioned", "--quality", "search"]


def by_workers(folder: Path, workers: int) -> list[str]:
    """The same designs by more processes: above the cores of the machine they take turns."""
    words = evaluate(folder, 20_000)
    return [*words, "--workers", str(workers)]


def population(folder: Path, size: int) -> list[str]:
    """Twenty generations."""
    text = f"{BACKLASH}{SEARCH}population = {size}\ngenerations = 20\n"
    (folder / "c.toml").write_text(text, encoding="utf-8")
    return ["run", "c.toml", "--out", "o", "--workers", "1"]


def variables(folder: Path, count: int) -> list[str]:
    """A stack of so many parts."""
    parts = [PART.format(at=at, nominal=20.0 + at, sign=(-1.0) ** at, b=0.1 + 0.01 * at) for at in range(count)]
    head = f'problem = "stack"\nreferences = "none"\n{SEARCH}population = 100\ngenerations = 20\n'
    text = head + '[requirement]\nname = "gap"\nunit = "mm"\n' + "".join(parts)
    (folder / "c.toml").write_text(text, encoding="utf-8")
    return ["run", "c.toml", "--out", "o", "--workers", "1"]


def study(folder: Path, runs: int) -> list[str]:
    """Runs of 400 evaluations."""
    (folder / "c.toml").write_text(STUDY.format(seeds=runs // 2), encoding="utf-8")
    return ["study", "c.toml", "--out", "o", "--workers", "1"]


def gap(folder: Path, rows: int) -> list[str]:
    """Rows of a record with a compliance that the model misses."""
    rng = np.random.default_rng(0)
    torque = rng.uniform(-400.0, 400.0, rows)
    te = 0.25 * torque + rng.normal(0.0, 2.0, rows)
    frame = pd.DataFrame({"torque": torque, "te": te, "te_predicted": 0.2 * torque})
    frame.to_parquet(folder / "data.parquet", index=False)
    (folder / "c.toml").write_text(GAP, encoding="utf-8")
    return ["gap", "c.toml", "data.parquet", "--out", "o", "--workers", "1"]


CASES = (
    Case("simulate", "rows", (10**5, 10**6, 10**7, 10**8), (10**5, 10**6, 10**7), simulate),
    Case("simulate a batch", "units", (10**3, 10**5, 10**6, 10**7, 10**8), (10**3, 10**5, 10**6), units),
    Case("evaluate", "designs", (10**3, 10**4, 10**5), (10**3, 10**4), evaluate),
    Case("evaluate 20,000", "workers", (1, 2, 8), (1, 2), by_workers),
    Case("run", "population", (100, 1000, 10_000), (100, 1000), population),
    Case("run", "variables", (9, 50, 200), (9, 50), variables),
    Case("study", "runs", (10, 100, 1000), (10, 100), study),
    Case("gap", "rows", (10**3, 10**4, 10**5), (10**3, 10**4), gap),
)


def measured(case: Case, size: int) -> tuple[float, float]:
    """CPU time [s] of a command and its workers, and the largest resident memory [MiB]."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    with tempfile.TemporaryDirectory(prefix="scaling-") as place:
        words = case.prepared(Path(place), size)
        process = subprocess.Popen(
            [sys.executable, "-m", "tolevo", *words, "--quiet"],
            cwd=place, env=os.environ | threads, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{case.name} of {size} {case.of} ended with {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0


def exponent(sizes: Sequence[int], seconds: Sequence[float]) -> float:
    """Exponent of the growth between the two largest sizes, the smallest size taken off."""
    if len(sizes) < 3:
        return float("nan")
    above = [one - seconds[0] for one in seconds[-2:]]
    if min(above) <= 0.0:
        return float("nan")
    return float(np.log(above[1] / above[0]) / np.log(sizes[-1] / sizes[-2]))


def table_of(quick: bool, names: Sequence[str]) -> pd.DataFrame:
    """A row per command and size."""
    rows = []
    for case in CASES:
        if names and f"{case.name} {case.of}" not in names:
            continue
        sizes = case.quick if quick else case.sizes
        found = []
        for size in sizes:
            found.append(measured(case, size))
            seconds, memory = found[-1]
            print(f"{case.name:<18} {case.of:<11} {size:>11,} {seconds:9.2f} s {memory:7.0f} MiB",
                  flush=True)  # fmt: skip
        growth = exponent(sizes, [seconds for seconds, _ in found])
        rows += [
            {"command": case.name, "against": case.of, "size": size, "cpu_s": seconds,
             "memory_MiB": memory, "exponent": growth}
            for size, (seconds, memory) in zip(sizes, found, strict=True)
        ]  # fmt: skip
    return pd.DataFrame(rows)


def drawn(table: pd.DataFrame) -> bytes:
    """CPU time and memory against size as SVG, a row of panels per command."""
    from tolevo.page.drawing import COLOURS, as_svg, new_figure, style_axes

    groups = list(table.groupby(["command", "against"], sort=False))
    figure = new_figure(1.6 * len(groups))
    panels = figure.subplots(len(groups), 2, squeeze=False)
    for row, ((command, against), part) in zip(panels, groups, strict=True):
        growth = part["exponent"].iloc[0]
        told = "" if np.isnan(growth) else f", exponent {growth:.2f}"
        for axes, column, label, colour in zip(
            row, ("cpu_s", "memory_MiB"), ("CPU time [s]", "Memory [MiB]"), COLOURS, strict=False
        ):
            axes.loglog(part["size"], part[column], marker="o", color=colour)
            axes.set(xlabel=against, ylabel=label, ylim=(0.5 * part[column].min(), None))
            axes.set_title(f"{command}{told if column == 'cpu_s' else ''}", fontsize=9)
            style_axes(axes)
    return as_svg(figure)


def replaced(before: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """A table with the rows of the commands that were measured again in place of the old ones."""
    key = ["command", "against"]
    new = set(table[key].itertuples(index=False, name=None))
    kept = before[[one not in new for one in before[key].itertuples(index=False, name=None)]]
    order = {(case.name, case.of): at for at, case in enumerate(CASES)}
    both = pd.concat([kept, table], ignore_index=True)
    places = [order[one] for one in both[key].itertuples(index=False, name=None)]
    return both.iloc[np.argsort(places, kind="stable")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--write", type=Path)
    parser.add_argument("--draw", action="store_true", help="with --write: the table that is there")
    parser.add_argument("names", nargs="*", help='such as "simulate rows"')
    given = parser.parse_args()
    folder: Path | None = given.write
    if folder is None:
        if given.draw:
            parser.error("--draw needs --write")
        table_of(given.quick, given.names)
        return
    kept = folder / "scaling.csv"
    table = pd.read_csv(kept) if given.draw else table_of(given.quick, given.names)
    if given.names and kept.exists():  # the other rows stay
        table = replaced(pd.read_csv(kept), table)
    table.to_csv(kept, index=False, float_format="%.4g")
    (folder / "scaling.svg").write_bytes(drawn(table))


if __name__ == "__main__":
    main()

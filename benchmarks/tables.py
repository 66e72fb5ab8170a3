"""CPU of reading unknown tables against pandas told everything: `python benchmarks/tables.py`.

100,000 rows (of the table of a column per part: 100,000 cells) in six shapes, the best of five in this
process. Promised: a ratio of at most 5 in each.
"""

import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

import tolevo

ROWS, REPEATS, BLOCKS, WIDTHS = 100_000, 5, 10, [10, 14, 14, 14]
PROMISED = 5.0
Reader = Callable[[], object]


def german(path: Path, rng: np.random.Generator) -> Reader:
    """A file as a measuring room writes it, in cp1252 with semicolons and decimal commas."""
    times = pd.date_range("2026-03-01", periods=ROWS, freq="min")
    frame = pd.DataFrame(
        {
            "Teil": np.arange(ROWS),
            "Serie": [f"S{at % 7}" for at in range(ROWS)],
            "Zeit": times.strftime("%Y-%m-%d %H:%M"),
            "Spiel [arcmin]": rng.normal(0.4, 0.05, ROWS).round(4),
            "Ø Bohrung [mm]": rng.normal(25.0, 0.01, ROWS).round(4),
            "Kraft [N]": rng.normal(1500.0, 300.0, ROWS).round(3),
        }
    )
    frame.to_csv(path, sep=";", decimal=",", index=False, encoding="cp1252")
    return partial(pd.read_csv, path, sep=";", decimal=",", encoding="cp1252")


def wide(path: Path, rng: np.random.Generator) -> Reader:
    """A column per characteristic."""
    sizes = {f"x{at}": rng.normal(10.0 + at, 0.01, ROWS).round(4) for at in range(6)}
    pd.DataFrame({"part": np.arange(1, ROWS + 1)} | sizes).to_csv(path, index=False)
    return partial(pd.read_csv, path)


def long(path: Path, rng: np.random.Generator) -> Reader:
    """A row per part and characteristic, with nominal sizes and tolerances."""
    nominal = np.tile(np.arange(10) * 3.0 + 10.0, ROWS // 10)
    columns = {
        "Part": np.repeat(np.arange(ROWS // 10) + 1, 10),
        "Feature": np.tile([f"Bore {at}" for at in range(10)], ROWS // 10),
        "Actual": (nominal + rng.normal(0.0, 0.01, ROWS)).round(4),
        "Nominal": nominal,
        "Upper Tol": 0.05,
        "Lower Tol": -0.05,
    }
    pd.DataFrame(columns).to_csv(path, index=False)
    return partial(pd.read_csv, path)


def transposed(path: Path, rng: np.random.Generator) -> Reader:
    """A column per part."""
    parts = {f"Part {at}": rng.normal(10.0, 0.01, 20).round(4) for at in range(1, ROWS // 20 - 10)}
    pd.DataFrame({"Feature": [f"B{at}" for at in range(20)]} | parts).to_csv(path, index=False)
    return partial(pd.read_csv, path)


def fixed_width(path: Path, rng: np.random.Generator) -> Reader:
    """Columns that stand below each other, under headings of two words."""
    rows = [
        f"{at:>10d}" + "".join(f"{value:>14.4f}" for value in row)
        for at, row in enumerate(rng.normal(25.0, 0.01, (ROWS, 3)), 1)
    ]
    names = zip(["Part No", "Bore Dia", "Shaft Dia", "Axial Play"], WIDTHS, strict=True)
    path.write_text("\n".join(["".join(name.rjust(width) for name, width in names), *rows, ""]))
    return partial(pd.read_fwf, path, widths=WIDTHS)


def blocks(path: Path, rng: np.random.Generator) -> Reader:
    """Several tables with the same names, each below its title; pandas is told where each begins."""
    each = ROWS // BLOCKS

    def lines() -> Iterator[str]:
        for block in range(BLOCKS):
            yield from (f"Block {block + 1}", "Part,Bore,Shaft,Play")
            for at, row in enumerate(rng.normal(25.0, 0.01, (each, 3)), block * each + 1):
                yield ",".join([str(at), *(f"{value:.4f}" for value in row)])
            yield ""

    path.write_text("\n".join([*lines(), ""]))
    firsts = [1 + block * (each + 3) for block in range(BLOCKS)]
    return lambda: pd.concat([pd.read_csv(path, skiprows=first, nrows=each) for first in firsts])


def cpu(work: Callable[[], object]) -> float:
    """Least CPU seconds of some repeats."""
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def main() -> None:
    """Print both times and their ratio for each shape."""
    with tempfile.TemporaryDirectory() as folder:
        for shape in (german, wide, long, transposed, fixed_width, blocks):
            path = Path(folder) / f"{shape.__name__}.csv"
            read = shape(path, np.random.default_rng(0))
            tolevo.read_table(path)  # the detectors are imported
            told, unknown = cpu(read), cpu(partial(tolevo.read_table, path))
            print(f"{shape.__name__}: pandas, told everything: {told:.3f} s; tolevo, told nothing: {unknown:.3f} s")
            print(f"ratio {unknown / told:.1f}, promised at most {PROMISED:g}")


if __name__ == "__main__":
    main()

"""CPU of reading an unknown CSV against pandas told everything: `python benchmarks/tables.py`.

100,000 rows of six columns in cp1252 with semicolons and decimal commas, the best of five in this
process. Promised: a ratio of at most 5.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

import tolevo

ROWS, REPEATS = 100_000, 5
PROMISED = 5.0


def export(path: Path) -> None:
    """A file as a measuring room writes it."""
    rng = np.random.default_rng(0)
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


def cpu(work: Callable[[], object]) -> float:
    """Least CPU seconds of some repeats."""
    found = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    return min(found)


def main() -> None:
    """Print both times and their ratio."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "export.csv"
        export(path)
        told = cpu(lambda: pd.read_csv(path, sep=";", decimal=",", encoding="cp1252"))
        tolevo.read_table(path)  # the detectors are imported
        unknown = cpu(lambda: tolevo.read_table(path).frame)
    print(f"pandas, told everything: {told:.3f} s; tolevo, told nothing: {unknown:.3f} s")
    print(f"ratio {unknown / told:.1f}, promised at most {PROMISED:g}")


if __name__ == "__main__":
    main()

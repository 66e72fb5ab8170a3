"""Draws every figure of the README: `make figures`, or with `--draw` from the stored data alone.

`--run FOLDER` takes the result of a finished run of the same configuration instead of a new one.

The front is that of the main job. What is drawn is kept in `docs/figures`, so that a test can draw
it again and see whether figure, configuration and model still belong together.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pandas as pd

from tolevo.commands.run.plan import RunPlan
from tolevo.commands.run.run import run
from tolevo.configuration import Configuration, read
from tolevo.page.drawing import as_png
from tolevo.page.figures import front_figure
from tolevo.records import Axis, RunResult

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "docs" / "figures"
FIGURES: Mapping[str, str] = MappingProxyType({"docs/front.png": "rv40e_backlash"})
"""Figures of the README by their path, and the configuration whose front they show."""
DIGITS = "%.7g"


def configuration(name: str) -> Configuration:
    """A ready configuration by name."""
    return read(ROOT / "configs" / f"{name}.toml")


def drawn(name: str) -> bytes:
    """The figure of the stored front of a configuration, as PNG."""
    problem = configuration(name).problem
    assert problem is not None
    outputs = {output.name: output for output in problem.outputs}
    axes = tuple(Axis(one, outputs[one].unit) for one in problem.objectives)
    front, references = (pd.read_csv(DATA / f"{name}_{kind}.csv") for kind in KINDS)
    return as_png(front_figure(RunResult(name, front, references, pd.DataFrame(), {}, axes)))


KINDS = ("front", "references")


def computed(name: str, finished: Path | None = None) -> None:
    """Run a configuration, or take its finished run, and store what is drawn of it."""
    found = configuration(name)
    if finished is not None:
        _stored(found, name, finished)
        return
    assert found.problem is not None
    assert found.algorithm is not None
    plan = RunPlan(found.problem, found.algorithm, found.budget, found.seed, True, found.toml(),
                   name, found.engine)  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        run(plan, Path(folder))
        _stored(found, name, Path(folder))


def _stored(found: Configuration, name: str, folder: Path) -> None:
    """Keep what is drawn of the result in a folder."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    if summary["configuration_hash"] != found.hash:
        raise SystemExit(f"{folder} is not a run of configs/{name}.toml as it is now")
    assert found.problem is not None
    names = [*found.problem.names, *found.problem.objectives]
    DATA.mkdir(exist_ok=True)
    for kind, more in zip(KINDS, (["knee"], ["label", "feasible"]), strict=True):
        table = pd.read_csv(folder / f"{kind}.csv")[[*more, *names]]
        table.to_csv(DATA / f"{name}_{kind}.csv", index=False, float_format=DIGITS)
    assumptions = pd.read_csv(folder / "assumptions_cost.csv")[["assumption", "value", "cost"]]
    assumptions.to_csv(DATA / f"{name}_assumptions.csv", index=False, float_format=DIGITS)
    (DATA / f"{name}.sha256").write_text(f"{found.hash}\n", encoding="utf-8")


def main() -> None:
    """Draw all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", action="store_true", help="draw the stored data, run nothing")
    parser.add_argument("--run", type=Path, help="folder of a finished run of the main job")
    options = parser.parse_args()
    for path, name in FIGURES.items():
        if not options.draw:
            computed(name, options.run)
        (ROOT / path).write_bytes(drawn(name))


if __name__ == "__main__":
    main()

"""Key figures of every model and example, pinned to a file per release: tests/pinned/.

`python -m tools.pin` computes all of them and writes the newest file; what moved goes to its
`[moved]` with the old value, and a test then asks for each of these names in the newest section of
CHANGELOG.md.
"""

from __future__ import annotations

import io
import sys
import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas as pd
import tomli_w

import tolevo
from tolevo.commands.template import written
from tolevo.configuration.reader import read

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "tests" / "pinned"
CONFIGS = ROOT / "configs"
RTOL = 1e-6
"""Figures that differ by less have not moved: other versions of numpy and scipy round otherwise."""
SIZES = {"rv_reducer": "parameters.report_units=256"}
"""Fewer units than a run tests, so that all figures take seconds."""
TABLES: dict[str, Mapping[str, Sequence[object]]] = {
    "rv_batch": {"unit": ["a", "b", "c"]},
    "rv_lost_motion": {
        "torque_Nm": [-412.0, 100.0, 412.0],
        "direction": [-1.0, 1.0, 1.0],
        "output_angle_deg": [0.0, 10.0, 20.0],
        "temperature_C": [20.0, 20.0, 40.0],
    },
    "rv_transmission": {
        "output_angle_deg": [0.0, 7.0, 33.0],
        "torque_Nm": [100.0, 200.0, -100.0],
        "output_speed_rpm": [5.0, 15.0, 15.0],
        "temperature_C": [20.0, 20.0, 40.0],
        "direction": [1.0, 1.0, -1.0],
    },
    "assembly": {
        "unit": ["a", "b"],
        **{f"dtheta_{at}_mrad": [0.1 * at, -0.05 * at] for at in range(1, 5)},
        "precision_weight": [0.5, 1.0],
    },
    "manipulator_pose": {
        "r_mm": [400.0, 500.0],
        "z_mm": [200.0, 150.0],
        "phi_deg": [10.0, 100.0],
        "payload_kg": [0.0, 5.0],
        "temperature_C": [20.0, 30.0],
    },
}
"""Operating points of `tolevo simulate`, for every model that needs no table of its own."""
ARM = {f"joint_{at}_deg": [5.0 * at, -12.0 * at] for at in range(1, 7)}
Figures = dict[str, dict[str, float]]
"""Numbers by the call that gives them."""


def evaluated(path: Path) -> tuple[str, dict[str, float]]:
    """Objectives and limited outputs of the document's design, or of the middle of the ranges."""
    found = read(path)
    assert found.problem is not None
    sets = [SIZES[found.problem.name]] if found.problem.name in SIZES else []
    designs = pd.read_csv(io.StringIO(written("designs", path)))
    row = tolevo.evaluate(path, designs.iloc[:1], settings=sets).iloc[0]
    names = dict.fromkeys((*found.problem.objectives, *found.problem.settings.limits))
    more = "".join(f" --set {one}" for one in sets)
    call = f"tolevo evaluate configs/{path.name} FIRST_OF_TEMPLATE.csv{more}"
    return call, {name: float(row[name]) for name in names}


def simulated(model: str) -> tuple[str, dict[str, float]]:
    """Every output of a model at the operating points."""
    table = TABLES[model]
    found = tolevo.simulate({"model": model}, pd.DataFrame(table))
    return f'tolevo.simulate({{"model": "{model}"}}, TABLES["{model}"])', outputs(found, table)


def arm() -> tuple[str, dict[str, float]]:
    """Positions of the shipped arm."""
    found = tolevo.simulate(CONFIGS / "robot_arm.toml", pd.DataFrame(ARM))
    return 'tolevo.simulate("configs/robot_arm.toml", ARM)', outputs(found, ARM)


def outputs(found: pd.DataFrame, table: Mapping[str, Sequence[object]]) -> dict[str, float]:
    """The columns that were not given, row by row."""
    names = [name for name in found if name not in table]
    return {f"{name}[{at}]": float(found[name].iloc[at]) for name in names for at in range(len(found))}


def clutch() -> tuple[str, dict[str, float]]:
    """Ends and middle of the proven front of the README's example."""
    exact = tolevo.algorithms.Exact(points=5)
    with tempfile.TemporaryDirectory() as folder:
        path = CONFIGS / "stack_clutch.toml"
        front = tolevo.run(path, Path(folder) / "out", algorithm=exact).front
    call = 'tolevo.run("configs/stack_clutch.toml", algorithm=tolevo.algorithms.Exact(points=5))'
    names = [name for name in ("cost", "variation") if name in front]
    return call, {f"{name}[{at}]": float(front[name].iloc[at]) for name in names for at in (0, 2, 4)}


def jobs() -> list[Callable[[], tuple[str, dict[str, float]]]]:
    """One for every shipped configuration of a problem, every model and every example."""
    found: list[Callable[[], tuple[str, dict[str, float]]]] = []
    for path in sorted(CONFIGS.glob("*.toml")):
        if tomllib.loads(path.read_text("utf-8")).get("problem", "stack") != "stack":
            found.append(lambda path=path: evaluated(path))  # type: ignore[misc]
    found += [lambda name=name: simulated(name) for name in TABLES]  # type: ignore[misc]
    return [*found, arm, clutch]


def computed() -> Figures:
    """All figures by the code as it stands."""
    return dict(job() for job in jobs())


def newest() -> Path:
    """The file of the release that is being made."""
    return max(FOLDER.glob("*.toml"), key=lambda one: [int(n) for n in one.stem.split(".")])


def moved(old: Figures, new: Figures) -> dict[str, list[float]]:
    """Old and new value of every figure that is in both and differs, by call and name."""
    return {
        f"{call}: {name}": [old[call][name], value]
        for call, values in new.items()
        for name, value in values.items()
        if name in old.get(call, {}) and abs(value - old[call][name]) > RTOL * abs(old[call][name])
    }


def main() -> int:
    """Write the newest file anew."""
    path = newest()
    before = tomllib.loads(path.read_text("utf-8"))
    new = computed()
    changed = dict(before.get("moved", {}))
    for name, (old, value) in moved(before.get("figures", {}), new).items():
        changed[name] = [changed.get(name, [old])[0], value]
        print(f"{name}: {old:.10g} -> {value:.10g}; say why in CHANGELOG.md")
    text = path.read_text("utf-8").split("\n\n")[0]
    path.write_text(text + "\n\n" + tomli_w.dumps({"figures": new, "moved": changed}), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

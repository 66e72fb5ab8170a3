"""Units that are wrong by far are said, those that may be right are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data

N = 120
COLUMNS = {
    "angle": ("angle", "deg"),
    "torque": ("torque", "N m"),
    "speed": ("speed", "rpm"),
    "temperature": ("temperature", "degC"),
    "way": ("direction", ""),
    "te": ("measured", "arcsec"),
    "te_predicted": ("predicted", "arcsec"),
}


def table() -> pd.DataFrame:
    rng = np.random.default_rng(4)
    frame = pd.DataFrame({"angle": rng.uniform(0.0, 360.0, N), "torque": rng.normal(0.0, 90.0, N)})
    frame["speed"], frame["temperature"] = rng.uniform(5.0, 60.0, N), rng.uniform(18.0, 60.0, N)
    frame["te_predicted"] = 30.0 * np.sin(np.radians(frame["angle"]))
    return frame.assign(te=frame["te_predicted"] + rng.normal(0.0, 2.0, N))


def asked(folder: Path, frame: pd.DataFrame, **units: str) -> list[str]:
    """The questions about units that are noted."""
    lines = ['model = "table"', "[columns]"]
    lines += [f'{name} = {{ role = "{role}", unit = "{units.get(name, unit)}" }}'
              for name, (role, unit) in COLUMNS.items() if name in frame]  # fmt: skip
    (folder / "gap.toml").write_text("\n".join(lines), encoding="utf-8")
    frame.to_csv(folder / "data.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return [one for one in read_data(plan, folder / "data.csv").notes if "?" in one]


def test_plausible_units_are_not_asked_about(tmp_path: Path) -> None:
    assert asked(tmp_path, table()) == []
    assert asked(tmp_path, table(), te="arcmin", te_predicted="arcmin") == []


def test_angle_in_arcsec_that_is_called_degrees(tmp_path: Path) -> None:
    frame = table().assign(angle=lambda one: 3600.0 * one["angle"])
    assert asked(tmp_path, frame) == ['is "deg" the unit of angle? It reaches beyond 1000 turns']
    assert asked(tmp_path, frame, angle="arcsec") == []


def test_angle_in_degrees_that_is_called_arcsec(tmp_path: Path) -> None:
    (said,) = asked(tmp_path, table(), angle="arcsec")
    assert said.startswith('is "arcsec" the unit of angle? It spans 0.')


def test_angle_of_a_locked_unit_may_stand(tmp_path: Path) -> None:
    """Its angle is its twist: 0.1 deg in all."""
    phase = np.linspace(0.0, 6.0 * np.pi, N)
    frame = table().drop(columns="speed").assign(torque=np.sin(phase), angle=180.0 * np.sin(phase))
    assert len(asked(tmp_path, frame, angle="arcsec")) == 1
    assert asked(tmp_path, frame.assign(way=np.sign(np.cos(phase))), angle="arcsec") == []


@pytest.mark.parametrize(("column", "factor"), [("torque", 1e9), ("speed", 1e4), ("temperature", 60.0)])
def test_columns_beyond_any_bench(tmp_path: Path, column: str, factor: float) -> None:
    (said,) = asked(tmp_path, table().assign(**{column: factor * table()[column]}))
    assert said.startswith(f'is "{COLUMNS[column][1]}" the unit of {column}? It reaches beyond')


@pytest.mark.parametrize("factor", [60.0, 3600.0, 1.0 / 60.0])
def test_measurement_and_prediction_in_different_units(tmp_path: Path, factor: float) -> None:
    frame = table()
    (said,) = asked(tmp_path, frame.assign(te=factor * frame["te"]))
    assert said.startswith("is the unit of te or that of its prediction wrong?")
    assert float(said.split(" is ")[-1].split(" times")[0]) == pytest.approx(factor, rel=0.05)

"""A table of torque cycles on a locked unit: the loop of friction, named and carried on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data

TABLE = """model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"way" = { role = "direction" }
"twist" = { role = "measured", unit = "arcmin" }
"twist_predicted" = { role = "predicted", unit = "arcmin" }
[settings]
simulations = 400
"""
HELD, C = 30.0, 0.004
"""[N m], [arcmin/(N m)] What the friction holds, and the twist per torque that it holds back."""


def cycles(n: int, most: float) -> pd.DataFrame:
    """Four cycles of torque on a unit whose friction slips at `HELD` (Maxwell's element)."""
    corners = most * np.array([0.0, 1.0, -1.0, 1.0, -0.6, 0.6, -1.0, 1.0, 0.0])
    torque = np.interp(np.linspace(0.0, 8.0, n), np.arange(9.0), corners)
    force, before, friction = 0.0, 0.0, np.empty(n)
    for at, here in enumerate(torque.tolist()):
        force = float(np.clip(force + here - before, -HELD, HELD))
        before, friction[at] = here, force
    way = np.where(np.gradient(torque) < 0.0, -1.0, 1.0)
    frame = pd.DataFrame({"torque": torque, "way": way, "twist_predicted": torque / 100.0})
    return frame.assign(twist=frame["twist_predicted"] - C * friction)


def test_the_loop_is_named_and_simulated_on_another_path(tmp_path: Path) -> None:
    (tmp_path / "gap.toml").write_text(TABLE, encoding="utf-8")
    frame = cycles(400, 250.0)
    noise = np.random.default_rng(3).normal(0.0, 0.05, len(frame))
    frame.assign(twist=frame["twist"] + noise).to_csv(tmp_path / "data.csv", index=False)
    plan = read_gap(tmp_path / "gap.toml")
    found = gap.analysis_result(plan, read_data(plan, tmp_path / "data.csv"))
    assert {name for rival in found.rivals for name in rival.names} <= {"bouc_wen_hysteresis"}  # with two shapes more
    assert [one.name for one in found.effects] == ["friction_hysteresis"]
    numbers = {one.name: one.value for one in found.effects[0].parameters}
    assert numbers["friction_Nm"] == pytest.approx(HELD, rel=0.2)
    assert numbers["compliance_arcmin_per_Nm"] == pytest.approx(C, rel=0.15)
    (tmp_path / "corrected.toml").write_text(found.corrected, encoding="utf-8")
    cycles(90, 180.0).to_csv(tmp_path / "other.csv", index=False)
    words = ["simulate", tmp_path / "corrected.toml", tmp_path / "other.csv", "--out"]
    ended = CliRunner().invoke(app, [*map(str, words), str(tmp_path / "out.csv"), "--quiet"])
    assert ended.exit_code == 0, ended.output
    left = pd.read_csv(tmp_path / "out.csv")["twist"] - cycles(90, 180.0)["twist"]
    assert np.std(left) < 0.1 * C * HELD

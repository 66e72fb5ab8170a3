"""When the loop ends, and what it says that it cannot see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult

HEAD = """
model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"way" = { role = "direction" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
"""


def found(folder: Path, text: str = "") -> GapResult:
    """A compliance of twice the noise and a loop of a third of it, n 500."""
    rng = np.random.default_rng(3)
    n = 500
    frame = pd.DataFrame({"torque": rng.uniform(-1.0, 1.0, n), "way": rng.choice([-1.0, 1.0], n)})
    frame["te_predicted"] = rng.normal(size=n)
    frame["te"] = frame["te_predicted"] + 4.0 * frame["torque"] + 0.3 * frame["way"]
    frame["te"] += rng.normal(size=n)
    (folder / "gap.toml").write_text(HEAD + text, encoding="utf-8")
    frame.to_csv(folder / "bench.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "bench.csv"))


def test_practical_limit_ends_the_loop(tmp_path: Path) -> None:
    """Both are beyond noise; with a limit of half the noise the small one is not worth a name."""
    assert set(found(tmp_path).names) == {"torsional_compliance", "friction_hysteresis"}
    result = found(tmp_path, "[settings]\npractical_limit = 0.5\n")
    assert result.names == ("torsional_compliance",)
    last = result.steps[-1]
    assert (last.action, last.name, last.accepted) == ("reject", "friction_hysteresis", False)
    assert "practical limit" in last.reason
    assert last.gain > last.threshold
    assert 0.2 < np.sqrt(last.gain / 500) < 0.4


def test_what_the_zero_does_as_well_cannot_be_seen(tmp_path: Path) -> None:
    """A bias of the gauge is the free zero; the smallest other effects are of the noise's size."""
    gate = found(tmp_path).gate
    assert gate.unseen == ("gauge_bias",)
    seen = {one.name: one.rms for one in gate.detectable}
    assert "torsional_compliance" in seen
    assert "gauge_bias" not in seen
    # two-sided normal theory: (threshold + 90 % power) / sqrt(n) of the noise of 1
    assert all(0.1 < rms < 1.0 for rms in seen.values()), seen

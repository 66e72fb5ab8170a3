"""Signs that physics allows hold wherever a fit is compared with another one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import lsq_linear

from tolevo.commands.gap import result
from tolevo.commands.gap.analysis import Analysis, analysed
from tolevo.commands.gap.analysis import analysis_without_effect as without
from tolevo.commands.gap.close import Corrected
from tolevo.commands.gap.configuration import gap_plan, read_gap
from tolevo.commands.gap.fit import Fit, Member
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.result import Ending, finish_analysis
from tolevo.commands.gap.setup import prepare_setup

SLIDE = """
model = "table"
[columns]
speed = { role = "speed", unit = "m/s" }
direction = { role = "direction" }
load = { role = "force", unit = "N" }
error = { role = "measured", unit = "um" }
simulated = { role = "predicted", unit = "um" }
[settings]
simulations = 500
"""
COULOMB, VISCOUS, SIGMA = 2.0, 3.0, 0.5
"""[um], [um per m/s] and [um]."""


def slide(seed: int, n: int = 400) -> pd.DataFrame:
    """A linear axis with a compliance, a Coulomb and a viscous friction."""
    rng = np.random.default_rng(seed)
    v, d = rng.uniform(0.01, 0.5, n), rng.choice([-1.0, 1.0], n)
    load = rng.uniform(-500.0, 500.0, n)
    y = 0.02 * load + (COULOMB + VISCOUS * v) * d + rng.normal(0.0, SIGMA, n)
    return pd.DataFrame({"speed": v, "direction": d, "load": load, "error": y, "simulated": 0.0})


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    folder = tmp_path_factory.mktemp("axis")
    (folder / "gap.toml").write_text(SLIDE, "utf-8")
    slide(2).to_csv(folder / "data.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return analysed(prepare_setup(plan, read_data(plan, folder / "data.csv")))


def test_a_viscous_friction_is_seen_beside_a_coulomb_friction(axis: Analysis) -> None:
    """Stribeck's curve falls with the speed: with an excess below 0 it took the place of both."""
    names = set(axis.fit.names)
    coulomb = names & {"friction_hysteresis", "directional_offset"}  # the same but for a zero
    viscous = names & {"read_out_lag", "viscous_friction"}  # the same column
    assert len(coulomb) == 1 and len(viscous) == 1
    assert names == {"torsional_compliance", *coulomb, *viscous}
    sizes = dict(zip(axis.fit.names, axis.fit.coefficients, strict=True))
    assert abs(float(sizes[coulomb.pop()][0]) - COULOMB) < 3.0 * 0.06  # standard errors
    assert abs(float(sizes[viscous.pop()][0]) - VISCOUS) < 3.0 * 0.2
    assert not axis.identified.significant


def with_stribeck(axis: Analysis) -> tuple[Fit, Member]:
    search = axis.search
    members = [m for m in axis.fit.members if m.name == "torsional_compliance"]
    first = next(m for m in search.dictionary.members if m.name == "stribeck")
    return search.fitter.fit([*members, first]), first


def test_held_out_rows_are_predicted_within_the_bounds(axis: Analysis) -> None:
    """Every block against an independent bounded fit of the others."""
    search, fitter = axis.search, axis.search.fitter
    fit, stribeck = with_stribeck(axis)
    fixed = [m for m in fit.members if m is not stribeck]
    x = np.hstack([fitter.base, *(fitter.white(m) for m in fit.members)])
    free = np.full(fitter.base.shape[1], np.inf)
    own = [m.candidate.bounds for m in fit.members]
    low = np.concatenate([-free, *(ends[0] for ends in own)])
    high = np.concatenate([free, *(ends[1] for ends in own)])
    assert fixed and (low == 0.0).sum() >= 2
    tested = search.tested(fit)
    for block in np.unique(search.labels):
        out = search.labels == block
        found = lsq_linear(x[~out], fitter.y[~out], (low, high), tol=1e-12).x
        alone = fitter.y[out] - x[out] @ found
        kept = tested.white[out]
        # its knee may be another one on these rows, and then fits them better
        assert np.sum(kept**2) == pytest.approx(np.sum(alone**2), rel=0.05)


ENCODER = """
model = "table"
[columns]
angle = { role = "angle", unit = "deg" }
load = { role = "torque", unit = "N m" }
error = { role = "measured", unit = "arcsec" }
simulated = { role = "predicted", unit = "arcsec" }
[settings]
simulations = 500
"""


def test_a_part_of_what_a_name_does_is_no_other_form(tmp_path: Path) -> None:
    """An encoder with its second harmonic alone: a wave of order 2 has fewer numbers."""
    rng = np.random.default_rng(3)
    angle, load = rng.uniform(0.0, 360.0, 300), rng.uniform(-100.0, 100.0, 300)
    error = 0.1 * load + 1.5 * np.sin(np.radians(2.0 * angle)) + rng.normal(0.0, 1.0, 300)
    pd.DataFrame({"angle": angle, "load": load, "error": error, "simulated": 0.0}).to_csv(
        tmp_path / "data.csv", index=False
    )
    (tmp_path / "gap.toml").write_text(ENCODER, "utf-8")
    plan = read_gap(tmp_path / "gap.toml")
    found = analysed(prepare_setup(plan, read_data(plan, tmp_path / "data.csv")))
    assert set(found.fit.names) == {"torsional_compliance", "encoder_harmonics"}
    assert not found.identified.significant


def test_columns_of_joints_at_fault_are_not_asked_for() -> None:
    """Of a chain at fault the data need the columns of its own joints, not of the default arm's."""
    joints = [{"d_mm": 100.0, "a_mm": "long", "alpha_deg": 90.0}, {"d_mm": 0.0, "a_mm": 300.0}]
    plan, faults = gap_plan({"model": "serial_arm", "joint": joints})
    assert plan is not None and plan.model is not None
    needed = [one.name for one in plan.model.columns if one.needed]
    assert needed == ["joint_1_deg", "joint_2_deg"]
    assert sorted(one.place for one in faults) == ["joint[0].a_mm", "joint[1].alpha_deg"]


def ended_within(analysis: Analysis, most: int, monkeypatch: pytest.MonkeyPatch) -> Ending:
    """The ending, which may exclude effects in so many turns at most."""
    turns: list[str] = []

    def counted(before: Analysis, name: str, trusted: str = "", kept: bool = False) -> Analysis:
        assert len(turns) < most, turns
        turns.append(name)
        return without(before, name, trusted, kept)

    monkeypatch.setattr(result, "analysis_without_effect", counted)
    end = finish_analysis(analysis)
    assert len({*turns}) == len(turns)
    assert not {*turns} & {*end.fit.names}
    return end


def test_the_ending_of_effects_that_are_all_weak_excludes_each_once(
    axis: Analysis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lag of the read-out has the column of viscous friction: each brought the other back."""
    library = {candidate.name for candidate in axis.setup.library}
    assert {"read_out_lag", "viscous_friction"} <= library
    monkeypatch.setattr(Corrected, "nothing", lambda model, member: True)
    end = ended_within(axis, len(library), monkeypatch)
    assert not end.identified and end.verdict == "unnamed"
    assert {"read_out_lag", "viscous_friction"} <= end.analysis.excluded


def film() -> pd.DataFrame:
    """262 rows of viscous friction that varies with load and time, on a drift that is a random walk."""
    rng, n = np.random.default_rng(1144), 262
    v, d, t = rng.uniform(0.01, 0.5, n), rng.choice([-1.0, 1.0], n), np.linspace(0.0, 40.0, n)
    load = 500.0 * np.sin(t * rng.uniform(0.1, 3.0))
    sigma, rate, _ = rng.uniform(0.2, 1.0), rng.uniform(2.0, 20.0), rng.integers(1, 4)
    sizes = []
    for more in (lambda: np.sin(rng.uniform(0.1, 2.0) * t) * v * d, lambda: load / 500.0 * v * d * t / 40.0,
                 lambda: np.cumsum(rng.normal(0.0, 0.1, n))):  # fmt: skip
        size, _ = rng.uniform(0.3, 2.0) * rate * 0.2, rng.integers(7)
        sizes.append(size * more())
    y = rate * v * d + sum(sizes) + rng.normal(0.0, sigma, n)
    return pd.DataFrame({"speed": v, "direction": d, "time": t, "load": load, "error": y, "simulated": 0.0})


def test_an_excluded_effect_does_not_come_back_for_one_with_the_same_columns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lag was excluded, came back in the place of viscous friction, and was excluded again."""
    text = SLIDE.replace("[columns]", '[columns]\ntime = { role = "time", unit = "s" }')
    (tmp_path / "gap.toml").write_text(text.replace("500", "200"), "utf-8")
    film().to_csv(tmp_path / "data.csv", index=False)
    plan = read_gap(tmp_path / "gap.toml")
    found = analysed(prepare_setup(plan, read_data(plan, tmp_path / "data.csv")))
    end = ended_within(found, 10, monkeypatch)
    alike = {"read_out_lag", "viscous_friction"}
    assert len(alike & {*end.fit.names}) == 1 and not alike & end.analysis.excluded  # the other one is a rival

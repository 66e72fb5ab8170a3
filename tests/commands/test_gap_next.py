"""The next measurement: its points, what they are expected to tell, and whether they do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from typer.testing import CliRunner

from tolevo import registry
from tolevo.cli import app
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.section import Array

pytestmark = pytest.mark.usefixtures("unrendered", "units_once")

HEAD = """
model = "table"
seed = 0
[settings]
simulations = 200
[columns]
"torque" = { role = "torque", unit = "N m" }
"dir" = { role = "direction" }
"speed" = { role = "speed", unit = "rpm" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
[effects]
consider = ["torsional_compliance", "hertz_stiffening", "lost_motion", "viscous_friction", "MORE"]
"""
NEXT = """
[next_measurement]
readings = 30
[next_measurement.range]
torque = [-400, 400]
"""
NOISE = 1.0
STEEP = 0.03
"""[arcsec/Nm]"""


def bench(n: int, most: float, rng: np.random.Generator) -> pd.DataFrame:
    """Operating points of a bench that reaches no further than `most` [N m]."""
    return pd.DataFrame(
        {
            "torque": rng.uniform(0.5 * most, most, n),
            "dir": rng.choice([-1.0, 1.0], n),
            "speed": rng.uniform(5.0, 40.0, n),
        }
    )


def read_off(points: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Measurements of a shaft that winds up in proportion to the torque, and a simulation without."""
    predicted = 0.2 * points["torque"]
    te = predicted + STEEP * points["torque"] + 4.0 + rng.normal(0.0, NOISE, len(points))
    return points.assign(te_predicted=predicted, te=te)


def text_of(more: str = NEXT, consider: str = "windage") -> str:
    return HEAD.replace("MORE", consider) + more


def found(folder: Path, frame: pd.DataFrame, text: str) -> GapResult:
    configuration, table = folder / "gap.toml", folder / "bench.csv"
    configuration.write_text(text, encoding="utf-8")
    frame.to_csv(table, index=False)
    plan = read_gap(configuration)
    return gap.analysis_result(plan, read_data(plan, table))


@pytest.fixture(scope="module")
def record() -> pd.DataFrame:
    rng = np.random.default_rng(4)
    return read_off(bench(100, 300.0, rng), rng)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory, record: pd.DataFrame) -> GapResult:
    return found(tmp_path_factory.mktemp("next"), record, text_of())


def test_points_lie_in_the_range_and_tell_the_names(result: GapResult) -> None:
    planned, points = result.next_measurement, result.next_points
    assert result.verdict == "ambiguous"
    assert planned is not None
    assert points is not None
    assert planned.readings == len(points) == 30
    assert planned.telling[0] == "torque"
    assert points["torque"].abs().max() <= 400.0
    assert set(points["dir"]) <= {-1.0, 1.0}
    assert points["speed"].between(5.0, 40.0).all()
    assert points["torque"].min() < 0.0  # where the record never was
    for one, rival in zip(planned.pairs, result.rivals, strict=True):
        assert one.chance > one.alike
        assert one.expected > one.now
        assert str(len(points)) in str(rival.measurement)


def of_name(name: str, torque: Array) -> Array:
    """The forms of the names over the torque, by their definitions."""
    return {
        "torsional_compliance": torque,
        "hertz_stiffening": np.sign(torque) * np.abs(torque) ** (2.0 / 3.0),
        "lost_motion": np.sign(torque),
    }[name]


def test_the_chance_is_that_of_readings_taken_there(record: pd.DataFrame, result: GapResult) -> None:
    """Measurements at the proposed points, drawn from either name as the record leaves it, and both
    fitted again by least squares: the share in which the right one fits better.
    """
    planned, points = result.next_measurement, result.next_points
    assert planned is not None
    assert points is not None
    both = {"torsional_compliance", "hertz_stiffening"}
    (pair,) = (one for one in planned.pairs if {*one.names, *one.instead_of} == both)
    sigma = result.gate.outputs[0].noise
    y = (record["te"] - record["te_predicted"]).to_numpy() / sigma
    old, new = record["torque"].to_numpy(), points["torque"].to_numpy()
    ahead = next(one.distance for one in result.rivals if one.names == pair.names)
    designs = [[np.column_stack([np.ones(len(t)), of_name(name, t)]) for t in (old, new)]
               for name in (*pair.instead_of, *pair.names)]  # fmt: skip
    rng, right, draws = np.random.default_rng(5), 0, 1500
    for _ in range(draws):
        true = 0 if rng.uniform() < 1.0 / (1.0 + np.exp(-0.5 * ahead)) else 1
        x, at = designs[true]
        root = np.linalg.cholesky(np.linalg.inv(x.T @ x))
        numbers = np.linalg.lstsq(x, y, rcond=None)[0] + root @ rng.normal(size=2)
        seen = np.concatenate([y, at @ numbers + rng.normal(size=len(new))])
        left = [np.linalg.lstsq(np.vstack(one), seen, rcond=None)[1][0] for one in designs]
        right += (left[0] < left[1]) == (true == 0)
    share = right / draws
    assert abs(share - pair.chance) < 4.0 * np.sqrt(share * (1.0 - share) / draws) + 0.01


def test_what_was_ambiguous_is_named_by_those_readings(tmp_path: Path, record: pd.DataFrame, result: GapResult) -> None:
    """And is not by as many readings like those of the record."""
    rng = np.random.default_rng(6)
    assert result.next_points is not None
    there = read_off(result.next_points, rng)
    alike = read_off(bench(30, 300.0, rng), rng)
    verdicts = [found(tmp_path, pd.concat([record, more], ignore_index=True), text_of(""))
                for more in (there, alike)]  # fmt: skip
    assert [one.verdict for one in verdicts] == ["named", "ambiguous"]
    assert verdicts[0].names == ("torsional_compliance",)
    assert verdicts[0].next_measurement is None  # none was asked for


def test_twins_stay_twins(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    frame = bench(80, 300.0, rng)
    frame["te_predicted"] = 0.0
    frame["te"] = 0.2 * frame["speed"] * frame["dir"] + rng.normal(0.0, NOISE, len(frame))
    ended = found(tmp_path, frame, text_of(consider="read_out_lag"))
    assert ended.verdict == "ambiguous"
    planned = ended.next_measurement
    assert planned is not None
    assert planned.text.startswith("no design in this range separates them: record runs that")
    assert ended.next_points is None
    assert ended.rivals[0].measurement.text == planned.text


def test_a_range_that_holds_everything_fast_separates_nothing(tmp_path: Path, record: pd.DataFrame) -> None:
    fixed = '[next_measurement.range]\ntorque = 200\n"dir" = { values = [1] }\nspeed = 20\n'
    ended = found(tmp_path, record, text_of(fixed))
    assert ended.next_measurement is not None
    pairs = ended.next_measurement.pairs
    assert max(one.expected - one.now for one in pairs) < 0.2
    assert max(one.chance - one.alike for one in pairs) < 0.02


def test_an_effect_that_is_barely_there(tmp_path: Path) -> None:
    """Its power is that of a noncentral chi-square at the squared norm of what a free zero leaves
    of it, and the threshold of the library.
    """
    rng = np.random.default_rng(9)
    frame = bench(60, 100.0, rng).assign(te_predicted=0.0)
    frame["te"] = rng.normal(0.0, NOISE, 60)
    size = 0.25
    asked = f"[noise]\nte = {NOISE}\n[next_measurement]\nreadings = 12\namount = {{ torsional_compliance = {size} }}\n"
    ended = found(tmp_path, frame, text_of(asked + "[next_measurement.range]\ntorque = [0, 400]\n"))
    assert ended.verdict == "no_gap"
    assert ended.next_measurement is not None
    assert ended.next_points is not None
    (one,) = ended.next_measurement.effects
    torque, new = frame["torque"].to_numpy(), ended.next_points["torque"].to_numpy()
    slope = size / np.sqrt(np.mean(torque**2))
    np.testing.assert_allclose(one.amount, slope, rtol=1e-9)
    sigma, limit = ended.gate.outputs[0].noise, ended.scores[0].threshold
    norms = [np.sum((slope * (t - t.mean()) / sigma) ** 2)
             for t in (torque, np.concatenate([torque, new]))]  # fmt: skip
    np.testing.assert_allclose([one.now, one.then], stats.ncx2.sf(limit, 1, norms), rtol=1e-6)
    np.testing.assert_allclose(one.least_then, slope * (np.sqrt(limit) + 1.2816) / norms[1] ** 0.5)
    assert np.bincount(np.isin(new, [0.0, 400.0])).tolist()[1:] == [12]  # the ends tell a slope
    assert one.then > one.alike > one.now


def test_cycles_of_a_locked_unit_are_simulated_as_they_stand(tmp_path: Path) -> None:
    rng = np.random.default_rng(10)
    wave = np.interp(np.arange(80) % 40, [0, 10, 30, 40], [0.0, 120.0, -120.0, 0.0])
    rising = np.gradient(wave) >= 0.0
    frame = pd.DataFrame({"torque_Nm": wave, "direction": np.where(rising, 1.0, -1.0)})
    model = registry.load("models", "rv_lost_motion")()
    table = {name: frame[name].to_numpy() for name in frame}
    frame["twist_arcmin"] = model.predict(table, rng)["twist_arcmin"] + 0.004 * wave
    frame["twist_arcmin"] += rng.normal(0.0, 0.15, 80)
    text = (
        'model = "rv_lost_motion"\n[free]\n[settings]\nsimulations = 200\n[effects]\n'
        'consider = ["torsional_compliance", "hertz_stiffening", "friction_hysteresis"]\n'
    )
    (tmp_path / "gap.toml").write_text(text + NEXT.replace("torque", "torque_Nm"))
    frame.to_csv(tmp_path / "d.csv", index=False)
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "d.csv"), "--quiet", "--out"]
    assert CliRunner().invoke(app, [*words, str(tmp_path / "one")]).exit_code == 0
    plan = read_gap(tmp_path / "gap.toml")
    again = gap.analysis_result(plan, read_data(plan, tmp_path / "d.csv")).next_points
    assert again is not None
    written = (tmp_path / "one" / "next_measurement.csv").read_text()
    assert written == again.to_csv(index=False)
    points = pd.read_csv(tmp_path / "one" / "next_measurement.csv")
    assert list(points) == ["torque_Nm", "direction"]
    assert len(points) == 30
    assert points["torque_Nm"].abs().max() <= 400.0
    steps = np.diff(points["torque_Nm"])
    follows = np.sign(steps) == points["direction"].to_numpy()[1:]
    assert follows.mean() > 0.9  # but for where one cycle follows on the other
    words = ["simulate", str(tmp_path / "one" / "corrected.toml"),
             str(tmp_path / "one" / "next_measurement.csv"), "--quiet", "--out"]  # fmt: skip
    assert CliRunner().invoke(app, [*words, str(tmp_path / "s.csv")]).exit_code == 0
    assert np.isfinite(pd.read_csv(tmp_path / "s.csv")["twist_arcmin"]).all()
    said = json.loads((tmp_path / "one" / "gap.json").read_text())["next_measurement"]
    assert said["file"] == "next_measurement.csv"
    assert said["pairs"][0]["chance"] > said["pairs"][0]["alike"]
    page = (tmp_path / "one" / "report.html").read_text()
    assert "The next measurement" in page
    assert (tmp_path / "one" / "next_measurement.png").is_file()


def test_the_units_of_a_batch_are_counted_and_its_twins_told(tmp_path: Path) -> None:
    model, n = registry.load("models", "rv_batch")({"model": "document"}), 60
    units = np.arange(n).astype(str)
    drawn = model.predict({"unit": units}, np.random.default_rng(11))["backlash_arcmin"]
    frame = pd.DataFrame({"unit": units, "backlash_arcmin": drawn + drawn.std()})
    text = (
        'model = "rv_batch"\nparameters.model = "document"\n[free]\n[settings]\nsimulations = 200\n'
        "[next_measurement]\nreadings = 25\n"
    )
    ended = found(tmp_path, frame, text)
    assert ended.verdict == "ambiguous"
    assert ended.next_measurement is not None
    (twin,) = (one for one in ended.next_measurement.pairs if one.names == ("gauge_bias",))
    assert "measure a reference unit" in twin.text
    assert twin.needed == 0
    np.testing.assert_allclose(twin.expected, 0.0, atol=1e-6)


@pytest.mark.slow
def test_wider_or_mixed_is_told_by_more_units(tmp_path: Path) -> None:
    """The discrimination of units that are independent grows with their number."""
    model, n = registry.load("models", "rv_batch")({"model": "document", "reading": "printed"}), 60
    units = np.arange(n).astype(str)
    drawn = model.predict({"unit": units}, np.random.default_rng(1))["backlash_arcmin"]
    wider = drawn.mean() + 1.6 * (drawn - drawn.mean())
    text = (
        'model = "rv_batch"\nparameters.model = "document"\nparameters.reading = "printed"\n'
        "[free]\n[settings]\nsimulations = 200\n[effects]\n"
        'consider = ["population"]\n[next_measurement]\nreadings = 30\n'
    )
    ended = found(tmp_path, pd.DataFrame({"unit": units, "backlash_arcmin": wider}), text)
    assert ended.verdict == "ambiguous"
    assert ended.next_measurement is not None
    (pair,) = ended.next_measurement.pairs
    assert (pair.names, pair.instead_of) == (("lot_mixture",), ("spread_inflation",))
    np.testing.assert_allclose(pair.expected / pair.now, (n + 30) / n)
    assert 0.5 < pair.chance < 1.0
    assert "30 further units" in ended.rivals[0].measurement.text

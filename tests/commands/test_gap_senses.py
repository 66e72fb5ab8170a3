"""Signs, dimensions, gears and clocks of a table: what is said first, left out, or refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.close import Corrected, Number
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.plan import GapPlan
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.commands.gap.result import variance_of_weights
from tolevo.errors import InputError

pytestmark = pytest.mark.usefixtures("unrendered", "units_once")

HEAD = """
model = "table"
seed = 0
{more}
[settings]
simulations = 400
[columns]
"torque" = {{ role = "torque", unit = "{load}" }}
"speed" = {{ role = "speed", unit = "rpm" }}
"way" = {{ role = "direction" }}
"oil" = {{ role = "temperature", unit = "degC" }}
"angle" = {{ role = "angle", unit = "deg" }}
"te" = {{ role = "measured", unit = "{unit}"{sense} }}
"te_predicted" = {{ role = "predicted", unit = "{unit}"{sense} }}
"""
N = 400


def head(more: str = "", load: str = "N m", unit: str = "arcsec", sense: str = "") -> str:
    return HEAD.format(more=more, load=load, unit=unit, sense=sense)


def rows(seed: int = 0) -> pd.DataFrame:
    """Operating points, a prediction of 0.6 arcsec per N m, and readings of it and noise alone."""
    rng = np.random.default_rng(seed)
    frame = pd.DataFrame({
        "torque": rng.uniform(-400.0, 400.0, N),
        "speed": rng.uniform(1.0, 30.0, N),
        "way": rng.choice([-1.0, 1.0], N),
        "oil": rng.uniform(20.0, 60.0, N),
        "angle": rng.uniform(0.0, 720.0, N),
    })  # fmt: skip
    frame["te_predicted"] = 0.6 * frame["torque"]
    frame["te"] = frame["te_predicted"] + 5.0 + rng.normal(0.0, 1.0, N)
    return frame


def written(folder: Path, frame: pd.DataFrame, text: str) -> tuple[Path, Path]:
    configuration, table = folder / "gap.toml", folder / "bench.csv"
    configuration.write_text(text, encoding="utf-8")
    frame.to_csv(table, index=False)
    return configuration, table


def found(folder: Path, frame: pd.DataFrame, text: str) -> GapResult:
    configuration, table = written(folder, frame, text)
    plan = read_gap(configuration)
    return gap.analysis_result(plan, read_data(plan, table))


def refused(folder: Path, frame: pd.DataFrame, text: str) -> str:
    configuration, table = written(folder, frame, text)
    with pytest.raises(InputError) as caught:
        read_data(read_gap(configuration), table)
    return str(caught.value)


def test_a_sensor_the_other_way_round_is_the_first_note(tmp_path: Path) -> None:
    frame = rows().assign(te=lambda f: -(f["te"] + 0.1 * f["torque"]))
    said = found(tmp_path, frame, head())
    assert said.notes[0].startswith("is the sign of te reversed?")
    assert "sense = -1" in said.notes[0]
    right = found(tmp_path, frame, head("sense.te = -1"))
    assert right.names == ("torsional_compliance",)
    assert not any("reversed?" in note for note in right.notes)


def test_an_output_that_counts_the_other_way_round_with_its_prediction(tmp_path: Path) -> None:
    """out - in/i instead of in/i - out, in both columns: every effect is turned."""
    frame = rows().assign(te=lambda f: -(f["te"] + 0.1 * f["torque"]),
                          te_predicted=lambda f: -f["te_predicted"])  # fmt: skip
    said = found(tmp_path, frame, head())
    assert said.notes[0].startswith("is the sign of te reversed?")
    assert "torsional_compliance" in said.notes[0]
    assert found(tmp_path, frame, head(sense=", sense = -1")).names == ("torsional_compliance",)


def test_a_sense_is_kept_by_the_corrected_model(tmp_path: Path) -> None:
    """`simulate` with it predicts what was measured, in the convention's sign."""
    frame = rows().assign(te=lambda f: -(f["te"] + 0.1 * f["torque"]))
    text = found(tmp_path, frame, head("sense.te = -1")).corrected
    again = found(tmp_path, frame, text)
    assert again.verdict == "no_gap"
    assert not any("reversed?" in note for note in again.notes)


def test_signs_as_they_should_be_are_not_doubted(tmp_path: Path) -> None:
    for seed in range(3):
        frame = rows(seed).assign(te=lambda f: f["te"] + 0.02 * f["torque"])
        assert not any("other way round" in n for n in found(tmp_path, frame, head()).notes)


def test_an_angle_that_lags_falls_behind_its_motion(tmp_path: Path) -> None:
    """measured - predicted = -tau v for an angle that grows: the lag, and no viscous friction."""
    frame = rows().assign(te=lambda f: f["te"] - 0.4 * f["speed"] * f["way"])
    said = found(tmp_path, frame, head())
    assert said.names == ("read_out_lag",)
    (number,) = said.effects[0].parameters
    assert number.low < -0.4 < number.high


def test_effects_of_a_shaft_are_left_out_by_name_of_a_force(tmp_path: Path) -> None:
    frame = rows().assign(te=lambda f: f["te"] - 5.0 + 0.3 * f["speed"] * f["way"])
    said = found(tmp_path, frame, head(unit="N"))
    assert said.names == ("viscous_friction",)
    assert "read_out_lag" not in [name for one in said.rivals for name in one.names]
    (note,) = (note for note in said.notes if "angle or a length" in note)
    assert "read_out_lag" in note and "torsional_compliance" in note


def test_oil_at_300_degrees_comes_first(tmp_path: Path) -> None:
    frame = rows().assign(oil=lambda f: f["oil"] * 5.0)
    notes = found(tmp_path, frame, head()).notes
    assert notes[0].startswith('is "degC" the unit of oil?')


def test_a_stiffness_a_thousand_times_that_of_a_gear_comes_first(tmp_path: Path) -> None:
    """Torques of a bench in N mm, given as N m: 100 N m/arcmin becomes 100,000."""
    frame = rows().assign(torque=lambda f: f["torque"] * 1000.0)
    notes = found(tmp_path, frame, head()).notes
    assert notes[0].startswith('is "N m" the unit of torque?')
    assert "1e+05 Nm/arcmin" in notes[0]
    assert not any("stiffness" in note for note in found(tmp_path, rows(), head()).notes)


def test_a_column_without_a_role_is_a_note(tmp_path: Path) -> None:
    frame = rows().assign(comment=1.0, who=2.0)
    said = found(tmp_path, frame, head() + '"who" = { unit = "mm" }\n')
    (note,) = (note for note in said.notes if "without a role" in note)
    assert "comment" in note and "who" in note
    assert found(tmp_path, rows(), head()).verdict == said.verdict == "no_gap"


def test_waves_of_a_declared_gear_have_their_name(tmp_path: Path) -> None:
    frame = rows().assign(te=lambda f: f["te"] + 2.0 * np.cos(45.0 * np.radians(f["angle"])))
    gear = '[gear]\nkind = "rv"\npins = 46\ncycloid_teeth = 45\nsun_teeth = 12\nplanet_teeth = 36'
    said = found(tmp_path, frame, head(gear))
    assert said.names == ("pin_circle_runout",)
    assert {one.name for one in said.effects[0].parameters} == {"cos_45_arcsec", "sin_45_arcsec"}
    assert "orders" in said.corrected
    again = found(tmp_path, frame, said.corrected)
    assert again.verdict == "no_gap"


def test_waves_of_no_declared_gear_have_their_number(tmp_path: Path) -> None:
    frame = rows().assign(te=lambda f: f["te"] + 2.0 * np.cos(45.0 * np.radians(f["angle"])))
    said = found(tmp_path, frame, head())
    assert said.names == ("gear_order",)
    numbers = {one.name: one.value for one in said.effects[0].parameters}
    assert numbers["order"] == 45.0
    (note,) = (note for note in said.notes if "no [gear]" in note)
    assert "pin_circle_runout" in note and "structural_resonance" in note


def test_a_channel_that_comes_late_is_named(tmp_path: Path) -> None:
    """A record in time, 100 Hz: the force of a friction drive, read 13 ms late."""
    rng, t = np.random.default_rng(2), np.arange(500) * 0.01
    speed = 20.0 * np.sin(2.0 * np.pi * 0.9 * t)

    def force(at: np.ndarray) -> np.ndarray:
        return np.asarray(40.0 * np.sin(2.0 * np.pi * 0.9 * at) + 12.0 * np.sin(5.0 * at))

    frame = pd.DataFrame({"t": t, "v": speed, "f_predicted": force(t),
                          "f": force(t - 0.013) + rng.normal(0.0, 0.3, len(t))})  # fmt: skip
    text = (
        'model = "table"\nseed = 0\nsettings.simulations = 400\n[columns]\n'
        't = { role = "time", unit = "s" }\nv = { role = "speed", unit = "rpm" }\n'
        'f = { role = "measured", unit = "N" }\nf_predicted = { role = "predicted", unit = "N" }\n'
    )
    said = found(tmp_path, frame, text)
    assert said.names[0] == "delay"
    (number,) = said.effects[0].parameters
    assert number.value == pytest.approx(0.013, rel=0.05)


def test_bad_gears_and_senses_are_all_said_at_once(tmp_path: Path) -> None:
    wrong = 'sense.tee = -1\nsense.te = 2\n[gear]\nkind = "rv"\npins = 40\ncycloid_teeth = 41'
    said = refused(tmp_path, rows(), head(wrong, sense=', sense = "up"'))
    assert "gear.sun_teeth: is missing" in said and "gear.planet_teeth: is missing" in said
    assert "columns.te.sense: must be 1" in said
    right_columns = refused(tmp_path, rows(), head(wrong))
    assert "sense.tee: is not an output of the model" in right_columns
    assert "sense.te: must be 1" in right_columns
    assert "gear.sun_teeth: is missing" in right_columns


@pytest.mark.parametrize(("gear", "said"), [
    ('kind = "rv"\npins = 40\ncycloid_teeth = 40\nsun_teeth = 12\nplanet_teeth = 36',
     "gear.cycloid_teeth: must be below pins (40), got 40"),
    ('kind = "planetary"\nsun_teeth = 20\nplanet_teeth = 31\nring_teeth = 50\nplanets = 3',
     "gear.ring_teeth: must be sun_teeth + 2 planet_teeth (82), as sun, planet and ring have"),
    ('kind = "planetary"\nsun_teeth = 20\nplanet_teeth = 30\nring_teeth = 82\nplanets = 3',
     "(80), as sun, planet and ring have a common centre distance, got 82; give the orders"),
    ('kind = "harmonc"\nflex_teeth = 200', "gear.kind: must be one of rv, cycloidal, harmonic"),
    ("pins = 40", "gear.kind: is missing"),
    ("orders = { }", "gear.orders: must name at least one"),
    ('kind = "rv"\norders = { "pin passing" = 45 }', "gear.orders: cannot be combined with kind"),
])  # fmt: skip
def test_a_gear_that_is_none(tmp_path: Path, gear: str, said: str) -> None:
    assert said in refused(tmp_path, rows(), head(f"[gear]\n{gear}"))


def test_a_gear_that_contradicts_its_model(tmp_path: Path) -> None:
    text = 'model = "rv_transmission"\n[gear]\nkind = "cycloidal"\npins = 46\ncycloid_teeth = 45\n'
    assert "gear: contradicts rv_transmission" in refused(tmp_path, rows(), text)


def test_two_clocks_in_one_session(tmp_path: Path) -> None:
    text = head() + '"t" = { role = "time", unit = "s" }\n'
    frame = rows().assign(session=np.repeat(["a", "b"], N // 2), t=np.arange(N) * 1.0)
    frame.loc[300:, "t"] -= 250.0
    said = refused(tmp_path, frame, text)
    assert "bench.csv: column t: is set back within session b, at row 302" in said


def test_a_clock_for_each_session_keeps_the_sessions_in_their_order(tmp_path: Path) -> None:
    text = head() + '"t" = { role = "time", unit = "s" }\n'
    frame = rows().assign(session=np.repeat(["b", "a"], N // 2), t=np.tile(np.arange(N // 2), 2))
    configuration, table = written(tmp_path, frame, text)
    data = read_data(read_gap(configuration), table)
    assert any("starts again in each session" in note for note in data.notes)
    np.testing.assert_array_equal(data.measured["te"], frame["te"])


def test_a_step_of_a_session_is_said_and_a_drag_that_is_none_is_at_its_bound(tmp_path: Path) -> None:
    """Blocks are the sessions, whose column has the role `ignore`; load times speed with the load's
    sign alone, so that the drag against the motion ends at 0, and its interval does not.
    """
    frame = rows().assign(session=np.repeat(["a", "b", "c", "d"], N // 4))
    frame["te"] += 0.005 * frame["torque"] * frame["speed"] + 3.0 * (frame["session"] > "b")
    text = head() + '"session" = { role = "ignore" }\n[validation]\nblocks = "session"\n'
    said = found(tmp_path, frame, text)
    assert said.verdict == "partial" and said.names == ("load_viscous",)
    assert said.remainder[0].shape == "a separate level for each session"
    signed, drag = said.effects[0].parameters
    assert signed.low < 0.005 < signed.high
    if drag.value == 0.0:
        assert said.effects[0].at_bound == (drag.name,)
    assert drag.high > 0.0 and drag.low == 0.0


def test_fits_that_weigh_readings_otherwise_widen_what_they_disagree_about() -> None:
    """Beyond two standard errors of their difference the interval of the one holds the other."""
    numbers = tuple(Number("effect", "e", name, -np.inf, np.inf, 1.0) for name in ("a", "b"))
    plan = GapPlan("table", None)
    own = Corrected(plan, (), numbers, np.array([1.0, 1.0]), np.full(2, 0.1), 39,
                    np.diag([0.01, 0.01]))  # fmt: skip
    plain = replace(own, values=np.array([1.2, 2.0]), covariance=np.diag([0.04, 0.04]))
    more = variance_of_weights(own, plain)
    assert set(more) == {("e", "b")}  # 0.2 is 1.2 standard errors
    low, high = own.widened(more).interval("e", "b")
    assert low < 1.0 and high > 2.0

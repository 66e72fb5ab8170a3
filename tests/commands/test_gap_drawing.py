"""The units of a batch are simulated as the run says, built to the allocation that is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.commands.gap.configuration import gap_plan, read_gap
from tolevo.commands.gap.plan import GapPlan
from tolevo.models.inputs import Normal
from tolevo.models.rv_reducer import declared
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.problems.rv_transmission_error import declared as transmission
from tolevo.section import Kind

pytestmark = pytest.mark.usefixtures("without_figures", "units_once")

BACKLASH = "backlash_arcmin"
OTHER = {"pin_circle_radius_mm": 80.0, "pins": 45, "cycloid_teeth": 44}
"""A larger reducer; the reduction ratio as it is."""
MIDS = {"pin_radius_mid_um": 0.5}
PRINTED = {v.name: float(v.document or 0.0) for v in declared.VARIABLES}
ZONES = [v.name for v in declared.VARIABLES if v.kind is Kind.HALF_WIDTH]
DESIGN = PRINTED | {name: round(1.3 * PRINTED[name], 6) for name in ZONES}
RUN = """
problem = "rv_backlash"
[parameters]
pin_circle_radius_mm = 80.0
pins = 45
cycloid_teeth = 44
pin_radius_mid_um = 0.5
[variables.pitch_um]
distribution = "normal"
[[effect]]
name = "process_mean_shift"
parameters = { shift_arcmin = 0.2 }
"""
GAP = 'model = "rv_batch"\n{}\n[parameters]\nmodel = "document"\n[free]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "run.toml").write_text(RUN)
    pd.DataFrame([DESIGN]).to_csv(tmp_path / "built.csv", index=False)
    return tmp_path


def planned(folder: Path, keys: str, more: str = "") -> GapPlan:
    (folder / "gap.toml").write_text(GAP.format(keys) + more)
    return read_gap(folder / "gap.toml")


def faults(folder: Path, keys: str, more: str = "") -> dict[str, str]:
    (folder / "gap.toml").write_text(GAP.format(keys) + more)
    return {one.place: one.message for one in gap_plan(folder / "gap.toml")[1]}


@pytest.mark.parametrize("stated", ["over_constraint = true", "pin_classes = 5"])
def test_a_run_whose_units_the_simulation_does_not_follow_is_refused(folder: Path, stated: str) -> None:
    """What takes up play or is matched there would be found as an effect, and counted twice."""
    run = f'problem = "rv_reducer"\n[parameters]\n{stated}\n[limits]\ninterference_probability = 0.05\n'
    (folder / "run.toml").write_text(run)
    (folder / "gap.toml").write_text('model = "rv_batch"\nrun = "run.toml"\n')
    told = {one.place: one.message for one in gap_plan(folder / "gap.toml")[1]}
    assert told["run"].startswith(f"run.toml states {stated.partition(' ')[0]} = ") and "do not follow" in told["run"]


def test_units_are_those_of_the_run_and_its_allocation(folder: Path) -> None:
    """The mean is that of the model set up by hand at the same numbers."""
    plan = planned(folder, 'run = "run.toml"\nbuilt_to = "built.csv"')
    by_hand = RvBatch({**OTHER, **MIDS, "model": "document"}, DESIGN, {"pitch_um": Normal()})
    assert plan.model is not None and plan.drawing is not None
    assert plan.model.means()[BACKLASH] == pytest.approx(by_hand.means()[BACKLASH], rel=1e-12)
    assert plan.model.means()[BACKLASH] != pytest.approx(RvBatch().means()[BACKLASH], rel=0.01)
    assert [(one.effect.name, dict(one.values)) for one in plan.active] == [
        ("process_mean_shift", {"shift_arcmin": 0.2})
    ]
    laws = {one.variable: one.distribution for one in plan.drawing.zones}
    assert laws["pitch_um"].startswith("normal") and laws["runout_um"] == "uniform"
    assert plan.drawing.assumed == "" and plan.drawing.allocation_from.startswith("built.csv, row 1 (circle")
    zone = next(one for one in plan.drawing.zones if one.variable == "pin_radius_um")
    assert (zone.low, zone.high) == pytest.approx((0.5 - 1.3, 0.5 + 1.3), rel=1e-12)


def test_what_is_not_named_is_said_first(folder: Path) -> None:
    neither = planned(folder, "").drawing
    assert neither is not None
    first = neither.lines()[0]
    assert first.startswith("answered for the model's default drawing: ")
    assert "run = " in first and "built_to = " in first
    of_run = planned(folder, 'run = "run.toml"').drawing
    assert of_run is not None and of_run.assumed.startswith("answered for the model's default "
                                                            "allocation: built_to = ")  # fmt: skip
    built = planned(folder, 'built_to = "built.csv"').drawing
    assert built is not None and "run = " in built.assumed and "built_to" not in built.assumed


def test_a_row_of_several_designs(folder: Path) -> None:
    wide = {**DESIGN, "runout_um": 2.5}
    pd.DataFrame([DESIGN, wide]).to_csv(folder / "built.csv", index=False)
    assert "holds 2 designs: say which" in faults(folder, 'built_to = "built.csv"')["built_to"]
    plan = planned(folder, 'built_to = { file = "built.csv", point = 2 }')
    assert plan.drawing is not None and plan.drawing.allocation_from.startswith("built.csv, row 2")
    assert {one.variable: one.value for one in plan.drawing.zones}["runout_um"] == 2.5


def test_everything_that_contradicts_is_a_fault(folder: Path) -> None:
    more = '[variables.runout_um]\nvalue = 9.0\n[variables.pitch_um]\ndistribution = "triangular"\n'
    text = GAP.format('run = "run.toml"\nbuilt_to = "built.csv"').replace(
        'model = "document"', 'model = "document"\npins = 40\ncycloid_teeth = 44'
    )
    (folder / "gap.toml").write_text(text + more)
    found = {one.place: one.message for one in gap_plan(folder / "gap.toml")[1]}
    assert set(found) == {"parameters.pins", "variables.runout_um.value",
                          "variables.pitch_um.distribution"}  # fmt: skip
    assert "40 here and 45 in run.toml" in found["parameters.pins"]
    assert "9 here and 1.3 in built.csv" in found["variables.runout_um.value"]


def test_an_allocation_of_another_problem_is_a_fault(folder: Path) -> None:
    pd.DataFrame([transmission.DOCUMENT_MRAD]).to_csv(folder / "built.csv", index=False)
    said = faults(folder, 'run = "run.toml"\nbuilt_to = "built.csv"')
    assert "is an allocation of another problem" in said["built_to"]
    pd.DataFrame([{**DESIGN, "gear_1_x_mrad": 2.0, "pitch_um": -1.0}]).to_csv(folder / "built.csv", index=False)
    (folder / "gap.toml").write_text(GAP.format('built_to = "built.csv"'))
    both = [one.message for one in gap_plan(folder / "gap.toml")[1]]
    assert any("gear_1_x_mrad is not a variable" in one for one in both)
    assert any("pitch_um must lie in [0, 1000], got -1" in one for one in both)
    assert "which run.toml searches" in _without_a_column(folder)


def _without_a_column(folder: Path) -> str:
    short = {name: value for name, value in DESIGN.items() if name != "pitch_um"}
    pd.DataFrame([short]).to_csv(folder / "built.csv", index=False)
    return faults(folder, 'run = "run.toml"\nbuilt_to = "built.csv"')["built_to"]


def test_models_of_no_drawing_have_no_allocation(folder: Path) -> None:
    (folder / "gap.toml").write_text('model = "rv_lost_motion"\nbuilt_to = "built.csv"\n')
    (fault,) = gap_plan(folder / "gap.toml")[1]
    assert fault.place == "built_to" and "units made to a drawing" in fault.message


def test_a_chosen_point_of_a_run_directory(folder: Path) -> None:
    """The rounded allocation of `allocation.csv`, or a row of the front by its number."""
    command = ["run", str(folder / "run.toml"), "--out", str(folder / "run"), "--quiet",
               "--set", "algorithm.name=nsga2",
               "--set", "algorithm.population=12", "--set", "algorithm.generations=2",
               "--set", "references=none",
               "--set", "limits.interference_probability=0.9"]  # fmt: skip
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    table = pd.read_csv(folder / "run" / "allocation.csv")
    label = table["choice"].iloc[0].split()[0]
    mine = table[table["point"] == table["point"].iloc[0]].set_index("variable")["rounded"]
    plan = planned(folder, f'built_to = {{ run = "run", point = "{label}" }}')
    assert plan.drawing is not None and plan.drawing.geometry_from == "run"
    values = {one.variable: one.value for one in plan.drawing.zones}
    assert {name: values[name] for name in mine.index} == pytest.approx(dict(mine), rel=1e-12)
    assert {one.name: one.value for one in plan.drawing.geometry}["pins"] == 45
    front = pd.read_csv(folder / "run" / "front.csv")
    plan = planned(folder, 'run = "run.toml"\nbuilt_to = { file = "run", point = 0 }')
    assert plan.drawing is not None
    values = {one.variable: one.value for one in plan.drawing.zones}
    assert values["pitch_um"] == pytest.approx(front["pitch_um"].iloc[0], rel=1e-12)
    said = faults(folder, 'built_to = { file = "run", point = "kneee" }')
    assert "did you mean `knee`" in said["built_to.file"]
    both = faults(folder, 'built_to = { run = "run", file = "run", point = "knee" }')
    assert "leave out one of the two" in both["built_to.file"]


def test_terminal_and_file_begin_with_what_was_simulated(folder: Path) -> None:
    units = RvBatch({**OTHER, **MIDS, "model": "document"}, DESIGN)
    table = {"unit": np.arange(60).astype(str)}
    read = units.predict(table, np.random.default_rng(2))
    pd.DataFrame({**table, **read}).to_csv(folder / "units.csv", index=False)
    (folder / "gap.toml").write_text(GAP.format('built_to = "built.csv"'))
    done = CliRunner().invoke(app, ["gap", str(folder / "gap.toml"), str(folder / "units.csv"),
                                    "--out", str(folder / "out"), "--quiet"])  # fmt: skip
    assert done.exit_code == 0, done.output
    first, second, third = done.output.splitlines()[:3]
    assert first.startswith("answered for the model's default geometry and distributions: run = ")
    assert second.startswith("simulated: rv_batch, ") and third.startswith("built to: ")
    record = json.loads((folder / "out" / "gap.json").read_text())
    assert next(iter(record)) == "simulated" and record["notes"][0] == first
    assert record["simulated"]["allocation_from"].startswith("built.csv, row 1")
    page = (folder / "out" / "report.html").read_text()
    assert page.index("What was simulated") < page.index("<h2>Verdict")
    assert "<p>None" not in page


def test_assemblies_take_the_process_of_the_run(folder: Path) -> None:
    """Its parameters, and a departure that it has as a parameter as the effect of that name."""
    (folder / "run.toml").write_text('problem = "rv_transmission_error"\n[parameters]\n'
                                     'insertion = "after"\nspringback = 0.1\n')  # fmt: skip
    given = {**transmission.DOCUMENT_MRAD, "precision_weight": 5.0}
    pd.DataFrame([given]).to_csv(folder / "built.csv", index=False)
    text = 'model = "assembly"\nrun = "run.toml"\nbuilt_to = "built.csv"\n[free]\n'
    (folder / "gap.toml").write_text(text)
    plan = read_gap(folder / "gap.toml")
    assert plan.parameters["insertion"] == "after" and plan.drawing is not None
    assert [(one.effect.name, dict(one.values)) for one in plan.active] == [("springback", {"springback": 0.1})]
    values = {one.variable: one.value for one in plan.drawing.zones}
    assert values == pytest.approx(given, rel=1e-12) and plan.drawing.assumed == ""
    (folder / "gap.toml").write_text(text + '[parameters]\ninsertion = "before"\n')
    (fault,) = gap_plan(folder / "gap.toml")[1]
    assert fault.place == "parameters.insertion"


@pytest.mark.parametrize(
    ("text", "table", "places"),
    [
        (
            'model = "rv_batch"\nrun = "run.toml"\nbuilt_to = "other.csv"\n[parameters]\n'
            'pins = 40\n[sense]\nbacklash_mm = -1\n[gear]\nkind = "rv"\npins = 40\n',
            "unit,backlash_arcmin\n1,0.5\n",
            ("gear.cycloid_teeth", "gear.sun_teeth", "sense.backlash_mm", "built_to:",
             "parameters.pins"),
        ),
        (
            'model = "table"\nrun = "run.toml"\nbuilt_to = "other.csv"\n[gear]\n'
            'kind = "planetary"\nsun_teeth = 20\n[sense]\nnothing = -1\n[columns]\n'
            't = { role = "time", unit = "s" }\ny = { role = "measured", unit = "N" }\n'
            'p = { role = "predicted", unit = "N" }\n',
            "session,t,y,p\n" + "".join(f"0,{k % 30},{k},1\n" for k in range(60)),
            ("gear.ring_teeth", "gear.planets", "sense.nothing", "run:", "built_to:",
             "data.csv: column t: is set back within session 0"),
        ),
        (
            'model = "serial_arm"\n[sense]\nnothing = -1\n[[joint]]\nd_mm = 89.0\n'
            'a_mm = "long"\n[[joint]]\nalpha_deg = 90.0\nlenght_mm = 3\n',
            "q\n1\n",
            ("sense.nothing", "joint[0].a_mm", "joint[0].alpha_deg", "joint[1].d_mm",
             "joint[1].lenght_mm", "data.csv: contains none of the measured outputs"),
        ),
    ],
    ids=["batch", "table", "arm"],
)  # fmt: skip
def test_every_fault_at_once_and_nothing_written(folder: Path, text: str, table: str, places: tuple[str, ...]) -> None:
    (folder / "gap.toml").write_text(text)
    (folder / "data.csv").write_text(table)
    (folder / "other.csv").write_text("dtheta_1_um,dtheta_2_um\n1,2\n")
    command = ["gap", str(folder / "gap.toml"), str(folder / "data.csv"), "--out"]
    done = CliRunner().invoke(app, [*command, str(folder / "out")])
    assert done.exit_code == 2 and not (folder / "out").exists()
    for place in places:
        assert place in done.output, (place, done.output)

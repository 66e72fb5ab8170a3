"""Costs from files, currencies, set-ups: what a configuration comes to, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tolevo
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.cost_reading import add_constant_cost, times
from tolevo.models.costs import CURVES, Table

STACK = """
problem = "stack"
currency = "EUR"
[costs]
file = "costs.csv"
[requirement]
name = "gap"
unit = "mm"
[limits]
variation = 0.5
[[part]]
name = "pin"
nominal = 25.0
sensitivity = 1.0
t_min = 0.002
t_max = 0.05
setup = { price = 120.0, lot = 50 }
inspection = { price = 0.4 }
[[part]]
name = "bore"
nominal = 25.0
sensitivity = -1.0
grade = ["IT5", "IT9"]
[[part]]
name = "cap"
sensitivity = 1.0
[[part.process]]
name = "turned"
t_min = 0.01
t_max = 0.05
[[part.machine]]
name = "lathe"
sigma = 0.01
"""
COSTS = """Teile für Gehäuse;;;;;
part;process;t [µm];grade;cost [EUR];Bemerkung
pin;;5;;9,5;
pin;;10;;6,0;
pin;;20;;6,5;teurer
bore;;;IT6;12,0;
bore;;;IT7;8,5;
bore;;;IT8;7,0;
cap;turned;10;;4,0;
cap;turned;50;;2,0;
cap;lathe;;;1,5;
"""


def written(folder: Path, text: str, costs: str = COSTS, encoding: str = "cp1252") -> Path:
    (folder / "costs.csv").write_bytes(costs.encode(encoding))
    (folder / "c.toml").write_text(text, encoding="utf-8")
    return folder / "c.toml"


def faults(path: Path, *overrides: str) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        read(path, overrides)
    found: dict[str, str] = {}
    for fault in caught.value.faults:
        found[fault.place] = f"{found.get(fault.place, '')} | {fault.message}"
    return found


def test_a_german_export_prices_parts_processes_machines_and_grades(tmp_path: Path) -> None:
    problem: Any = read(written(tmp_path, STACK)).problem
    pin, bore, cap = problem.definition.parts
    share = 120.0 / 50 + 0.4
    assert pin.processes[0].curve == Table((0.005, 0.01, 0.02), (9.5 + share, 6 + share, 6.5 + share))
    assert (pin.low, pin.high) == (0.005, 0.02)
    assert [one.name for one in bore.processes] == ["IT6", "IT7", "IT8"]
    assert [float(one.curve.cost(np.array([1.0]))[0]) for one in bore.processes] == [12.0, 8.5, 7.0]
    assert cap.processes[0].curve == Table((0.01, 0.05), (4.0, 2.0))
    assert cap.processes[1].machine.price == 1.5
    design = problem.complete(np.array([problem.xu]))
    own = problem.costs_of(design)
    assert own["pin_t"][0] == 6.0 + share  # the lower price of a tighter one
    cost = next(one for one in problem.outputs if one.name == "cost")
    assert cost.unit == "EUR"


def test_what_was_narrowed_and_what_rises_is_said(tmp_path: Path) -> None:
    problem: Any = read(written(tmp_path, STACK)).problem
    told = " | ".join(problem.cautions())
    assert "part pin: costs are given from 0.005 to 0.02 mm: the search from 0.002 to 0.05" in told
    assert "part bore: prices are given from IT6 to IT8; the search from IT5 to IT9" in told
    assert "the prices of part pin do not fall with the tolerance (at t = 0.02)" in told
    assert "costs.csv: not used: Bemerkung" in told


def test_the_resolved_configuration_needs_no_file(tmp_path: Path) -> None:
    found = read(written(tmp_path, STACK))
    again = tmp_path / "elsewhere" / "config.toml"
    again.parent.mkdir()
    again.write_text(found.toml(), encoding="utf-8")
    other = read(again)
    assert other.toml() == found.toml()
    assert 'currency = "EUR"' in other.toml()


def test_a_file_of_one_part(tmp_path: Path) -> None:
    (tmp_path / "pin.csv").write_text("t;cost\n0,005;9\n0,02;6\n", encoding="utf-8")
    own = 'sensitivity = 1.0\ncosts = { file = "pin.csv" }\nt_min'
    text = STACK.replace('[costs]\nfile = "costs.csv"\n', "")
    text = text.replace("sensitivity = 1.0\nt_min", own, 1)
    text = text.replace('grade = ["IT5", "IT9"]', "tolerance = 0.01")
    text = text.partition('[[part]]\nname = "cap"')[0]
    problem: Any = read(written(tmp_path, text)).problem
    assert problem.definition.parts[0].processes[0].curve.t == (0.005, 0.02)


@pytest.mark.parametrize(
    ("change", "place", "message"),
    [
        (("cost [EUR]", "Preis"), "costs.file", "column cost is missing"),
        (("cost [EUR]", "cost [USD]"), "currency", 'whose costs are in "USD"'),
        (("t [µm]", "t [mrad]"), "costs.file", 'pin: t is in "mrad"'),
        (("pin;;10;;6,0", "pin;;5;;6,0"), "costs.file", "pin: t = 0.005 has two costs"),
        (("pin;;10;;6,0", "pin;;-1;;6,0"), "costs.file", 't must be a number above 0, got "-1"'),
        (("pin;;10;;6,0", "pin;;10;;"), "costs.file", "line 4: cost is empty"),
        (("pin;;10;;6,0", "pni;;10;;6,0"), "costs.file", '"pni" of the file is not a part'),
        (("bore;;;IT7;8,5;\n", ""), "part[1].price.IT7", "each grade of the range needs its price"),
        (("IT7", "IT77"), "costs.file", '"IT77" is not a grade'),
        (("bore;;;IT7", "bore;;5;IT7"), "costs.file", "has t (5) and a grade (IT7)"),
        (("cap;lathe;;", "cap;lahte;;"), "costs.file", 'no process or machine "lahte"'),
        (("cap;lathe;;", "cap;lathe;10;"), "costs.file", "machine lathe has one price"),
    ],
)  # fmt: skip
def test_faults_of_a_file_are_placed(tmp_path: Path, change: tuple[str, str], place: str, message: str) -> None:
    assert change[0] in COSTS
    found = faults(written(tmp_path, STACK, COSTS.replace(*change)))
    assert message in found[place] and len(found) == 1, found


def test_every_fault_at_once_and_a_missing_file(tmp_path: Path) -> None:
    text = STACK.replace("sigma = 0.01", "sigma = 0").replace('"EUR"', '"E U"')
    found = faults(written(tmp_path, text, COSTS.replace("pin;;10;;6,0", "pin;;x;;6,0")))
    assert {"costs.file", "currency", "part[2].machine[0].sigma"} <= found.keys()
    found = faults(written(tmp_path, STACK), "costs.file=other.csv")
    assert "does not exist" in found["costs.file"]
    found = faults(written(tmp_path, STACK), "costs.scale_assumed=3")
    assert "none is assumed" in found["costs"]


REDUCER = """
problem = "rv_backlash"
currency = "EUR"
[costs]
file = "costs.csv"
scale_assumed = 25.0
"""
PINS = "variable,t_um,cost_EUR\npin_radius_um,0.5,42\npin_radius_um,2,31\n"


def test_assumed_costs_are_worth_what_is_stated_and_are_marked(tmp_path: Path) -> None:
    path = written(tmp_path, REDUCER, PINS, "utf-8")
    problem: Any = read(path).problem
    plain: Any = read(path, ["costs.scale_assumed=1"]).problem
    design = problem.complete(np.array([problem.xu]))
    own, other = problem.costs_of(design), plain.costs_of(design)
    assert own["pin_radius_um"] == other["pin_radius_um"] == 31.0
    for name in problem.settings.money.assumed:
        np.testing.assert_allclose(own[name], 25.0 * other[name], rtol=1e-12)
    assert len(problem.settings.money.assumed) == 10
    cost = next(one for one in problem.outputs if one.name == "cost")
    assert cost.unit == "EUR, partly assumed" and "pitch_um" in cost.meaning
    assumed = [one for one in problem.assumptions() if one.name.startswith("costs.")]
    assert len(assumed) == 10 and all("costs 25 EUR" in one.reason for one in assumed)
    assert "costs of pin_radius_um are given from 0.5 to 2 um" in " ".join(problem.cautions())
    again = tmp_path / "again.toml"
    again.write_text(read(path).toml(), encoding="utf-8")
    assert read(again).toml() == read(path).toml()


@pytest.mark.parametrize("problem", ["rv_backlash", "pose_accuracy", "rv_reducer"])
def test_mixing_stated_and_assumed_costs_is_a_fault(tmp_path: Path, problem: str) -> None:
    path = tmp_path / "c.toml"
    path.write_text(f'problem = "{problem}"\ncurrency = "EUR"\n', encoding="utf-8")
    found = faults(path)
    assert "scale_assumed" in found["currency"]
    extra = "costs.scale_assumed=10"
    limit = "limits.interference_probability=0.1"
    kept: Any = read(path, [extra] + ([limit] if problem == "rv_reducer" else [])).problem
    assert next(one for one in kept.outputs if one.name == "cost").unit == "EUR, partly assumed"


def test_a_scale_needs_a_currency_and_a_currency_a_name(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text('problem = "rv_backlash"\ncosts.scale_assumed = 0\n', encoding="utf-8")
    assert "must be above 0" in faults(path)["costs.scale_assumed"]
    assert "needs a currency" in faults(path, "costs.scale_assumed=2.0")["costs.scale_assumed"]
    assert "name of a currency" in faults(path, "currency=12.5 %")["currency"]


@pytest.mark.parametrize("kind", CURVES)
def test_curves_in_another_unit_and_dearer(kind: str) -> None:
    values: dict[str, Any] = {"a": 1.0, "b": 0.5, "k": 0.7, "m": 2.0, "c": 0.2}
    curve: Any = CURVES[kind]
    names = curve.__dataclass_fields__
    one = curve((0.1, 0.5), (3.0, 1.0)) if kind == "table" else curve(
        **{name: value for name, value in values.items() if name in names})  # fmt: skip
    t = np.linspace(0.1, 0.5, 9)
    np.testing.assert_allclose(times(one, 3.0).cost(t), 3.0 * one.cost(t), rtol=1e-14)
    np.testing.assert_allclose(add_constant_cost(one, 0.4).cost(t), one.cost(t) + 0.4, rtol=1e-14)


def test_evaluate_states_costs_with_their_shares(tmp_path: Path) -> None:
    configuration = read(written(tmp_path, STACK))
    designs = tmp_path / "d.csv"
    designs.write_text("pin_t,bore_t,bore_process,cap_t,cap_process\n"
                       "0.01,0.0165,IT8,0.03,lathe\n", encoding="utf-8")  # fmt: skip
    out = tmp_path / "o.csv"
    tolevo.evaluate(configuration, designs, out)
    header, row = out.read_text(encoding="utf-8").splitlines()[:2]
    cost = float(row.split(",")[header.split(",").index("cost")])
    np.testing.assert_allclose(cost, 6.0 + 2.8 + 7.0 + 1.5, rtol=1e-12)


def graded(more: str) -> str:
    """The stack with more keys beside the grades of the bore."""
    grades = 'grade = ["IT5", "IT9"]\n'
    return STACK.replace(grades, f"{grades}{more}\n")


@pytest.mark.parametrize(
    ("more", "added"),
    [
        ("setup = { price = 90.0, lot = 30 }\ninspection = { price = 0.25 }", (3.25, 3.25, 3.25)),
        ("setup = { price = { IT6 = 90.0, IT7 = 60.0, IT8 = 0.0 }, lot = 30 }", (3.0, 2.0, 0.0)),
    ],
)
def test_grades_bear_their_share_of_a_set_up(more: str, added: tuple[float, ...], tmp_path: Path) -> None:
    path = written(tmp_path, graded(more))
    configuration = read(path)
    problem: Any = configuration.problem
    bore = problem.definition.parts[1]
    costs = [float(one.curve.cost(np.array([one.low]))[0]) for one in bore.processes]
    np.testing.assert_allclose(costs, np.array([12.0, 8.5, 7.0]) + added)
    (tmp_path / "again.toml").write_text(configuration.toml(), encoding="utf-8")
    again: Any = read(tmp_path / "again.toml").problem
    assert again.definition.parts[1].processes == bore.processes


def test_curves_of_variables_bear_their_share_of_a_set_up(tmp_path: Path) -> None:
    """With a curve in the configuration, and beside the rows of a file."""
    text = """problem = "rv_backlash"
[costs]
file = "costs.csv"
[costs.pin_radius_um]
setup = { price = 30.0, lot = 20 }
[costs.runout_um]
model = "reciprocal"
a = 1.0
b = 2.0
setup = { price = 60.0, lot = 20 }
inspection = { price = 0.5 }
"""
    configuration = read(written(tmp_path, text, PINS.replace("cost_EUR", "cost")))
    assert configuration.problem is not None
    costs = configuration.problem.settings.costs
    assert float(costs["pin_radius_um"].cost(np.array([2.0]))[0]) == 31.0 + 1.5
    assert float(costs["runout_um"].cost(np.array([2.0]))[0]) == 2.0 + 3.0 + 0.5
    (tmp_path / "again.toml").write_text(configuration.toml(), encoding="utf-8")
    again = read(tmp_path / "again.toml").problem
    assert again is not None and again.settings.costs == costs


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (graded("setup = { price = { IT6 = 90.0, IT7 = -1.0, IT11 = 2.0 } }"),
         ("part[1].setup.lot", "part[1].setup.price.IT8", "part[1].setup.price.IT7",
          "part[1].setup.price.IT11")),
        (graded("setup = { price = 90.0, lot = 0 }"), ("part[1].setup.lot",)),
        ('problem = "rv_backlash"\n[costs.pin_radius_um]\nsetup = { price = 30.0, lot = 20 }',
         ("costs.pin_radius_um.setup",)),
        ('problem = "rv_backlash"\n[costs.pin_radius_um]\nmodel = "reciprocal"\na = 1.0\nb = 1.0\n'
         "setup = { price = 30.0 }", ("costs.pin_radius_um.setup.lot",)),
    ],
)  # fmt: skip
def test_faults_of_a_set_up_are_placed(text: str, place: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(written(tmp_path, text))
    places = [fault.place for fault in caught.value.faults]
    assert sorted(places) == sorted(place)


@pytest.mark.parametrize("case", ["typo_unit", "long_unit"])
def test_a_mistyped_unit_with_a_file_of_costs_is_the_only_fault(case: str) -> None:
    with pytest.raises(InputError) as caught:
        read(Path(__file__).parents[1] / "cases" / "unit_cost_file" / f"{case}.toml")
    (fault,) = caught.value.faults
    assert fault.place == "requirement.unit"
    assert "is not a unit" in fault.message
    assert len(fault.message) < 200

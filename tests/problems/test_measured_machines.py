"""Machines whose scatter and mean are those of measured parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from tolevo.configuration.reader import read
from tolevo.errors import InputError

VALUES = np.random.default_rng(3).normal(0.8, 1.2, 30).round(3)
"""Deviations from the nominal [um]."""
GRINDER = {"name": "grinder", "price": 3.0, "inspection": {"price": 0.4}}


def stack(machine: dict[str, Any], **part: Any) -> dict[str, Any]:
    shaft = {"name": "shaft", "unit": "um", "sensitivity": 1.0, "machine": [machine]}
    return {
        "problem": "stack",
        "objectives": {"minimise": ["cost"]},
        "limits": {"variation": 6.0},
        "requirement": {"name": "gap", "unit": "um", "nominal": 0.0},
        "part": [shaft | part],
    }


def reducer(machine: dict[str, Any], **variable: Any) -> dict[str, Any]:
    return {"problem": "rv_backlash",
            "variables": {"pin_radius_um": {"machine": [machine]} | variable}}  # fmt: skip


def problem_of(folder: Path, table: dict[str, Any]) -> Any:
    (folder / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    return read(folder / "c.toml").problem


def written(folder: Path, name: str, nominal: float) -> dict[str, Any]:
    """The values as sizes in millimetres, in a German file or a Q-DAS file."""
    sizes = [f"{nominal + value / 1000.0:.6f}".replace(".", ",") for value in VALUES]
    if name.endswith(".csv"):
        rows = [f"{at};{size}" for at, size in enumerate(sizes)]
        text = "\n".join(["Stück;Radius [mm]", *rows])
    else:
        head = ["K0100 1", "K1001 7", "K2001 1", "K2002 Radius", f"K2101 {nominal}", "K2142 mm"]
        text = "\n".join([*head, *(f"K0001 {size}" for size in sizes)])
    (folder / name).write_text(text, encoding="cp1252")
    return {"file": name, "characteristic": "Radius"}


def test_a_part_has_the_scatter_and_mean_of_the_file(tmp_path: Path) -> None:
    measured = written(tmp_path, "r.csv", 25.0)
    given = stack(GRINDER | {"measured": measured}, unit="mm", nominal=25.0, sensitivity=1000.0)
    machine = problem_of(tmp_path, given).definition.parts[0].processes[0].machine
    assert machine.sigma == pytest.approx(0.001 * VALUES.std(ddof=1), rel=1e-6)
    assert machine.mean == pytest.approx(0.001 * VALUES.mean(), rel=1e-6)


@pytest.mark.parametrize("mean", ["corrected", "as_found"])
def test_a_tolerance_has_them_about_its_mid_limit(mean: str, tmp_path: Path) -> None:
    """The nominal is that of the file; deviations are from the mid-limit of the pins, -1 um."""
    measured = written(tmp_path, "r.dfq", 3.0) | {"mean": mean}
    problem = problem_of(tmp_path, reducer(GRINDER | {"measured": measured}))
    machine = problem.machined_tolerances["pin_radius_um"].ways[1].machine
    assert machine.sigma == pytest.approx(VALUES.std(ddof=1), rel=1e-6)
    expected = VALUES.mean() + 1.0 if mean == "as_found" else 0.0
    assert machine.mean == pytest.approx(expected, rel=1e-6)
    moved = problem_of(tmp_path, reducer(GRINDER | {"measured": measured}, mid=0.5))
    by = 0.0 if mean == "corrected" else -1.5
    assert moved.machined_tolerances["pin_radius_um"].ways[0].machine.mean - machine.mean == pytest.approx(by)


def test_what_is_known_is_said_and_written(tmp_path: Path) -> None:
    drifting = (VALUES + np.linspace(0.0, 8.0, len(VALUES))).round(3).tolist()
    for given, place in ((stack, "part.shaft.machine"), (reducer, "variables.pin_radius_um.machine")):
        table = given(GRINDER | {"measured": {"values": drifting}})
        (tmp_path / "c.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
        configuration = read(tmp_path / "c.toml")
        problem = configuration.problem
        assert problem is not None
        told = {one.name: one for one in problem.assumptions()}
        assert str(told[f"{place}.grinder.measured"].value).startswith("30 parts: mean ")
        assert "does not state that it is corrected" in told[place].reason
        assert any("grinder, measured: drifts by" in text for text in problem.cautions())
        (tmp_path / "again.toml").write_text(configuration.toml(), encoding="utf-8")
        again = read(tmp_path / "again.toml")
        assert again.toml() == configuration.toml()
        designs = problem.complete(problem.xu[None])
        assert again.problem is not None
        np.testing.assert_array_equal(again.problem.cost_of(designs), problem.cost_of(designs))


def test_a_prior_is_worth_so_many_parts(tmp_path: Path) -> None:
    measured = {"values": VALUES.tolist(), "prior": {"sigma": 2.0, "parts": 10}}
    machine = problem_of(tmp_path, stack(GRINDER | {"measured": measured})).definition.parts[0]
    square = (10 * 4.0 + 29 * VALUES.var(ddof=1)) / 39
    assert machine.processes[0].machine.sigma == pytest.approx(np.sqrt(square))
    measured |= {"made_to": 6.0, "prior": {"cp": 1.0, "parts": 10}}  # 6/(3 Cp) = 2
    again = problem_of(tmp_path, stack(GRINDER | {"measured": measured})).definition.parts[0]
    assert again.processes[0].machine.sigma == pytest.approx(np.sqrt(square))


def test_every_fault_has_its_place(tmp_path: Path) -> None:
    wrong: list[tuple[dict[str, Any], list[str]]] = [
        ({"measured": {"values": VALUES.tolist()}, "sigma": 1.0, "mean": 0.1},
         ["sigma: is stated in addition to measured", "mean: is stated in addition to measured"]),
        ({"measured": {"file": "none.csv"}}, ["measured.file: none.csv does not exist"]),
        ({"measured": {"values": [1.0, 2.0]}}, ["measured.values: has 2 values"]),
        ({"measured": {"values": VALUES.tolist(), "prior": {"cp": 1.3, "parts": 5}}},
         ["measured.prior.cp: needs made_to"]),
        ({"measured": {"values": (25000.0 + VALUES).tolist()}},
         ["measured.values: lie up to 2.5", "state measured.nominal"]),
        ({}, ["sigma: is missing"]),
    ]  # fmt: skip
    for given, place in ((stack, "part[0]"), (reducer, "variables.pin_radius_um")):
        for more, words in wrong:
            with pytest.raises(InputError) as caught:
                problem_of(tmp_path, given(GRINDER | more))
            text = "\n".join(map(str, caught.value.faults))
            for word in words:
                assert word in text, (word, text)
            assert f"{place}.machine[0]." in text

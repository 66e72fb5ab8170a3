"""An effect of somebody's own is considered, or named with the reason why it is not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from tolevo import registry
from tolevo.commands.gap.data import GapData
from tolevo.commands.gap.library import candidates, not_considered
from tolevo.models.effects.effect import Measurements, Target
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.effects.shapes import OneColumn, Weight
from tolevo.models.measurable import Column, Role
from tolevo.section import Array, Output

TABLE = {"torque": np.linspace(-3.0, 4.0, 30)}
COLUMNS = (Column("torque", "N m", "", role=Role.TORQUE),)


class CableDrag(OneColumn):
    """Drag of the cables."""

    name = "cable_drag"
    family = "load"
    cause = "The cables hold the output back."
    formula = "c sin(theta)"
    needs = (Role.ANGLE,)
    weight = Weight("amplitude", "c, the largest drag")

    def column(self, readings: Measurements, values: Mapping[str, float], target: Target) -> Array:
        return np.asarray(np.sin(readings[Role.ANGLE]))


def data(population: bool = False) -> GapData:
    target = target_from("table", (Output("te", "arcsec", ""),), COLUMNS, TABLE,
                         population=population)  # fmt: skip
    readings = measurements_of(COLUMNS, TABLE)
    return GapData(target, readings, {"te": TABLE["torque"]}, {}, {}, np.arange(30))


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    load, origin = registry.load, registry.origin

    def loaded(group: str, name: str) -> object:
        return CableDrag if name == "cable_drag" else load(group, name)

    def from_where(group: str, name: str) -> str:
        return "cables 1.0" if name == "cable_drag" else origin(group, name)

    monkeypatch.setattr(registry, "load", loaded)
    monkeypatch.setattr(registry, "origin", from_where)


@pytest.mark.parametrize("population", [False, True])
def test_a_plugin_that_lacks_a_column_is_named(population: bool) -> None:
    names = ["cable_drag", "torsional_compliance", "lot_mixture", "viscous_friction"]
    found = not_considered(names, data(population))
    assert "not considered, no column of the role angle: cable_drag" in found
    assert not any("lot_mixture" in one for one in found)


def test_effects_of_our_own_are_named_where_a_column_would_bring_them_in() -> None:
    found = not_considered(["viscous_friction", "torsional_compliance", "joint_clearance"], data())
    assert found == ["not considered, no column of the role speed or direction: viscous_friction"]
    assert [one.name for one in candidates(["torsional_compliance"], data())] == ["torsional_compliance"]

"""The contract, for every effect of the library that acts on outputs of a table."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tolevo import registry
from tolevo.models.effects.angle import GearOrder
from tolevo.models.effects.effect import FAMILIES, Target
from tolevo.models.effects.instrument import Delay
from tolevo.models.effects.load import DirectionalOffset
from tolevo.models.effects.measurements import target_from
from tolevo.section import Output
from tolevo.testing import EffectContract

LIBRARY = {
    "load": "torsional_compliance hertz_stiffening lost_motion bearing_clearance"
    " friction_hysteresis load_sharing load_friction directional_offset",
    "geometry by angle": "output_eccentricity pin_circle_runout eccentric_error two_disc_error"
    " sun_runout pitch_defect gear_order",
    "speed": "structural_resonance viscous_friction windage stribeck load_viscous",
    "temperature, time": "differential_thermal_expansion thermal_friction drift creep wear thermal_zero",
    "memory": "dahl_friction lugre_friction bouc_wen_hysteresis load_creep double_load_creep stick_slip_backlash"
    " dead_zone_with_friction",
    "population": "process_mean_shift spread_inflation tool_wear_drift lot_mixture lot_offset",
    "manipulator": "joint_zero_offset arm_length_error base_tilt gravity_sag thermal_growth"
    " drive_eccentricity joint_clearance",
    "assembly": "adjustment_gain adjustment_backlash chain_coupling springback",
    "instrument": "gauge_bias read_out_lag encoder_harmonics quantisation clock_drift delay",
}
"""Names to the letter, as the table of the library has them."""
ELSEWHERE = ("memory", "population", "manipulator", "assembly")
"""These need a path, or have models of their own, and are tried there."""
APART = ("directional_offset", "gear_order", "delay")
"""These need another output, no gear, or rows in their order."""
NAMES = [
    name for family, names in LIBRARY.items() for name in names.split() if family not in ELSEWHERE and name not in APART
]


@pytest.mark.parametrize("name", NAMES)
class TestEveryEffectOfATable(EffectContract):
    @pytest.fixture(autouse=True)
    def _named(self, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(type(self), "effect_type", registry.load("effects", name), False)


class TestDirectionalOffset(EffectContract):
    effect_type = DirectionalOffset

    def target(self, table: dict[str, np.ndarray] | None) -> Target:
        return target_from("table", (Output("pull_N", "N", ""),), self.columns(), table)


class TestGearOrder(EffectContract):
    effect_type = GearOrder

    def target(self, table: dict[str, np.ndarray] | None) -> Target:
        return replace(super().target(table), gear=None)


class TestDelay(EffectContract):
    effect_type = Delay
    has_path = True


def test_families_are_those_of_the_table() -> None:
    found: dict[str, set[str]] = {}
    for name in registry.names("effects"):
        effect: Any = registry.load("effects", name)
        assert effect.name == name
        found.setdefault(effect.family, set()).add(name)
    assert {family: set(names.split()) for family, names in LIBRARY.items()} == found
    assert set(found) <= set(FAMILIES)


def test_rivals_exist() -> None:
    names = registry.names("effects")
    for name in names:
        assert set(registry.load("effects", name).mistaken_for) <= set(names), name

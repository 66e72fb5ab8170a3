"""Several effects in one model: the order in which they compose."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo import registry
from tolevo.models.effects.measurements import Active, predicted, target_of
from tolevo.models.inputs import Distribution
from tolevo.models.measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Role
from tolevo.section import Array, Output, Parameter, Value


class Spring(MeasurableModel):
    """A spring with a dead zone of its own: twist = sgn(T) (|T|/100 + clearance)."""

    columns = (Column("torque_Nm", "Nm", "", role=Role.TORQUE), Column("direction", "", "", role=Role.DIRECTION))
    outputs = (Output("twist_arcmin", "arcmin", ""), Output("copy_mm", "mm", ""))
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    free: ClassVar[Mapping[str, float]] = {}
    changeable = (Changeable("bearing_clearance_in", "in", "dead zone in series"),)

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        pass

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        load = np.asarray(table["torque_Nm"], dtype=float)
        zone = np.broadcast_to(changes.get("bearing_clearance_in", 0.0), load.shape)
        twist = np.sign(load) * (np.abs(load) / 100.0 + zone)
        return {"twist_arcmin": twist, "copy_mm": 10.0 * twist}


TABLE = {"torque_Nm": np.array([-50.0, 20.0, 80.0]), "direction": np.array([1.0, -1.0, 1.0])}


def run(*effects: tuple[str, dict[str, float]]) -> dict[str, Array]:
    active = [Active(registry.load("effects", name)(), values) for name, values in effects]
    return predicted(Spring(), "spring", TABLE, active, np.random.default_rng(0))


def test_no_effect_is_the_model() -> None:
    np.testing.assert_array_equal(run()["twist_arcmin"], [-0.5, 0.2, 0.8])


def test_quantity_that_bears_the_name_is_where_the_effect_acts() -> None:
    effect = registry.load("effects", "bearing_clearance")()
    numbers = effect.parameters(target_of(Spring, "spring", TABLE))
    assert [(one.name, one.unit, one.low, one.linear) for one in numbers] == [
        ("bearing_clearance_in", "in", 0.0, False)
    ]
    found = run(("bearing_clearance", {"bearing_clearance_in": 0.25}))
    np.testing.assert_allclose(found["twist_arcmin"], [-0.75, 0.45, 1.05])


def test_inside_then_outputs_then_readings_whatever_the_list() -> None:
    """By hand: inside 0.45, + 3 e-3 T and a loop of 0.1 outside, read in steps of 0.5."""
    listed = (
        ("quantisation", {"twist_step_arcmin": 0.5}),
        ("friction_hysteresis", {"twist_half_width_arcmin": 0.1}),
        ("bearing_clearance", {"bearing_clearance_in": 0.25}),
        ("torsional_compliance", {"twist_compliance_arcmin_per_Nm": 3e-3}),
    )
    # -0.5 - 0.25 + 0.1 - 0.15 = -0.8; 0.2 + 0.25 - 0.1 + 0.06 = 0.41; 0.8 + 0.25 + 0.1 + 0.24
    for order in (listed, listed[::-1]):
        found = run(*order)
        np.testing.assert_allclose(found["twist_arcmin"], [-1.0, 0.5, 1.5])
        np.testing.assert_allclose(found["copy_mm"], [-7.5, 4.5, 10.5])  # moved inside only


def test_same_quantity_changed_twice_is_summed() -> None:
    found = run(*[("bearing_clearance", {"bearing_clearance_in": c}) for c in (0.1, 0.15)])
    np.testing.assert_allclose(found["twist_arcmin"], [-0.75, 0.45, 1.05])


def test_outputs_of_one_model_have_parameters_of_their_own() -> None:
    effect = registry.load("effects", "lost_motion")()
    numbers = [one.name for one in effect.parameters(target_of(Spring, "spring"))]
    assert numbers == ["twist_half_width_arcmin", "copy_half_width_mm"]
    found = run(("lost_motion", {"copy_half_width_mm": 2.0}))
    np.testing.assert_allclose(found["twist_arcmin"], [-0.5, 0.2, 0.8])
    np.testing.assert_allclose(found["copy_mm"], [-7.0, 4.0, 10.0])


@pytest.mark.parametrize("name", ["adjustment_gain", "adjustment_backlash", "chain_coupling",
                                  "springback"])  # fmt: skip
def test_assembly_effects_act_where_the_model_has_them(name: str) -> None:
    model = registry.load("models", "assembly")
    effect = registry.load("effects", name)()
    target = target_of(model, "assembly")
    assert effect.applies(target)
    assert not effect.applies(target_of(Spring, "spring"))
    (number,) = effect.parameters(target)
    assert number.name.startswith(name)
    table = _assembly_table(model)
    plain = predicted(model(), "assembly", table, [], np.random.default_rng(0))
    for size, moves in ((0.0, False), (0.05, True)):
        active = [Active(effect, {number.name: size})]
        found = predicted(model(), "assembly", table, active, np.random.default_rng(0))
        same = all(np.array_equal(found[key], plain[key]) for key in plain)
        assert same != moves


def _assembly_table(model: type[MeasurableModel]) -> dict[str, NDArray[Any]]:
    rng = np.random.default_rng(1)
    return {
        column.name: np.arange(6).astype(str).astype(object)
        if column.text
        else (np.full(6, 0.5) if column.name == "precision_weight" else rng.normal(0.0, 2.0, 6))
        for column in model.columns
    }

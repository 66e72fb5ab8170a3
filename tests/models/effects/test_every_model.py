"""Every effect in every registered model: it acts, stays finite, and does nothing at 0."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo import registry
from tolevo.models.effects.effect import Effect, EffectParameter
from tolevo.models.effects.measurements import Active, predicted, target_of
from tolevo.models.measurable import MeasurableModel, Role

N = 8
RANGES = {
    Role.ANGLE: (0.0, 360.0),
    Role.TORQUE: (-300.0, 300.0),
    Role.SPEED: (5.0, 25.0),
    Role.TEMPERATURE: (15.0, 40.0),
    Role.PAYLOAD: (1.0, 5.0),
    Role.INPUT: (0.2, 0.8),
}


def table_of(model: type[MeasurableModel]) -> dict[str, NDArray[Any]]:
    """A small table of every column of a model, and of time."""
    rng = np.random.default_rng(3)
    table: dict[str, NDArray[Any]] = {"time_s": np.linspace(0.0, 600.0, N)}
    for column in model.columns:
        low, high = RANGES.get(column.role, (0.0, 1.0))
        table[column.name] = rng.uniform(low, high, N)
        if column.text:
            table[column.name] = np.array(list("abcdefgh"), dtype=object)
        elif column.role is Role.DIRECTION:
            table[column.name] = rng.choice([-1.0, 1.0], N)
        elif column.name in ("r_mm", "z_mm"):
            table[column.name] = rng.uniform(*{"r_mm": (350, 600), "z_mm": (120, 280)}[column.name],
                                             N)  # fmt: skip
    return table


def size(one: EffectParameter, zero: bool) -> float:
    if one.linear:
        return 0.0 if zero else min(1e-3, one.high)
    if one.choices:
        return one.choices[0]
    high = one.high if np.isfinite(one.high) else one.low + 1.0
    return max(one.low, 0.0) if zero else one.low + 0.3 * (high - one.low)


@pytest.mark.parametrize("name", registry.names("models"))
def test_effects_of_a_model(name: str) -> None:
    model = registry.load("models", name)()
    table = table_of(type(model))
    target = target_of(model, name, table)
    plain = predicted(model, name, table, [], np.random.default_rng(0))
    acting = []
    for called in registry.names("effects"):
        effect: Effect = registry.load("effects", called)()
        if not effect.applies(target):
            continue
        acting.append(called)
        numbers = effect.parameters(target)
        for zero in (True, False):
            if zero and effect.place(target) is None and not any(one.linear for one in numbers):
                continue  # a reading in steps of no size is tried apart
            active = Active(effect, {one.name: size(one, zero) for one in numbers})
            found = predicted(model, name, table, [active], np.random.default_rng(0))
            for key, values in found.items():
                assert values.shape == (N,)
                assert np.all(np.isfinite(values)), (called, key)
                if zero:
                    np.testing.assert_array_equal(values, plain[key], err_msg=called)
            if not zero:
                assert any(np.any(found[key] != plain[key]) for key in plain), called
    assert {"drift", "gauge_bias"} <= set(acting)

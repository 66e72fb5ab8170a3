"""The step that readings come in, found from the readings alone."""

import numpy as np
import pytest

from tolevo import registry
from tolevo.models.effects.instrument import step_of
from tolevo.models.effects.measurements import target_from
from tolevo.section import Output


def numbers(n: int, spread: float, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(40.0, spread, n)


@pytest.mark.parametrize("step", [0.0137, 0.31831, 4.0, 250.0])
@pytest.mark.parametrize("n", [60, 2000])
def test_step_is_found(step: float, n: int) -> None:
    """From a few steps to some hundred of them."""
    for spread in (3.0 * step, 60.0 * step):
        read = step * np.round(numbers(n, spread) / step)
        assert step_of(read) == pytest.approx(step, rel=1e-9)


def test_step_is_found_of_numbers_that_were_cut_to_some_digits() -> None:
    step = 0.31831
    read = np.round(step * np.round(numbers(600, 6.0) / step), 3)
    assert step_of(read) == pytest.approx(step, rel=1e-4)


def test_decimals_are_steps() -> None:
    cut: np.ndarray = np.round(numbers(400, 5.0), 2)
    assert step_of(cut) == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("n", [20, 60, 300, 2400])
def test_numbers_that_are_not_rounded_have_none(n: int) -> None:
    assert not any(step_of(numbers(n, 5.0, seed)) for seed in range(200))


def test_steps_beside_zero_have_none() -> None:
    """The effect rounds to multiples: it could not repeat them."""
    assert step_of(2.0 * np.round(numbers(300, 9.0) / 2.0) + 0.7) is None


def test_three_levels_that_recur_are_steps() -> None:
    assert step_of(np.tile([-40.0, 0.0, 40.0], 20)) == pytest.approx(40.0, rel=1e-12)


@pytest.mark.parametrize("values", [np.array([]), np.full(30, 2.0), np.array([0.0, 1.0, 2.0])])
def test_few_readings_have_none(values: np.ndarray) -> None:
    assert step_of(values) is None


def test_outputs_have_steps_of_their_own() -> None:
    outputs = (Output("a", "mrad", ""), Output("b", "mrad", ""))
    effect = registry.load("effects", "quantisation")()
    target = target_from("table", outputs, ())
    rough = 0.5 * np.round(numbers(90, 4.0) / 0.5)
    shown = effect.shown({"a": rough, "b": numbers(90, 4.0)}, target)
    assert list(shown.values()) == pytest.approx([0.5, 0.0], rel=1e-9)
    assert list(shown) == [one.name for one in effect.parameters(target)]
    assert effect.shown({"a": numbers(90, 4.0), "b": numbers(90, 4.0)}, target) is None

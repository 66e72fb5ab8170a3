"""Effects on batches, and the pin circle that temperature changes."""

import math
from typing import ClassVar

import numpy as np
import pytest
from scipy import stats

from tolevo import registry
from tolevo.models.effects.effect import Effect, Target
from tolevo.models.effects.measurements import Active, predicted, target_of
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.section import Value
from tolevo.testing import EffectContract

DOCUMENT: dict[str, Value] = {"model": "document"}
"""Units by document B's closed form."""

N = 50
NAMES = ["process_mean_shift", "spread_inflation", "tool_wear_drift", "lot_mixture", "lot_offset"]


def batch(count: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    return {
        "unit": np.array([str(i) for i in range(count)], dtype=object),
        "lot": rng.choice(np.array(["A", "B", "C"], dtype=object), count),
        "temperature_C": rng.uniform(15.0, 45.0, count),
    }


def drawn(table: dict[str, np.ndarray], name: str = "", seed: int = 0, **values: float
          ) -> np.ndarray:  # fmt: skip
    active = [Active(registry.load("effects", name)(), values)] if name else []
    rng = np.random.default_rng(seed)
    return predicted(RvBatch(DOCUMENT), "rv_batch", table, active, rng)["backlash_arcmin"]


@pytest.mark.parametrize("name", [*NAMES, "differential_thermal_expansion"])
class TestEveryEffectOfABatch(EffectContract):
    rows: ClassVar[int] = N

    @pytest.fixture(autouse=True)
    def _named(self, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        effect: type[Effect] = registry.load("effects", name)
        monkeypatch.setattr(type(self), "effect_type", effect, False)
        if name == "differential_thermal_expansion":  # inside, it needs no column
            monkeypatch.setattr(effect, "needs", ())

    def table(self) -> dict[str, np.ndarray]:
        return batch(N)

    def target(self, table: dict[str, np.ndarray] | None) -> Target:
        return target_of(RvBatch, "rv_batch", table)


def test_shift_moves_every_unit() -> None:
    table = batch(N)
    found = drawn(table, "process_mean_shift", shift_arcmin=-0.2) - drawn(table)
    np.testing.assert_allclose(found, -0.2, rtol=1e-12)


def test_inflation_keeps_the_mean_and_widens_about_it() -> None:
    table = {"unit": np.arange(200_000)}
    plain, wide = drawn(table), drawn(table, "spread_inflation", growth=0.5)
    mean = RvBatch(DOCUMENT).means()["backlash_arcmin"]
    np.testing.assert_allclose(wide - mean, 1.5 * (plain - mean), atol=1e-12)
    # the model's mean is that of the convolution, the sample's within its standard error of it
    assert abs(plain.mean() - mean) < 5.0 * plain.std() / math.sqrt(len(plain))


def test_tool_wear_runs_with_the_units_in_the_order_of_measuring() -> None:
    table = batch(4) | {"time_s": np.array([30.0, 10.0, 20.0, 40.0])}
    found = drawn(table, "tool_wear_drift", rate_per_unit_arcmin=0.1) - drawn(table)
    np.testing.assert_allclose(found, [0.2, 0.0, 0.1, 0.3], atol=1e-12)


def test_repeats_of_a_unit_stay_one_unit() -> None:
    table = {"unit": np.array(["a", "b", "a", "c"], dtype=object), "repeat": np.array([1.0, 1.0, 2.0, 1.0])}
    found = drawn(table, "tool_wear_drift", rate_per_unit_arcmin=0.1) - drawn(table)
    np.testing.assert_allclose(found, [0.0, 0.1, 0.0, 0.2], atol=1e-12)
    mixed = drawn(table, "lot_mixture", share=0.5, offset_arcmin=1.0)
    assert mixed[0] == mixed[2]


def test_mixture_has_the_share_and_the_step() -> None:
    count = 20_000
    table = {"unit": np.arange(count)}
    active = [Active(registry.load("effects", "lot_mixture")(), {"share": 0.3,
                                                               "offset_arcmin": 5.0})]  # fmt: skip
    rng = np.random.default_rng(0)
    found = predicted(RvBatch(DOCUMENT), "rv_batch", table, active, rng)["backlash_arcmin"]
    second = found - drawn(table) > 2.5
    assert stats.binomtest(int(second.sum()), count, 0.3).pvalue > 1e-6
    np.testing.assert_allclose((found - drawn(table))[second], 5.0, rtol=1e-9)


def test_mixture_goes_by_lots_where_they_are_known() -> None:
    table = batch(N)
    for seed in range(5):
        step = drawn(table, "lot_mixture", seed, share=0.5, offset_arcmin=1.0) - drawn(table, seed=seed)
        for lot in "ABC":
            assert np.ptp(step[table["lot"] == lot]) < 1e-12


def test_mixture_within_lots_goes_by_units() -> None:
    table = batch(N)
    given = drawn(table, "lot_mixture", within_lots=1.0, share=0.5, offset_arcmin=1.0)
    step = given - drawn(table)
    for lot in "ABC":
        assert set(np.round(step[table["lot"] == lot], 9)) == {0.0, 1.0}
    effect, target = (registry.load("effects", "lot_mixture")(), target_of(RvBatch, "rv_batch", table))
    assert effect.parameter("within_lots", target).choices == (0.0, 1.0)


def test_mixture_says_by_how_much_it_moves_the_mean() -> None:
    table = {"unit": np.arange(20_000)}
    effect, target = (registry.load("effects", "lot_mixture")(), target_of(RvBatch, "rv_batch", table))
    carried = effect.carried({"share": 0.3, "offset_arcmin": -0.5}, target)
    step = drawn(table, "lot_mixture", share=0.3, offset_arcmin=-0.5) - drawn(table)
    assert step.mean() == pytest.approx(carried, abs=4.0 * 0.5 * np.sqrt(0.21 / 20_000))
    inflation = registry.load("effects", "spread_inflation")()
    assert inflation.carried({"growth": 0.4}, target) == 0.0


def test_offset_of_a_lot() -> None:
    table = batch(N)
    step = drawn(table, "lot_offset", offset_B_arcmin=0.4) - drawn(table)
    np.testing.assert_allclose(step, 0.4 * (table["lot"] == "B"), atol=1e-12)
    effect, target = registry.load("effects", "lot_offset")(), target_of(RvBatch, "rv_batch", table)
    names = [one.name for one in effect.parameters(target)]
    assert names == ["offset_B_arcmin", "offset_C_arcmin"]  # beside the first
    assert effect.parameter("offset_Z_arcmin", target) is not None
    assert effect.parameter("offset_arcmin", target) is None


def test_labels_that_are_numbers() -> None:
    """A Parquet file may hold lots as numbers: 1.0 is lot 1."""
    table = batch(3) | {"lot": np.array([1.0, 2.0, 1.0])}
    step = drawn(table, "lot_offset", offset_1_arcmin=0.4) - drawn(table)
    np.testing.assert_allclose(step, [0.4, 0.0, 0.4], atol=1e-12)


def test_disc_warmer_than_the_housing_closes_the_pin_circle() -> None:
    """By hand: 2 sqrt(1 - k1^2) alpha r_p/(e z_c) per kelvin, 0.058', times 117/121."""
    k1 = 1.3 * 40 / 64.0
    per_kelvin = 2.0 * math.sqrt(1.0 - k1**2) * 11.5e-6 * 64.0 / (1.3 * 39)
    slope = math.degrees(per_kelvin) * 60.0
    assert slope == pytest.approx(0.058, abs=5e-4)
    slope *= 117.0 / 121.0  # at the carrier, the sun held
    table = {"unit": np.arange(2000)}
    wide = RvBatch(DOCUMENT | {"pin_circle_radius_mid_um": 60.0})  # phi_2 is never cut off
    for difference in (1.0, -4.0, 10.0):
        found = changed(wide, table, {"disc_temperature_K": difference})
        np.testing.assert_allclose(found, -slope * difference, rtol=1e-9)
        active = [Active(registry.load("effects", "differential_thermal_expansion")(),
                         {"temperature_difference_K": difference})]  # fmt: skip
        rngs = [np.random.default_rng(0) for _ in range(2)]
        warm = predicted(wide, "rv_batch", table, active, rngs[0])["backlash_arcmin"]
        cold = wide.predict(table, rngs[1])["backlash_arcmin"]
        np.testing.assert_allclose(warm - cold, found, atol=1e-12)


PRINTED: dict[str, Value] = {"reading": "printed"}


def changed(model: RvBatch, table: dict[str, np.ndarray], by: dict[str, float]) -> np.ndarray:
    rngs = [np.random.default_rng(0) for _ in range(2)]
    changes = {name: np.array(value) for name, value in by.items()}
    new = model.predict(table, rngs[0], changes)["backlash_arcmin"]
    return np.asarray(new - model.predict(table, rngs[1])["backlash_arcmin"])


def test_unit_that_warms_up_as_a_whole_keeps_its_backlash() -> None:
    both = {"disc_temperature_K": 25.0, "housing_temperature_K": 25.0}
    np.testing.assert_allclose(changed(RvBatch(DOCUMENT), {"unit": np.arange(500)}, both), 0.0, atol=1e-12)


def test_share_of_the_measured_temperature() -> None:
    table = batch(N)
    wide = RvBatch(DOCUMENT | {"pin_circle_radius_mid_um": 60.0})
    active = [Active(registry.load("effects", "differential_thermal_expansion")(),
                     {"temperature_share": 0.5})]  # fmt: skip
    rngs = [np.random.default_rng(0) for _ in range(2)]
    warm = predicted(wide, "rv_batch", table, active, rngs[0])["backlash_arcmin"]
    cold = wide.predict(table, rngs[1])["backlash_arcmin"]
    expected = -0.05818 * 117.0 / 121.0 * 0.5 * (table["temperature_C"] - 20.0)
    np.testing.assert_allclose(warm - cold, expected, rtol=2e-3, atol=1e-9)


def test_cold_disc_cannot_open_what_interferes() -> None:
    """Units whose phi_2 is below zero gain less than the slope: the interference goes first."""
    found = changed(RvBatch(DOCUMENT | PRINTED), {"unit": np.arange(5000)}, {"housing_temperature_K": 1.0})
    assert found.min() >= 0.0
    assert found.max() == pytest.approx(0.0582, abs=2e-4)
    assert np.mean(found < 0.058) > 0.3


@pytest.mark.parametrize("error", ["pin_circle_radius", "pin_radius", "runout"])
def test_change_of_an_error_is_that_of_its_mid_limit(error: str) -> None:
    table = {"unit": np.arange(1000)}
    wide: dict[str, Value] = {"pin_hole_radius_mid_um": 60.0}
    mids = {one.name: float(str(one.default)) for one in RvBatch.parameters if "_mid_um" in one.name}
    moved = RvBatch(wide | {f"{error}_mid_um": mids[f"{error}_mid_um"] + 2.0})
    rngs = [np.random.default_rng(0) for _ in range(2)]
    expected = moved.predict(table, rngs[0])["backlash_arcmin"]
    expected = expected - RvBatch(wide).predict(table, rngs[1])["backlash_arcmin"]
    found = changed(RvBatch(wide), table, {f"{error}_um": 2.0})
    np.testing.assert_allclose(found, expected, atol=1e-10)

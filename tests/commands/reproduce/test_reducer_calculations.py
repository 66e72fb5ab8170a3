"""The calculations on the RV reducer, against the physics notes and each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo import registry
from tolevo.commands.reproduce.recipes import Calculation, Computed
from tolevo.commands.reproduce.records import ComputedTable
from tolevo.errors import InputError

NAMES = ("tooth_modification", "tolerance_zones", "reducer_monte_carlo", "staggered_assembly")


def calculation(name: str) -> Calculation:
    found = registry.load("calculations", name)()
    assert isinstance(found, Calculation)
    return found


def computed(name: str, seed: int = 0, /, **values: Any) -> Computed:
    return calculation(name).compute(values, np.random.default_rng(seed))


def numbers(found: Computed) -> dict[str, float]:
    return {name: one.value for name, one in found.quantities.items()}


def columns(found: Computed, name: str) -> dict[str, Any]:
    table: ComputedTable = next(one for one in found.tables if one.name == name)
    return {axis.name: values for axis, values in zip(table.columns, table.values, strict=True)}


@pytest.mark.parametrize("name", NAMES)
def test_declares_what_it_computes(name: str) -> None:
    own, found = calculation(name), computed(name)
    units = {one.name: one.unit or "1" for one in own.outputs}
    assert units == {key: one.unit for key, one in found.quantities.items()}
    assert np.all(np.isfinite(list(numbers(found).values())))
    drawn = any(one.standard_error > 1e-3 for one in found.quantities.values())
    assert drawn == own.sampled
    for table in found.tables:
        assert len({len(column) for column in table.values}) == 1
        names = [axis.name for axis in table.columns]
        assert table.chart is None or {table.chart.x, *table.chart.y} <= set(names)


def test_modification_of_section_3() -> None:
    found = numbers(computed("tooth_modification"))
    assert found["dr_p_mm"] == pytest.approx(-0.070, abs=2e-4)
    assert found["least_printed_clearance_mm"] == pytest.approx(-0.095, abs=5e-4)
    assert found["least_printed_clearance_at_deg"] == pytest.approx(31.0, abs=0.6)
    assert found["least_printed_own_phase_clearance_mm"] == pytest.approx(-0.143, abs=5e-4)
    assert found["printed_optimum_backlash_arcmin"] == pytest.approx(0.11, abs=5e-3)
    assert found["least_after_contact_clearance_mm"] >= 0.0
    assert found["zero_backlash_dr_p_mm"] == pytest.approx(-0.0719, abs=5e-5)
    assert found["bound_um"] == pytest.approx(found["deviation_um"], rel=1e-9)
    assert abs(found["gap_um"]) < 1e-9


def test_every_target_is_proven_and_keeps_the_gap_where_it_is_fixed() -> None:
    table = columns(computed("tooth_modification", intervals=90), "targets")
    np.testing.assert_allclose(table["bound_um"], table["deviation_um"], atol=1e-7)
    fixed = table["radial_gap"] == "fixed"
    gap = table["dr_rp_mm"] - table["dr_p_mm"]
    np.testing.assert_allclose(gap[fixed], 0.03, rtol=1e-9)
    assert np.all(table["deviation_um"][~fixed] <= table["deviation_um"][fixed] + 1e-9)
    np.testing.assert_allclose(
        table["exact_backlash_arcmin"][fixed], table["backlash_arcmin"][fixed] * 117.0 / 121.0, atol=0.01
    )


def test_a_table_of_the_users_own_is_met() -> None:
    """Clearance of (-0.025, -0.061) mm at ten degrees' steps, with the gap free."""
    phi = np.radians(np.arange(0.0, 181.0, 10.0))
    root = np.sqrt(1.0 + 0.8125**2 - 1.625 * np.cos(phi))
    wanted = -25.0 + 61.0 * (1.0 - 0.8125 * np.cos(phi)) / root
    given = {"target": "table", "table_um": tuple(wanted.tolist()), "radial_gap": "free"}
    found = numbers(computed("tooth_modification", intervals=18, **given))
    assert (found["dr_rp_mm"], found["dr_p_mm"]) == pytest.approx((-0.025, -0.061), abs=1e-7)


def test_zones_of_least_backlash() -> None:
    """The optimum by hand: each coefficient times its bound, and the law of the eccentricity."""
    found = numbers(computed("tolerance_zones"))
    flank = np.sqrt(1.0 - 0.8125**2)
    ends = -2 * flank * 5 - 1.625 * 5 - 0.8125 * 8 - 0.5 * 2 - 2 * 3 - 2 * flank * 3
    bent = 2.0 * (-0.055 * 5.0 - 12.6e-3 * 25.0)
    unit = 1e-3 / 50.7 / np.radians(1.0 / 60.0)
    assert found["without_modification_arcmin"] == pytest.approx((ends + bent) * unit, rel=1e-9)
    assert found["phi_2_arcmin"] == pytest.approx(0.1095 + (ends + bent) * unit, abs=1e-4)
    assert found["gap_arcmin"] == pytest.approx(0.0, abs=1e-12)
    assert found["clipped_backlash_arcmin"] == pytest.approx(0.0, abs=1e-12)
    assert found["eccentricity_um"] == 5.0
    assert found["printed_middle_arcmin"] == pytest.approx(0.0149, abs=1e-4)


def test_printed_zones_beside_the_optimum() -> None:
    """Holes are not towards it (assembly), runout is centred; the rest is."""
    table = columns(computed("tolerance_zones"), "errors")
    side = dict(zip(table["error"], table["towards_optimum"], strict=True))
    assert side.pop("pin_hole_radius") == "no"
    assert side.pop("runout") == "centred"
    assert side.pop("eccentricity") == "not printed"
    assert set(side.values()) == {"yes"}
    share = table["printed_share_arcmin"][:-1] / table["width_at_equal_share_um"][:-1]
    width = (table["printed_high_um"] - table["printed_low_um"])[:-1]
    total = table["printed_share_arcmin"][:-1].sum()
    np.testing.assert_allclose(share * 8.0 * table["width_at_equal_share_um"][:-1] ** 2 / width,
                               total, rtol=1e-9)  # fmt: skip


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"crank_bearing_um": 20.0, "stagger_arcmin": 0.2, "units": 5000},
        {"distribution": "normal", "cp": 1.33, "pitch_distribution": "triangular"},
    ],
)
def test_monte_carlo_is_convolution_within_its_errors(given: dict[str, Any]) -> None:
    found = computed("reducer_monte_carlo", **given)
    table = columns(found, "against_convolution")
    assert np.all(np.abs(table["standard_errors_apart"]) < 4.0)
    value = numbers(found)
    assert value["yield_percent"] + value["above_limit_percent"] == pytest.approx(100.0)
    assert value["above_limit_ppm"] == pytest.approx(1e4 * value["above_limit_percent"])
    assert columns(found, "histogram")["units"].sum() == value["units"] == given.get("units", 1000)


def test_distributions_narrow_the_spread() -> None:
    """Standard deviations of phi_2: uniform t/sqrt(3), normal at Cp 1 t/3."""
    uniform, normal = (
        numbers(computed("reducer_monte_carlo", units=20_000, distribution=law))["phi_2_std_arcmin"]
        for law in ("uniform", "normal")
    )
    assert normal / uniform == pytest.approx(np.sqrt(3.0) / 3.0, rel=0.03)


def test_same_seed_same_units() -> None:
    first, again, other = (numbers(computed("reducer_monte_carlo", s)) for s in (1, 1, 2))
    assert first == again
    assert first["backlash_mean_arcmin"] != other["backlash_mean_arcmin"]


def test_stagger_of_section_2() -> None:
    found = computed("staggered_assembly")
    value = numbers(found)
    assert value["without_above_limit_percent"] == pytest.approx(11.45, abs=0.01)
    assert value["contact_by_turn_arcmin"] == pytest.approx(0.4, rel=1e-6)
    assert value["contact_by_journals_arcmin"] == pytest.approx(0.4, rel=1e-3)
    assert value["hole_offset_um"] == pytest.approx(36e3 * np.radians(0.2 / 60.0), rel=1e-6)
    assert value["journal_phase_mrad"] == pytest.approx(39.0 * value["blank_angle_mrad"])
    sweep = columns(found, "sweep")
    assert np.all(np.diff(sweep["interference_percent"]) >= 0.0)
    assert np.all(np.diff(sweep["backlash_mean_arcmin"]) <= 0.0)
    np.testing.assert_allclose(sweep["stagger_arcmin"], np.linspace(0.0, 0.6, 31))


def test_stagger_for_every_unit_leaves_none_above_the_limit() -> None:
    needed = numbers(computed("staggered_assembly"))["stagger_for_every_unit_arcmin"]
    found = numbers(computed("staggered_assembly", stagger_arcmin=needed))
    assert found["backlash_most_arcmin"] == pytest.approx(1.0, rel=1e-12)
    large = numbers(computed("staggered_assembly", crank_bearing_um=20.0))
    assert large["stagger_for_every_unit_arcmin"] == np.inf


@pytest.mark.parametrize(
    ("name", "given", "place"),
    [
        ("tooth_modification", {"band_deg": (45.0, 30.0)}, "parameters.band_deg"),
        ("tooth_modification", {"band_deg": (30.1, 30.2)}, "parameters.band_deg"),
        ("tooth_modification", {"eccentricity_mm": 1.7}, "parameters.eccentricity_mm"),
        ("tolerance_zones", {"pitch_zone_um": (3.0, 1.0)}, "parameters.pitch_zone_um"),
        ("reducer_monte_carlo", {"eccentricity_mm": 1.7}, "parameters.eccentricity_mm"),
        ("staggered_assembly", {"eccentricity_mm": 1.7}, "parameters.eccentricity_mm"),
    ],
)
def test_faults_have_a_place(name: str, given: dict[str, Any], place: str) -> None:
    with pytest.raises(InputError) as error:
        computed(name, **given)
    assert [one.place for one in error.value.faults] == [place]


def test_capability_needs_something_that_varies() -> None:
    gears = ("gear_runout_um", "base_pitch_deviation_um", "helix_deviation_um",
             "axis_parallelism_x_um", "axis_parallelism_y_um", "centre_distance_deviation_um",
             "thickness_deviation_upper_um", "thickness_deviation_lower_um")  # fmt: skip
    with pytest.raises(InputError, match="do not vary"):
        computed("reducer_monte_carlo", **dict.fromkeys((*gears, "crank_bearing_um"), 0.0))

"""Each effect against its formula, written out row by row in plain Python."""

import cmath
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tolevo import registry
from tolevo.models.effects.effect import Effect, Measurements, Target
from tolevo.models.effects.measurements import measurements_of, play, target_from
from tolevo.models.gear import RV_40E
from tolevo.models.measurable import Column, Role
from tolevo.section import Output

N = 40
RNG = np.random.default_rng(11)
TABLE = {
    "output_angle_deg": RNG.uniform(-20.0, 380.0, N),
    "torque_Nm": RNG.uniform(-412.0, 412.0, N),
    "output_speed_rpm": RNG.uniform(0.5, 30.0, N),
    "temperature_C": RNG.uniform(12.0, 55.0, N),
    "direction": RNG.choice([-1.0, 1.0], N),
    "time_s": RNG.uniform(0.0, 900.0, N),
}
COLUMNS = (
    Column("output_angle_deg", "deg", "", role=Role.ANGLE),
    Column("torque_Nm", "Nm", "", role=Role.TORQUE),
    Column("output_speed_rpm", "rpm", "", role=Role.SPEED),
    Column("temperature_C", "C", "", role=Role.TEMPERATURE),
    Column("direction", "", "", role=Role.DIRECTION),
    Column("time_s", "s", "", role=Role.TIME),
)
OUTPUT = Output("te_arcsec", "arcsec", "")
Row = dict[str, float]


def bench(name: str, model: str = "rv_transmission") -> tuple[Effect, Measurements, Target]:
    target = replace(target_from(model, (OUTPUT,), COLUMNS, TABLE), gear=RV_40E)
    return registry.load("effects", name)(), measurements_of(COLUMNS, TABLE), target


def added(name: str, values: dict[str, float], model: str = "rv_transmission") -> np.ndarray:
    effect, readings, target = bench(name, model)
    assert {one.name for one in effect.parameters(target)} == set(values)
    return effect.act(readings, values, target).output["te_arcsec"]


def sign(x: float) -> float:
    return math.copysign(1.0, x) if x else 0.0


def orders(*which: int, by_torque: bool = False) -> tuple[dict[str, float], Callable[[Row], float]]:
    unit = "arcsec_per_Nm" if by_torque else "arcsec"
    values: dict[str, float] = {}
    for order in which:
        values |= {f"cos_{order}_{unit}": 0.3 + order, f"sin_{order}_{unit}": 0.2 - order}

    def formula(row: Row) -> float:
        theta = math.radians(row["output_angle_deg"])
        waves = [(0.3 + k) * math.cos(k * theta) + (0.2 - k) * math.sin(k * theta) for k in which]
        return math.fsum(waves) * (row["torque_Nm"] if by_torque else 1.0)

    return values, formula


def resonance(row: Row) -> float:
    """Steady state of x'' + 2 z w x' + w^2 x = w^2 A cos(k theta(t) - phase), theta' = v d."""
    w, z, k = 2.0 * math.pi * 31.0, 0.04, 78.0
    drive = k * row["output_speed_rpm"] * row["direction"] * 2.0 * math.pi / 60.0
    transfer = w**2 / complex(w**2 - drive**2, 2.0 * z * w * drive)
    size, phase = math.hypot(1.5, -0.8), math.atan2(-0.8, 1.5)
    theta = math.radians(row["output_angle_deg"])
    return size * abs(transfer) * math.cos(k * theta - phase + cmath.phase(transfer))


def pulse(row: Row) -> float:
    """A von Mises pulse, half as high at 0.05 of a pitch to either side of its middle."""
    x = 39.0 * math.radians(row["output_angle_deg"]) - math.radians(70.0)
    kappa = math.log(0.5) / (math.cos(2.0 * math.pi * 0.05) - 1.0)
    return -4.0 * math.exp(kappa * math.cos(x)) / math.exp(kappa)


def test_the_ending_pulse_is_as_wide_and_ends() -> None:
    """A raised cosine: half as high at 0.05 of a pitch, nothing from 0.1 of a pitch on."""
    effect, _, target = bench("pitch_defect")
    shares = np.array([0.0, 0.05, -0.05, 0.1, 0.3, 0.5])
    table = {"output_angle_deg": (70.0 + 360.0 * shares) / 39.0}
    readings = measurements_of(COLUMNS[:1], table)
    numbers = {"height_arcsec": 2.0, "position_deg": 70.0, "width": 0.1, "form": 2.0}
    (found,) = effect.act(readings, numbers, target).output.values()
    np.testing.assert_allclose(found, [2.0, 1.0, 1.0, 0.0, 0.0, 0.0], atol=1e-12)
    assert "form" not in effect.missing({}, target)


def tau(row: Row) -> float:
    return row["temperature_C"] - 20.0


CASES: dict[str, tuple[dict[str, float], Callable[[Row], float]]] = {
    "torsional_compliance": ({"compliance_arcsec_per_Nm": 0.07}, lambda row: 0.07 * row["torque_Nm"]),
    "hertz_stiffening": (
        {"at_1_Nm_arcsec": 0.4},
        lambda row: 0.4 * sign(row["torque_Nm"]) * abs(row["torque_Nm"]) ** (2.0 / 3.0),
    ),
    "lost_motion": ({"half_width_arcsec": 2.0}, lambda row: 2.0 * sign(row["torque_Nm"])),
    "bearing_clearance": (
        {"half_width_arcsec": 3.0, "load_Nm": 60.0},
        lambda row: 3.0 * max(-1.0, min(1.0, row["torque_Nm"] / 60.0)),
    ),
    "friction_hysteresis": ({"half_width_arcsec": 1.2}, lambda row: 1.2 * row["direction"]),
    "load_sharing": orders(78, by_torque=True),
    "output_eccentricity": orders(1),
    "pin_circle_runout": orders(39),
    "eccentric_error": orders(40),
    "two_disc_error": orders(78, 80),
    "sun_runout": orders(120, 121),
    "encoder_harmonics": orders(1, 2, 4),
    "pitch_defect": ({"height_arcsec": -4.0, "position_deg": 70.0, "width": 0.1, "form": 1.0}, pulse),
    "structural_resonance": (
        {"cos_arcsec": 1.5, "sin_arcsec": -0.8, "frequency_Hz": 31.0, "damping": 0.04, "order": 78.0},
        resonance,
    ),
    "viscous_friction": ({"rate_arcsec_per_rpm": 0.3}, lambda row: 0.3 * row["output_speed_rpm"] * row["direction"]),
    "windage": ({"rate_arcsec_per_rpm2": 0.02}, lambda row: 0.02 * row["output_speed_rpm"] ** 2 * row["direction"]),
    "read_out_lag": ({"rate_arcsec_per_rpm": 0.3}, lambda row: 0.3 * row["output_speed_rpm"] * row["direction"]),
    "differential_thermal_expansion": ({"rate_arcsec_per_K": -0.2}, lambda row: -0.2 * tau(row) * row["direction"]),
    "thermal_friction": (
        {"half_width_arcsec": 5.0, "decay_per_K": 0.03},
        lambda row: 5.0 * row["direction"] * (math.exp(-0.03 * tau(row)) - 1.0),
    ),
    "drift": ({"rate_arcsec_per_s": 0.01}, lambda row: 0.01 * row["time_s"]),
    "creep": ({"rate_arcsec": 0.8, "begin_s": 30.0}, lambda row: 0.8 * math.log(1.0 + row["time_s"] / 30.0)),
    "wear": ({"rate_arcsec_per_s": 0.01}, lambda row: 0.01 * row["time_s"] * row["direction"]),
    "clock_drift": (
        {"rate_arcsec_per_rpm_s": -0.001},
        lambda row: -0.001 * row["time_s"] * row["output_speed_rpm"] * row["direction"],
    ),
    "gauge_bias": ({"offset_arcsec": -7.0}, lambda row: -7.0),
}


@pytest.mark.parametrize("name", CASES)
def test_formula(name: str) -> None:
    values, formula = CASES[name]
    rows = [{key: float(column[at]) for key, column in TABLE.items()} for at in range(N)]
    # orders above 100 turn many times: the angle's rounding is magnified so often
    np.testing.assert_allclose(added(name, values), [formula(row) for row in rows], rtol=1e-9,
                               atol=1e-9)  # fmt: skip


def stepped(path: np.ndarray, width: float) -> list[float]:
    """The play operator, step by step."""
    at, found = 0.0, []
    for x in path:
        at = max(x - width, min(x + width, at))
        found.append(at)
    return found


@pytest.mark.parametrize("count", [1, 2, 3, 64, 1000])
@pytest.mark.parametrize("width", [0.0, 0.3, 2.0, 50.0])
def test_play_is_that_of_single_steps(count: int, width: float) -> None:
    path = np.cumsum(np.random.default_rng(count).normal(size=count))
    np.testing.assert_allclose(play(path, width), stepped(path, width), rtol=0.0, atol=1e-12)


def test_play_begins_anew() -> None:
    path = np.array([3.0, 1.0, 2.0, -4.0, -3.0])
    starts = np.array([False, False, False, True, False])
    np.testing.assert_array_equal(play(path, 1.0, starts), [2.0, 2.0, 2.0, -3.0, -3.0])


def test_hysteresis_of_a_locked_input_runs_along_time() -> None:
    values = {"compliance_arcsec_per_Nm": 0.5, "friction_Nm": 20.0}
    order = np.argsort(TABLE["time_s"])
    load = TABLE["torque_Nm"][order]
    expected = np.empty(N)
    expected[order] = 0.5 * (np.array(stepped(load, 20.0)) - load)
    found = added("friction_hysteresis", values, "rv_lost_motion")
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_twist_lags_behind_the_torque() -> None:
    """Loading it is below, unloading above: half of the loop's height is c w."""
    table = {"torque_Nm": np.array([0.0, 100.0, 200.0, 100.0, 0.0, -200.0, 0.0])}
    columns = (Column("torque_Nm", "Nm", "", role=Role.TORQUE),)
    target = target_from("rv_lost_motion", (OUTPUT,), columns, table)
    effect = registry.load("effects", "friction_hysteresis")()
    values = {"compliance_arcsec_per_Nm": 0.1, "friction_Nm": 30.0}
    found = effect.act(measurements_of(columns, table), values, target).output["te_arcsec"]
    np.testing.assert_allclose(found, [0.0, -3.0, -3.0, 3.0, 3.0, 3.0, -3.0], atol=1e-12)


def test_play_of_a_million_rows_keeps_to_the_input() -> None:
    path = 400.0 * np.sin(np.linspace(0.0, 2000.0, 1_000_000))
    found = play(path, 25.0)
    assert np.max(np.abs(found - path)) <= 25.0 + 1e-12
    assert found.max() == pytest.approx(375.0, rel=1e-4)


def test_quantisation_reads_in_steps() -> None:
    effect, readings, target = bench("quantisation")
    read = effect.act(readings, {"step_arcsec": 0.25}, target).reading["te_arcsec"]
    np.testing.assert_allclose(read(np.array([0.1, 0.13, -0.4, 7.0])), [0.0, 0.25, -0.5, 7.0])
    assert not effect.act(readings, {"step_arcsec": 0.0}, target).reading


def test_amplitude_and_phase_are_described() -> None:
    effect, readings, target = bench("eccentric_error")
    values = {"cos_40_arcsec": -3.0, "sin_40_arcsec": 4.0}
    told = effect.described(values, target)
    amplitude, unit = told["amplitude_40"]
    assert (amplitude, unit) == (5.0, "arcsec")
    wave = amplitude * np.cos(40.0 * readings[Role.ANGLE] - math.radians(told["phase_40"][0]))
    np.testing.assert_allclose(wave, added("eccentric_error", values), atol=1e-9)


def test_bounds_follow_the_largest_load_of_the_table() -> None:
    effect, _, target = bench("bearing_clearance")
    largest = float(np.abs(TABLE["torque_Nm"]).max())
    bound = effect.parameters(target)[1]
    assert (bound.name, bound.linear) == ("load_Nm", False)
    assert (bound.low, bound.high) == pytest.approx((0.02 * largest, 0.5 * largest))


def test_force_stands_in_for_torque() -> None:
    table = {"pull": np.array([-2.0, 4.0])}
    columns = (Column("pull", "kN", "", role=Role.FORCE),)
    output = (Output("travel", "mm", ""),)
    target = target_from("table", output, columns, table)
    effect = registry.load("effects", "torsional_compliance")()
    assert [one.name for one in effect.parameters(target)] == ["compliance_mm_per_N"]
    found = effect.act(measurements_of(columns, table), {"compliance_mm_per_N": 1e-3}, target)
    np.testing.assert_allclose(found.output["travel"], [-2.0, 4.0])


def test_a_unit_that_does_not_fit_its_role_is_refused() -> None:
    columns = (Column("torque", "mm", "", role=Role.TORQUE),)
    with pytest.raises(ValueError, match=r'"mm" is no unit of a torque \(write Nm\)'):
        target_from("table", (OUTPUT,), columns, {"torque": np.ones(2)})


def test_amplitudes_are_not_negative_where_the_text_says_so() -> None:
    free = {"differential_thermal_expansion", "gauge_bias", "clock_drift", "pitch_defect",
            "read_out_lag"}  # fmt: skip
    for name in CASES:
        effect, _, target = bench(name)
        linear = [one for one in effect.parameters(target) if one.linear]
        for one in linear:
            signed = name in free or one.stem[:3] in {"cos", "sin"}
            assert (one.low == 0.0) != signed, (name, one.name)

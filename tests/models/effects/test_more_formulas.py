"""Effects of real drives against constructions of their own: balances, integrals, simulations."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tolevo import registry
from tolevo.models.effects.effect import Effect, Measurements, Target
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.gear import Gear
from tolevo.models.measurable import Column, Role
from tolevo.section import Output

N = 60
RNG = np.random.default_rng(4)
COLUMNS = (
    Column("load", "kN m", "", role=Role.TORQUE),
    Column("rate", "deg/s", "", role=Role.SPEED),
    Column("way", "", "", role=Role.DIRECTION),
    Column("warmth", "degF", "", role=Role.TEMPERATURE),
    Column("clock", "ms", "", role=Role.TIME),
    Column("shaft", "deg", "", role=Role.ANGLE),
)
TABLE = {
    "load": RNG.uniform(-0.4, 0.4, N),
    "rate": RNG.uniform(0.5, 180.0, N),
    "way": RNG.choice([-1.0, 1.0], N),
    "warmth": RNG.uniform(50.0, 130.0, N),
    "clock": np.arange(N) * 2.0,
    "shaft": RNG.uniform(0.0, 720.0, N),
}
PULL = Output("pull_N", "N", "")


def bench(name: str, output: Output = PULL) -> tuple[Effect, Measurements, Target]:
    target = target_from("table", (output,), COLUMNS, TABLE)
    return registry.load("effects", name)(), measurements_of(COLUMNS, TABLE), target


def added(name: str, **values: float) -> np.ndarray:
    effect, readings, target = bench(name)
    assert {one.name for one in effect.parameters(target)} == set(values)
    return effect.act(readings, values, target).output["pull_N"]


def test_load_friction_is_what_loss_of_power_over_a_closed_cycle_says() -> None:
    """A wedge of friction mu: the force that it takes there less that back is 2 mu N."""
    mu = 0.07
    for load, way, found in zip(TABLE["load"], TABLE["way"], added("load_friction",
                                rate_N_per_Nm=mu), strict=True):  # fmt: skip
        normal = abs(load) * 1e3
        there, back = (mu * normal * d for d in (1.0, -1.0))
        assert there - back == pytest.approx(2.0 * mu * normal)
        assert found == pytest.approx(there if way > 0.0 else back)


def test_stribeck_is_at_its_breakaway_at_rest_and_at_its_level_far_beyond() -> None:
    """Armstrong-Helouvry et al. 1994, equation 4: s at rest, c + (s - c)/e at the speed v_s."""
    effect, _, target = bench("stribeck")
    values = {"level_N": 3.0, "excess_N": 2.0, "speed_rpm": 1.5}
    for speed, expected in ((1e-9, 5.0), (1.5, 3.0 + 2.0 / math.e), (60.0, 3.0)):
        rows = TABLE | {"rate": np.full(N, 6.0 * speed)}  # 1 rpm is 6 deg/s
        found = effect.act(measurements_of(COLUMNS, rows), values, target).output["pull_N"]
        np.testing.assert_allclose(found, expected * TABLE["way"], rtol=1e-6)


def test_stribeck_says_nothing_of_rest_where_all_rows_are_far_from_it() -> None:
    """An excess of 1e-68 of that at rest was fitted, as 4e67 N at rest; a tenth of it is fitted still."""
    effect, _, target = bench("stribeck")
    rows = measurements_of(COLUMNS, TABLE | {"rate": np.full(N, 6.0)})  # 1 rpm
    for speed, factor in ((0.08, 0.0), (1.0 / math.sqrt(math.log(10.0)), 0.1)):
        found = effect.act(rows, {"level_N": 0.0, "excess_N": 2.0, "speed_rpm": speed}, target).output["pull_N"]
        np.testing.assert_allclose(found, 2.0 * factor * TABLE["way"])


def test_directional_offset_is_mean_and_half_difference() -> None:
    """What a zero and friction would say: (a - b)/2 of a zero, (a + b)/2 along the direction."""
    a, b = 4.0, 1.5
    np.testing.assert_allclose(
        added("directional_offset", forward_N=a, backward_N=b), 0.5 * (a - b) + 0.5 * (a + b) * TABLE["way"]
    )


def test_directional_offset_is_no_effect_where_the_zero_is_free() -> None:
    effect, _, target = bench("directional_offset", Output("te", "arcsec", ""))
    assert not effect.applies(target)
    assert "friction_hysteresis" in effect.left_out(target)


def test_load_viscous_is_the_mixed_derivative_of_what_it_adds() -> None:
    """d^2 y/(dT dv) is a where load and motion agree in sign with b d added, by differences."""
    a, b, step = 0.002, 0.005, 1e-3
    effect, _, target = bench("load_viscous")
    values = {"signed_N_per_Nm_rpm": a, "drag_N_per_Nm_rpm": b}

    def at(more_load: float, more_speed: float) -> np.ndarray:
        rows = TABLE | {"load": TABLE["load"] + 1e-3 * more_load,
                        "rate": TABLE["rate"] + 6.0 * more_speed}  # fmt: skip
        return effect.act(measurements_of(COLUMNS, rows), values, target).output["pull_N"]

    mixed = (at(step, step) - at(-step, step) - at(step, -step) + at(-step, -step)) / (4 * step**2)
    np.testing.assert_allclose(mixed, a + b * np.sign(TABLE["load"]) * TABLE["way"], rtol=1e-5)


def test_thermal_zero_counts_from_20_degrees() -> None:
    celsius = (TABLE["warmth"] - 32.0) / 1.8
    np.testing.assert_allclose(added("thermal_zero", rate_N_per_K=0.3), 0.3 * (celsius - 20.0))


def test_gear_order_is_the_projection_of_a_wave_on_its_order() -> None:
    effect, readings, target = bench("gear_order")
    wave = 2.0 * np.cos(17.0 * np.radians(TABLE["shaft"]) - 0.7)
    values = {"cos_N": 2.0 * math.cos(0.7), "sin_N": 2.0 * math.sin(0.7), "order": 17.0}
    np.testing.assert_allclose(effect.act(readings, values, target).output["pull_N"], wave)
    told = effect.described(values, target)
    assert [unit for _, unit in told.values()] == ["N", "deg"]
    assert told["amplitude"][0] == pytest.approx(2.0)
    assert told["phase"][0] == pytest.approx(math.degrees(0.7))


def test_orders_of_a_declared_gear_are_those_without_a_name() -> None:
    effect, _, target = bench("gear_order")
    (number,) = (one for one in effect.parameters(target) if not one.linear)
    assert 45.0 in number.choices and 4.0 not in number.choices
    declared = replace(target, gear=Gear("declared", {"pin passing": 45.0, "idler": 7.5}))
    (number,) = (one for one in effect.parameters(declared) if not one.linear)
    assert number.choices == (7.5,)
    runout = registry.load("effects", "pin_circle_runout")()
    assert [one.name for one in runout.parameters(declared)] == ["cos_45_N", "sin_45_N"]
    assert not runout.applies(target)
    assert runout.left_out(target) == "no [gear] states the orders"


LATE = 0.0031
"""[s] One and a half steps of the clock."""


def recorded(name: str, y: np.ndarray, late: float, **more: np.ndarray) -> np.ndarray:
    table = TABLE | more
    target = target_from("table", (PULL,), COLUMNS, table)
    effect = registry.load("effects", name)()
    values = {"delay_s": late}
    action = effect.act(measurements_of(COLUMNS, table), values, target)
    return np.asarray(action.reading["pull_N"](y))


def test_delay_of_a_slow_wave_is_a_shift_of_its_phase() -> None:
    """Error of straight lines between rows: (w dt)^2/8 of the amplitude, here 5e-4."""
    t, w = TABLE["clock"] * 1e-3, 2.0 * math.pi * 5.0
    for late in (LATE, -LATE):
        found = recorded("delay", np.sin(w * t), late)
        inside = (t > LATE) & (t < t[-1] - LATE)
        np.testing.assert_allclose(found[inside], np.sin(w * (t - late))[inside], atol=6e-4)


def test_a_small_delay_is_the_derivative() -> None:
    t = TABLE["clock"] * 1e-3
    y = 3.0 * t  # a ramp, for which it is exact
    np.testing.assert_allclose((recorded("delay", y, 1e-4) - y)[1:], -3.0 * 1e-4, rtol=1e-9)


@pytest.mark.parametrize("steps", [0.4, 1.5, 2.4, -1.3])
def test_friction_that_is_late_jumps_when_the_speed_passed_zero(steps: float) -> None:
    """Coulomb and viscous friction of a drive to and fro, against the force of a moment before."""
    t = np.arange(N) * 2e-3
    late, w = 2e-3 * steps, 2.0 * math.pi * 20.0

    def speed(at: np.ndarray) -> np.ndarray:
        return np.asarray(90.0 * np.sin(w * at + 0.3))

    def force(at: np.ndarray) -> np.ndarray:
        return np.asarray(20.0 * np.sign(speed(at)) + 0.05 * speed(at))

    found = recorded("delay", force(t), late, rate=np.abs(speed(t)), way=np.sign(speed(t)))
    inside = (t > 4 * abs(late)) & (t < t[-1] - 4 * abs(late))
    # straight lines bend the speed by (w dt)^2/8 of 90 deg/s, and its zero by 0.01 of a step
    assert np.abs(found - force(t - late))[inside].max() < 0.1


def test_an_interrupted_record_begins_anew() -> None:
    clock = np.r_[TABLE["clock"][:30], TABLE["clock"][:30]]  # a clock per session
    y = np.r_[np.full(30, 5.0), np.linspace(1.0, 2.0, 30)]
    session = np.repeat(["b", "a"], 30)
    found = recorded("delay", y, LATE, clock=clock, session=session)
    assert found[30] == 1.0  # not of the session before
    assert found[29] == 5.0


def test_a_delay_is_not_looked_for_between_rows_without_an_order() -> None:
    effect, _, target = bench("delay")
    assert effect.shown({"pull_N": RNG.normal(size=N)}, target) is None
    assert effect.shown({"pull_N": np.sin(0.1 * np.arange(N))}, target) == {}


@pytest.mark.parametrize("name", ["read_out_lag", "clock_drift", "torsional_compliance", "wear"])
def test_what_moves_with_the_shaft_does_not_act_on_a_force(name: str) -> None:
    effect, _, target = bench(name)
    assert not effect.applies(target)
    assert effect.left_out(target) == "acts on an output that is an angle or a length"
    assert effect.applies(replace(target, outputs=(Output("te", "arcsec", ""),)))


def test_a_lag_may_have_either_sign() -> None:
    effect, _, target = bench("read_out_lag", Output("shaft_deg", "deg", ""))
    (number,) = effect.parameters(target)
    assert number.low == -math.inf and number.high == math.inf


def test_a_speed_with_a_sign_is_its_magnitude_and_a_direction() -> None:
    """Viscous friction of a shaft at -10 rpm holds it back, with or without a column of its own."""
    columns = tuple(one for one in COLUMNS if one.role is not Role.DIRECTION)
    signed = TABLE | {"rate": TABLE["rate"] * TABLE["way"]}
    for used in (columns, COLUMNS):
        target = target_from("table", (PULL,), used, signed)
        effect = registry.load("effects", "viscous_friction")()
        assert effect.applies(target)
        found = effect.act(measurements_of(used, signed), {"rate_N_per_rpm": 0.5}, target)
        np.testing.assert_allclose(found.output["pull_N"], 0.5 * signed["rate"] / 6.0)


def test_a_linear_axis_has_newtons_per_metre_and_second() -> None:
    columns = (Column("v", "mm/s", "", role=Role.SPEED), Column("f", "N", "", role=Role.FORCE),
               Column("x", "mm", "", role=Role.ANGLE))  # fmt: skip
    table = {"v": np.array([-20.0, 20.0]), "f": np.array([5.0, 7.0]), "x": np.array([0.0, 9.0])}
    target = target_from("table", (Output("e", "um", ""),), columns, table)
    found = {
        name: registry.load("effects", name)().parameters(target)[0].name
        for name in ("viscous_friction", "torsional_compliance", "load_viscous", "read_out_lag")
    }
    assert found == {
        "viscous_friction": "rate_um_per_m_per_s",
        "torsional_compliance": "compliance_um_per_N",
        "load_viscous": "signed_um_per_N_m_per_s",
        "read_out_lag": "rate_um_per_m_per_s",
    }
    assert registry.load("effects", "gear_order")().left_out(target) == ("the angle is not that of a rotating output")


def test_a_delay_is_looked_for_beneath_the_noise_of_a_channel() -> None:
    """Noise of half the channel's size; without an order, and in noise that wanders, it is not."""
    effect, _, target = bench("delay")
    rng = np.random.default_rng(5)
    at = np.arange(400)
    wave, noise = np.sin(0.1 * at), rng.normal(size=400)
    assert effect.shown({"pull_N": wave + noise}, target) == {}
    assert effect.shown({"pull_N": rng.permutation(wave) + noise}, target) is None
    wandering = np.zeros(400)
    for k in range(1, 400):
        wandering[k] = 0.7 * wandering[k - 1] + noise[k]
    assert effect.shown({"pull_N": wandering}, target) is None

"""Effects with memory against solutions of their own: closed forms, an integrator, a count of jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tolevo import registry
from tolevo.models.effects.effect import Effect, Target
from tolevo.models.effects.instrument import Delay
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.effects.unresolved import Term
from tolevo.models.measurable import Column, Role
from tolevo.section import Output
from tolevo.testing import EffectContract

N = 1501
COLUMNS = (
    Column("x_mm", "mm", "", True, role=Role.ANGLE),
    Column("speed_mm_s", "mm/s", "", True, role=Role.SPEED),
    Column("force_N", "N", "", True, role=Role.FORCE),
    Column("time_s", "s", "", False, role=Role.TIME),
)
FRICTION, DEFLECTION = Output("friction_N", "N", ""), Output("error_um", "um", "")
NAMES = [name for name in registry.names("effects") if registry.load("effects", name).family == "memory"]


def motion(n: int = N) -> dict[str, NDArray[np.float64]]:
    """A table that goes to and fro by 30 mm, under a load that follows another rhythm."""
    t = np.linspace(0.0, 20.0, n)
    speed = 15.0 * np.cos(t) + 18.0 * np.cos(3.0 * t)
    return {
        "x_mm": 15.0 * np.sin(t) + 6.0 * np.sin(3.0 * t),
        "speed_mm_s": speed,
        "force_N": 100.0 * np.sin(0.7 * t),
        "time_s": t,
    }


def output_of(effect: type[Effect]) -> Output:
    return FRICTION if "force" in effect.dimensions else DEFLECTION


def acted(name: str, values: dict[str, float], table: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """What the effect of that name adds (n,)."""
    effect = registry.load("effects", name)()
    output = output_of(type(effect))
    target = target_from("table", (output,), COLUMNS, table)
    target = replace(target, reversing=frozenset(target.paths))  # one motion of a longer record
    assert effect.applies(target)
    return np.asarray(effect.act(measurements_of(target.columns, table), values, target).output[output.name])


@pytest.mark.parametrize("name", NAMES)
class TestEveryEffectWithMemory(EffectContract):
    has_path = True
    rows = 301

    @pytest.fixture(autouse=True)
    def _named(self, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(type(self), "effect_type", registry.load("effects", name), False)

    def columns(self) -> tuple[Column, ...]:
        return COLUMNS

    def table(self) -> dict[str, np.ndarray]:
        return dict(motion(self.rows))

    def target(self, table: dict[str, np.ndarray] | None) -> Target:
        return target_from("table", (output_of(self.effect_type),), self.columns(), table)


def test_dahl_follows_a_reversal_as_an_exponential() -> None:
    table = motion()
    found = acted("dahl_friction", {"level_N": 3.0, "length_mm": 2.0, "length_m": 0.002}, table)
    x, steps = table["x_mm"], np.diff(table["x_mm"])
    turns = np.flatnonzero(steps[1:] * steps[:-1] < 0.0) + 1
    first, second = turns[0], turns[1]
    travel = np.abs(x[first : second + 1] - x[first])
    way = np.sign(steps[first])
    expected = way * 3.0 + (found[first] - way * 3.0) * np.exp(-travel / 2.0)
    np.testing.assert_allclose(found[first : second + 1], expected, atol=1e-9)


def test_lugre_in_steady_motion_is_the_curve_of_stribeck() -> None:
    t = np.linspace(0.0, 20.0, N)
    speed = np.where(t < 10.0, 2.0, 20.0)
    table = motion() | {"x_mm": np.r_[0.0, np.cumsum(speed[1:] * np.diff(t))], "speed_mm_s": speed}
    values = {"level_N": 4.0, "length_m": 0.0005, "excess_share": 0.8, "speed_m_per_s": 0.005}
    found = acted("lugre_friction", values, table)
    slow, fast = found[(t > 8.0) & (t < 10.0)], found[t > 15.0]
    np.testing.assert_allclose(slow, 4.0 * (1.0 + 0.8 * np.exp(-((2.0 / 5.0) ** 2))), rtol=1e-6)
    np.testing.assert_allclose(fast, 4.0 * (1.0 + 0.8 * np.exp(-((20.0 / 5.0) ** 2))), rtol=1e-6)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_bouc_wen_is_that_of_an_integrator(exponent: float) -> None:
    table, length, share = motion(), 20.0, 0.7
    values = {"amplitude_um": 1.0, "length_N": length, "share": share, "exponent": exponent}
    found = acted("bouc_wen_hysteresis", values, table)

    def slope(time: float, z: NDArray[np.float64]) -> NDArray[np.float64]:
        rate = 70.0 * np.cos(0.7 * time)
        return np.asarray(rate / length * (1.0 - (share * np.sign(rate * z) + 1.0 - share) * np.abs(z) ** exponent))

    exact = solve_ivp(slope, (0.0, 20.0), [0.0], t_eval=table["time_s"], rtol=1e-8, atol=1e-9, max_step=0.01).y[0]
    np.testing.assert_allclose(found, exact, atol=5e-3)


def test_bouc_wen_opposes_the_motion_where_it_is_a_force() -> None:
    """A deflection may follow its load with either sign, friction is never negative."""
    effect = registry.load("effects", "bouc_wen_hysteresis")()
    for output, low in ((FRICTION, 0.0), (DEFLECTION, -np.inf)):
        first, *_ = effect.parameters(target_from("table", (output,), COLUMNS, motion()))
        assert first.name.startswith("amplitude") and first.low == low


def test_bouc_wen_with_the_share_of_the_sense_alone_is_dahl() -> None:
    table = motion()
    z = acted("bouc_wen_hysteresis", {"amplitude_um": 1.0, "length_N": 30.0, "share": 1.0, "exponent": 1.0}, table)
    steps = np.diff(table["force_N"])
    turn = int(np.flatnonzero(steps[1:] * steps[:-1] < 0.0)[0]) + 1
    rows = slice(turn, turn + 100)
    travel, way = np.abs(table["force_N"][rows] - table["force_N"][turn]), np.sign(steps[turn])
    np.testing.assert_allclose(z[rows], way + (z[turn] - way) * np.exp(-travel / 30.0), atol=2e-3)


def test_creep_after_a_step_of_the_load_is_an_exponential() -> None:
    t = np.linspace(0.0, 20.0, N)
    table = motion() | {"force_N": np.where((t >= 2.0) & (t < 12.0), 50.0, 0.0)}
    fast, slow = {"creep_um_per_N": 0.2}, {"slow_creep_um_per_N": 0.2, "fast_creep_um_per_N": 0.1}
    on = int(np.argmax(t >= 2.0))
    held, gone = (t >= 2.0) & (t < 12.0), t >= 12.0 + t[1]
    since = t - 0.5 * (t[on] + t[on - 1])
    one = acted("load_creep", {**fast, "time_s": 1.5}, table)
    np.testing.assert_allclose(one[held], 10.0 * -np.expm1(-since[held] / 1.5), atol=1e-3)
    np.testing.assert_allclose(one[gone], one[gone][0] * np.exp(-(t[gone] - t[gone][0]) / 1.5), rtol=1e-9)
    two = acted("double_load_creep", {**slow, "fast_time_s": 0.3, "slow_time_s": 4.0}, table)
    expected = 5.0 * -np.expm1(-since[held] / 0.3) + 10.0 * -np.expm1(-since[held] / 4.0)
    np.testing.assert_allclose(two[held], expected, atol=5e-3)


def test_a_table_that_sticks_jumps_by_its_wind_up() -> None:
    t = np.linspace(0.0, 20.0, N)
    drive = np.where(t < 10.0, t, 20.0 - t)
    values = {"half_width_um": 1.0, "play_m": 5e-4, "breakaway_m": 1e-3}
    off = acted("stick_slip_backlash", values, motion() | {"x_mm": drive}) * 0.5
    place = drive + off
    jumps = np.abs(np.diff(place))
    assert np.count_nonzero(jumps > 1e-9) == pytest.approx(2 * 8, abs=1)  # 8.5 mm each way, by 1 mm
    np.testing.assert_allclose(jumps[jumps > 1e-9], 1.0, atol=2.0 * float(t[1]))
    assert np.abs(off).max() <= 1.5 + 1e-9


def test_a_dead_zone_with_friction_is_crossed_late() -> None:
    table = motion()
    values = {"half_width_um": 2.0, "load_N": 20.0, "friction_N": 10.0}
    found, load = acted("dead_zone_with_friction", values, table), table["force_N"]
    rising = np.gradient(load) > 0.0
    later = table["time_s"] > 3.0
    np.testing.assert_allclose(found[later & rising & (load > 31.0)], 2.0)
    crossing = later & rising & (load > -80.0) & (load < 29.0)
    np.testing.assert_allclose(found[crossing], 2.0 * np.clip((load[crossing] - 10.0) / 20.0, -1.0, 1.0), atol=1e-9)


def test_travel_follows_from_speed_and_time() -> None:
    table = motion(6001)
    with_angle = acted("dahl_friction", {"level_N": 1.0, "length_m": 0.002}, table)
    columns = tuple(column for column in COLUMNS if column.role is not Role.ANGLE)
    effect = registry.load("effects", "dahl_friction")()
    table["speed_mm_s"] = np.gradient(table["x_mm"], table["time_s"])
    target = target_from("table", (FRICTION,), columns, table)
    action = effect.act(measurements_of(columns, table), {"level_N": 1.0, "length_m": 0.002}, target)
    np.testing.assert_allclose(action.output["friction_N"], with_angle, atol=0.02)


@pytest.mark.parametrize("name", NAMES)
def test_rows_in_disorder_are_no_path(name: str) -> None:
    rng = np.random.default_rng(3)
    table = {column: rng.permutation(values) for column, values in motion().items() if column != "time_s"}
    effect = registry.load("effects", name)()
    columns = COLUMNS[:-1]
    target = target_from("table", (output_of(type(effect)),), columns, table)
    assert not effect.applies(target)
    assert "path" in effect.left_out(target) or "time" in effect.left_out(target)


def test_each_session_begins_at_rest() -> None:
    table = motion()
    half = N // 2
    both = acted("dahl_friction", {"level_N": 1.0, "length_m": 0.002}, table)
    sessions = np.repeat([1, 2], [half, N - half])
    apart = acted("dahl_friction", {"level_N": 1.0, "length_m": 0.002}, table | {"session": sessions})
    np.testing.assert_array_equal(apart[:half], both[:half])
    assert apart[half] == 0.0


def test_plays_follow_a_loop_computed_by_hand() -> None:
    """Plays of half-widths 1 and 3 along 0, 4, 2, -4, 0: outputs 0, 3, 3, -3, -1 and 0, 1, 1, -1, -1."""
    x = np.array([0.0, 4.0, 2.0, -4.0, 0.0])
    behind = np.array([[0.0, -1.0, 1.0, 1.0, -1.0], [0.0, -3.0, -1.0, 3.0, -1.0]]).T
    columns = (Column("u", "V", "", True, role=Role.INPUT),)
    rows = measurements_of(columns, {"u": 20.0 + 2.0 * x})
    term = Term("error_um", "u", "plays", zero=20.0, scale=2.0, radii=(1.0, 3.0))
    np.testing.assert_allclose(term.columns(rows), behind)
    turned = Term("error_um", "u", "plays", zero=20.0, scale=-2.0, radii=(1.0, 3.0))
    np.testing.assert_allclose(turned.columns(rows), -behind)


def test_plays_keep_the_order_of_time_and_begin_each_session_at_rest() -> None:
    table, half = motion(), N // 2
    columns, term = COLUMNS, Term("error_um", "force_N", "plays", radii=(7.0, 30.0))
    whole = term.columns(measurements_of(columns, table))
    disorder = np.random.default_rng(2).permutation(N)
    shuffled = {name: values[disorder] for name, values in table.items()}
    np.testing.assert_allclose(term.columns(measurements_of(columns, shuffled)), whole[disorder])
    sessions = table | {"session": np.repeat([1, 2], [half, N - half])}
    apart = term.columns(measurements_of(columns, sessions))
    np.testing.assert_array_equal(apart[:half], whole[:half])
    second = {name: values[half:] for name, values in table.items()}
    np.testing.assert_allclose(apart[half:], term.columns(measurements_of(columns, second)))


@pytest.mark.parametrize(("driven", "shown"), [(False, False), (True, True)])
def test_a_channel_that_moves_in_jumps_shows_no_delay(driven: bool, shown: bool) -> None:
    """What comes a part of a row late after a jump may be a memory; with a direction it is known where it may jump."""
    roles = [Role.TIME, *([Role.SPEED, Role.DIRECTION] if driven else [])]
    columns = tuple(Column(str(role), "", "", role=role) for role in roles)
    target = Target("table", (Output("y", "N", ""),), columns, pace=1.0)
    jumps = np.repeat(np.random.default_rng(1).uniform(-1.0, 1.0, 12), 50)
    assert (Delay().shown({"y": jumps}, target) is not None) == shown
    wave = np.sin(np.linspace(0.0, 20.0, 600))
    assert Delay().shown({"y": wave}, target) is not None

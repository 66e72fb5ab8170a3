"""friction_hysteresis in `model = "table"`: along the path of a locked input, else by direction."""

import numpy as np
import pytest

from tolevo import registry
from tolevo.models.effects.effect import Effect, Measurements, Target
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.measurable import Column, Role
from tolevo.section import Output

COLUMNS = (
    Column("T", "Nm", "", role=Role.TORQUE),
    Column("d", "", "", role=Role.DIRECTION),
    Column("v", "rpm", "", role=Role.SPEED),
    Column("a", "deg", "", role=Role.ANGLE),
    Column("t", "s", "", role=Role.TIME),
    Column("unit", "", "", text=True, role=Role.UNIT),
)
N = 240
Table = dict[str, np.ndarray]


def friction() -> Effect:
    found: Effect = registry.load("effects", "friction_hysteresis")()
    return found


def of(table: Table, model: str = "table") -> tuple[Measurements, Target]:
    columns = tuple(one for one in COLUMNS if one.name in table)
    return measurements_of(columns, table), target_from(model, (Output("y", "arcsec", ""),), columns,
                                                    table)  # fmt: skip


def cycles() -> Table:
    """Three cycles of torque, and which way it goes."""
    phase = np.linspace(0.0, 6.0 * np.pi, N)
    return {"T": 100.0 * np.sin(phase), "d": np.where(np.cos(phase) < 0.0, -1.0, 1.0)}


def swept() -> Table:
    """A unit that turns on and on under a torque that is swept, then back."""
    return cycles() | {"d": np.repeat([1.0, -1.0], N // 2), "v": np.full(N, 10.0)}


def drawn() -> Table:
    rng = np.random.default_rng(2)
    return {"T": rng.uniform(-100.0, 100.0, N), "d": rng.choice([-1.0, 1.0], N)}


def names(table: Table, model: str = "table") -> set[str]:
    return {one.name for one in friction().parameters(of(table, model)[1])}


LOOP, MOVING = {"compliance_arcsec_per_Nm", "friction_Nm"}, {"half_width_arcsec"}


@pytest.mark.parametrize("more", [
    {}, {"v": np.zeros(N)}, {"a": np.full(N, 70.0)}, {"a": np.repeat([0.0, 90.0], N // 2)},
    {"unit": np.repeat(["one", "other"], N // 2)},
], ids=["torque", "no speed", "angle held", "two angles", "two units"])  # fmt: skip
def test_locked_input_takes_the_path(more: Table) -> None:
    assert names(cycles() | more) == LOOP


def test_rows_that_are_not_in_order_are_put_in_order() -> None:
    mixed = np.random.default_rng(1).permutation(N)
    table = cycles() | {"t": np.arange(N, dtype=float)}
    assert names({name: one[mixed] for name, one in table.items()}) == LOOP
    table.pop("t")
    assert names({name: one[mixed] for name, one in table.items()}) == MOVING


OTHERS = {
    "random": drawn(),
    "swept": swept(),
    "own way": swept() | {"v": np.zeros(N)},
    "turns": cycles() | {"v": np.full(N, 3.0)},
    "swings": cycles() | {"a": 90.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, N))},
    "no torque": {"d": cycles()["d"]},
    "one way": drawn() | {"d": np.ones(N)},
    "against": cycles() | {"d": -cycles()["d"]},
}


@pytest.mark.parametrize("table", OTHERS.values(), ids=OTHERS)
def test_all_else_takes_the_direction(table: Table) -> None:
    assert names(table) == MOVING


def test_torque_that_is_drawn_anew_at_each_row_is_no_path() -> None:
    """Even where the direction is that of its steps."""
    table = drawn()
    steps = np.sign(np.diff(table["T"], prepend=0.0))
    assert names(table | {"d": np.where(steps == 0.0, 1.0, steps)}) == MOVING


@pytest.mark.parametrize("table", [cycles(), drawn()], ids=["cycles", "drawn"])
def test_one_meaning_in_each_model(table: Table) -> None:
    assert names(table, "rv_transmission") == MOVING
    assert names(table, "rv_lost_motion") == LOOP


def test_numbers_that_are_given_choose_the_form() -> None:
    """By hand: up to 100 N m the twist lags by c w, back by the same; the other form is a d."""
    table = {"T": np.array([0.0, 50.0, 100.0, 50.0, 0.0]), "d": np.array([1.0, 1, -1, -1, 1])}
    loop = {"compliance_arcsec_per_Nm": 0.2, "friction_Nm": 10.0}
    for more in ({}, {"v": np.full(5, 8.0)}):  # what the readings say does not matter
        readings, target = of(table | more)
        found = friction().act(readings, loop, target).output["y"]
        np.testing.assert_allclose(found, [0.0, -2.0, -2.0, 2.0, 2.0], atol=1e-12)
        found = friction().act(readings, {"half_width_arcsec": 3.0}, target).output["y"]
        np.testing.assert_array_equal(found, 3.0 * table["d"])


def test_half_of_a_loop_is_refused() -> None:
    target = target_from("table", (Output("y", "arcsec", ""),), COLUMNS)
    effect, given = friction(), {"compliance_arcsec_per_Nm": 1.0}
    assert {one.name for one in effect.parameters(target)} == LOOP | MOVING
    assert effect.missing(given, target) == ("friction_Nm",)
    assert effect.missing({"friction_Nm": 1.0}, target) == ("compliance_arcsec_per_Nm",)
    assert effect.missing({**given, "friction_Nm": 1.0}, target) == ()
    assert effect.missing({"half_width_arcsec": 1.0}, target) == ()

"""The texts of an effect of one's own: each has the form of its term, evaluated by its own means."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from tolevo.models.effects.effect import Effect
from tolevo.models.effects.measurements import measurements_of, target_from
from tolevo.models.effects.unresolved import Offer, Term
from tolevo.models.expressions import Formula
from tolevo.models.measurable import Column, Role
from tolevo.section import Output

COLUMNS = (
    Column("angle_deg", "deg", "", role=Role.ANGLE),
    Column("speed_rpm", "rpm", "", role=Role.SPEED),
    Column("torque_Nm", "Nm", "", role=Role.TORQUE),
    Column("temp_C", "C", "", role=Role.TEMPERATURE),
    Column("time_s", "s", "", role=Role.TIME),
)
N = 400
RNG = np.random.default_rng(4)
TIME = np.linspace(0.0, 60.0, N)
TABLE = {
    "angle_deg": 200.0 * np.sin(0.7 * TIME),
    "speed_rpm": 140.0 / 6.0 * np.cos(0.7 * TIME) + 0.01,
    "torque_Nm": RNG.uniform(-50.0, 50.0, N),
    "temp_C": RNG.uniform(15.0, 45.0, N),
    "time_s": TIME,
}
KNOTS = (-50.0, -20.0, 5.0, 30.0, 50.0)
TERMS = [
    Term("te", "speed_rpm", "constant", turns=True),
    Term("te", "torque_Nm", "spline", knots=KNOTS, turns=True),
    Term("te", "torque_Nm", "curve", knots=KNOTS, heights=(1.0, -0.3, 0.2, 0.4, -1.0)),
    Term("te", "torque_Nm", "power", exponent=1.5, signed=True, scale=50.0),
    Term("te", "torque_Nm", "power", exponent=2.0 / 3.0, scale=50.0),
    Term("te", "torque_Nm", "power", exponent=0.5, signed=True, scale=50.0),
    Term("te", "torque_Nm", "power", exponent=3.0, signed=True, scale=50.0, turns=True),
    Term(
        "te", "torque_Nm", "power", times="temp_C", times_zero=20.0, times_scale=25.0, times_exponent=2.0, signed=True
    ),
    Term("te", "time_s", "step", zero=float(TIME[120])),
    Term("te", "time_s", "swing", order=2.5, scale=9.5),
    Term("te", "angle_deg", "wave", order=2.0, times="torque_Nm", times_scale=50.0),
    Term("te", "torque_Nm", "product", zero=1.0, scale=30.0, times="temp_C", times_zero=30.0, times_scale=9.0),
    Term("te", "angle_deg", "plays", scale=-400.0, radii=(0.05, 0.2), turns=False),
]


def effect_of(text: str) -> Effect:
    """The class that the text of a plugin defines."""
    names: dict[str, type] = {}
    exec(text, names)
    (kind,) = [value for name, value in names.items() if name.startswith("TeOf")]
    return kind()  # type: ignore[no-any-return]


@pytest.mark.parametrize("term", TERMS, ids=lambda term: f"{term.shape} {term.variable} {term.exponent:.2g}")
def test_texts_have_the_form_of_the_term(term: Term) -> None:
    target = target_from("table", (Output("te", "arcsec", ""),), COLUMNS, TABLE)
    rows = measurements_of(target.columns, TABLE)
    weights = RNG.uniform(0.5, 1.5, term.count)
    wanted = term.columns(rows) @ weights
    offer = Offer([term], [weights], COLUMNS, "a form")
    text = offer.plugin()
    effect = effect_of(text)
    assert len(text.strip().splitlines()) <= 16 and effect.applies(target)
    found = effect.act(rows, {"size_arcsec": 1.0}, target).output["te"]
    exact = term.shape != "spline"  # the plugin has points of the curve
    np.testing.assert_allclose(found, wanted, atol=(1e-5 if exact else 0.025) * np.abs(wanted).max())
    if term.shape == "plays":
        assert offer.formula() == ""
        return
    (table,) = tomllib.loads(offer.formula())["effect"]
    value = np.broadcast_to(Formula(table["formula"]).value(TABLE | {"a": np.array(2.0)}), N)
    np.testing.assert_allclose(value, 2.0 * wanted, atol=(2e-5 if exact else 0.05) * np.abs(wanted).max())


def test_a_column_with_a_name_that_no_formula_can_have_is_offered_as_a_plugin_alone() -> None:
    columns = (Column("load [N]", "N", "", role=Role.FORCE),)
    term = Term("te", "load [N]", "power", exponent=2.0)
    offer = Offer([term], [np.array([2.0])], columns, "a power")
    assert offer.formula() == ""
    table = {"load [N]": np.linspace(1.0, 3.0, 30)}
    target = target_from("table", (Output("te", "arcsec", ""),), columns, table)
    effect = effect_of(offer.plugin())
    found = effect.act(measurements_of(columns, table), {"size_arcsec": 1.0}, target).output["te"]
    np.testing.assert_allclose(found, 2.0 * table["load [N]"] ** 2)


def test_terms_of_one_output_are_one_effect() -> None:
    terms = [Term("te", "torque_Nm", "power", exponent=2.0), Term("te", "torque_Nm", "constant", turns=True)]
    offer = Offer(terms, [np.array([2.0]), np.array([-3.0])], COLUMNS, "a form")
    (table,) = tomllib.loads(offer.formula())["effect"]
    assert table["name"] == "te_of_torque_Nm"
    assert table["formula"] == "a * (2 * torque_Nm**2 + -3 * max(-1, min(1, 1e+09 * speed_rpm)))"
    rows = measurements_of(COLUMNS, TABLE)
    target = target_from("table", (Output("te", "arcsec", ""),), COLUMNS, TABLE)
    effect = effect_of(offer.plugin())
    found = effect.act(rows, {"size_arcsec": 1.0}, target).output["te"]
    np.testing.assert_allclose(found, 2.0 * TABLE["torque_Nm"] ** 2 - 3.0 * np.sign(TABLE["speed_rpm"]))


def test_the_letter_is_no_column() -> None:
    columns = (Column("a", "", ""), Column("c", "", ""))
    (table,) = tomllib.loads(Offer([Term("te", "c", "power", exponent=2.0)], [np.ones(1)], columns, "").formula())[
        "effect"
    ]
    assert table["formula"] == "b * (1 * c**2)"


def test_levels_of_sessions_are_offered_to_nobody() -> None:
    offer = Offer([Term("te", "session", "levels", labels=("a", "b"))], [np.ones(1)], COLUMNS, "levels")
    assert offer.formula() == offer.plugin() == ""

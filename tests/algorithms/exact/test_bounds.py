"""What a proof may say, by parts whose least costs follow by hand: C = 1 + 1/t, so 1 + 1/L."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import pytest

from tolevo.algorithms.exact.bounds import (
    LIMIT_WIDENING,
    LOOSER,
    Proof,
    proof,
    restrict_form,
    row_limits,
    upper_limit,
    within_reach,
)
from tolevo.errors import ModelError
from tolevo.models.capability.knowledge import Surplus
from tolevo.models.costs import CostCurve, Reciprocal, Table
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way
from tolevo.problems.limits import LIMIT_ROUNDING, Limit
from tolevo.problems.tolerance_problem import ToleranceProblem

UNIFORM = EvenPlateau()
CHEAP, DEAR = Reciprocal(1.0, 1.0), Reciprocal(2.0, 2.0)


def form_of(
    curve: CostCurve = CHEAP, outputs: tuple[str, ...] = ("v",), low: float = 0.1, high: float = 1.0, **more: object
) -> Form:
    """One part whose tolerance is every requirement's value."""
    one = (1.0,) * len(outputs)
    way = Way(curve, low, high, one, (0.0,) * len(outputs))
    nothing = np.zeros(len(outputs))
    form = Form(outputs, (Feature("t", (way,)),), nothing, nothing, "proven by hand")
    return replace(form, **more)  # type: ignore[arg-type]


def upper(name: str, high: float) -> Limit:
    return Limit(name, -np.inf, high, 1.0, "1")


@dataclass
class Plain:
    """As much of a problem as a proof looks at."""

    own: Form | None
    objectives: tuple[str, ...] = ("cost", "v")
    limits: tuple[Limit, ...] = ()
    why: str = ""
    priced: str = "cost"
    held_costs: tuple[str, ...] = ()
    cost_names: tuple[str, ...] = ("cost",)

    def form(self) -> Form | None:
        return self.own

    priced_form = form

    def unproven(self) -> str:
        return self.why

    cost_bound = ToleranceProblem.cost_bound
    stand_in_limit = ToleranceProblem.stand_in_limit
    form_values = ToleranceProblem.form_values
    form_columns = ToleranceProblem.form_columns


def proven(problem: Plain, /, **values: list[float]) -> Proof:
    arrays = {name: np.array(own) for name, own in values.items()}
    return proof(cast("ToleranceProblem", problem), arrays, len(arrays["cost"]))


def test_a_bound_is_the_least_cost_at_the_points_own_value() -> None:
    found = proven(Plain(form_of()), cost=[9.0, 3.5, 2.0], v=[0.2, 0.5, 1.0])
    np.testing.assert_allclose(found.bound, [6.0, 3.0, 2.0], rtol=1e-10)
    np.testing.assert_allclose(found.gap_percent(np.array([9.0, 3.5, 2.0])), [50.0, 50.0 / 3.0, 0],
                               rtol=1e-9, atol=1e-8)  # fmt: skip
    assert found.statement == "proven by hand"


def test_gaps_are_none_where_they_have_no_unit_and_none_below_the_bound() -> None:
    gaps = Proof(np.array([0.0, 2.0, -2.0]), "").gap_percent(np.array([1.0, 1.0, -1.0]))
    np.testing.assert_array_equal(gaps, [np.nan, 0.0, 50.0])


def test_a_limit_of_the_problem_counts_where_it_is_tighter() -> None:
    limits = (upper("v", 0.25),)
    found = proven(Plain(form_of(), limits=limits), cost=[9.0, 9.0], v=[0.2, 0.5])
    room = 1.0 + LIMIT_WIDENING * LIMIT_ROUNDING
    np.testing.assert_allclose(found.bound, [6.0, 1.0 + 4.0 / room], rtol=1e-10)
    alone = Plain(form_of(), ("cost",), limits)
    np.testing.assert_allclose(proven(alone, cost=[9.0], v=[0.2]).bound, [1.0 + 4.0 / room], rtol=1e-10)


def test_a_point_below_its_bound_is_no_proof_but_an_error() -> None:
    """At v = 0.5 nothing costs less than 3: rounding passes, anything more does not."""
    close = proven(Plain(form_of()), cost=[3.0 * (1.0 - 5e-10)], v=[0.5])
    assert close.bound[0] == 3.0 * (1.0 - 5e-10)
    proven(Plain(form_of()), cost=[6.0 * (1.0 - 8e-10)], v=[0.2])
    with pytest.raises(ModelError, match=r"lies above a cost of 2\.9"):
        proven(Plain(form_of()), cost=[9.0, 2.9, 9.0], v=[0.2, 0.5, 1.0])
    with pytest.raises(ModelError, match="lies above"):
        proven(Plain(form_of()), cost=[3.0 * (1.0 - 5e-9)], v=[0.5])


def test_the_rounding_of_a_cost_near_nothing_is_that_of_the_costs_it_is_made_of() -> None:
    """Less a base, a cost of 1e-9 may miss its bound by what rounding leaves of the parts' costs.

    The range of costs is -1 + 1 to -1 + 10 here, so that its lesser end, 0, is no scale: the cost
    alone is; where the range lies at -3 to 6 the lesser size of its ends, 3, is one.
    """
    at = {"v": [1.0]}
    zero = form_of(Reciprocal(0.0, 1.0), base=-1.0)
    with pytest.raises(ModelError, match="lies above"):
        proven(Plain(zero), cost=[-2e-9], **at)
    far = form_of(Reciprocal(0.0, 1.0), base=-4.0)  # -3 at t = 1, and 6 at t = 0.1
    proven(Plain(far), cost=[-3.0 - 2e-9], **at)
    with pytest.raises(ModelError, match="lies above"):
        proven(Plain(far), cost=[-3.0 - 5e-9], **at)
    middle = {"v": [1.0 / 3.9999]}  # the least cost there is -0.0001
    proven(Plain(far), cost=[-1e-4 - 2e-9], **middle)
    with pytest.raises(ModelError, match="lies above"):
        proven(Plain(far), cost=[-1e-4 - 5e-9], **middle)
    low = form_of(Reciprocal(0.0, 1.0), base=-11.0)  # -10 and -1: the lesser size is that of the most
    with pytest.raises(ModelError, match="lies above"):
        proven(Plain(low), cost=[-1.0 - 2e-9], v=[0.1])


def test_an_impossible_cost_is_no_proof_of_an_error() -> None:
    found = proven(Plain(form_of()), cost=[np.inf, 4.0], v=[0.05, 0.5])
    assert found.bound[0] == np.inf
    np.testing.assert_allclose(found.bound[1], 3.0, rtol=1e-10)


def test_what_cannot_be_proven_says_why() -> None:
    at = {"cost": [3.0], "v": [0.5], "w": [1.0]}
    for problem, why in (
        (Plain(form_of(), ("v",)), "cost is not an objective"),
        (Plain(None), "the problem has no convex form"),
        (Plain(form_of(), ("cost", "v", "w")), "no convex form of w is known (there is one of v)"),
        (Plain(form_of(), ("cost", "w"), why="it is sampled"), "of v): it is sampled"),
    ):
        found = proven(problem, **at)
        assert found.statement.startswith("nothing is proven: ")
        assert found.statement.endswith(why)
        assert np.isnan(found.bound).all() and len(found.bound) == 1
    stood = Plain(form_of(outputs=("q",), stands={"q": "w"}), ("cost", "w"))
    found = proven(stood, cost=[9.0], w=[7.0], q=[0.5])
    np.testing.assert_allclose(found.bound, [3.0], rtol=1e-10)


def test_a_requirement_that_stands_for_a_limit_is_kept_at_the_points_own_value() -> None:
    form = form_of(outputs=("q",), stands={"q": "w"})
    asked = Plain(form, ("cost",), (upper("w", 3.0),))
    np.testing.assert_allclose(proven(asked, cost=[9.0], q=[0.5]).bound, [3.0], rtol=1e-10)
    free = Plain(form, ("cost",), ())
    np.testing.assert_allclose(proven(free, cost=[9.0], q=[0.5]).bound, [2.0], rtol=1e-10)


def test_no_points_need_no_proof() -> None:
    found = proven(Plain(form_of()), cost=[], v=[])
    assert found.bound.shape == (0,) and found.statement == "proven by hand"


def test_designs_that_the_form_leaves_out_may_be_cheaper() -> None:
    """Two forms, the other one with a second requirement of its own: the least of both counts."""
    other = form_of(outputs=("w", "v"), high=2.0)
    dear = form_of(DEAR, also=(other,))
    found = proven(Plain(dear), cost=[9.0, 9.0, 9.0], v=[0.5, 0.8, 4.0])
    np.testing.assert_allclose(found.bound, [3.0, 2.25, 1.5], rtol=1e-10)
    held = form_of(DEAR, also=(replace(other, most=(0.4, np.inf)),))
    found = proven(Plain(held), cost=[9.0, 9.0], v=[0.5, 0.3])
    np.testing.assert_allclose(found.bound, [3.5, 13.0 / 3.0], rtol=1e-10)
    cheap = form_of(also=(form_of(DEAR),))
    found = proven(Plain(cheap), cost=[9.0], v=[0.5])
    np.testing.assert_allclose(found.bound, [3.0], rtol=1e-10)
    flat = form_of(Reciprocal(2.5, 0.0), also=(form_of(),))  # 2.5 at once, or 1 + 1/v
    found = proven(Plain(flat), cost=[9.0, 9.0, 9.0], v=[0.2, 0.5, 1.0])
    np.testing.assert_allclose(found.bound, [2.5, 2.5, 2.0], rtol=1e-10)
    wide = form_of(DEAR, also=(form_of(outputs=("w",), most=(0.5,)),))  # 3 whatever v is
    found = proven(Plain(wide), cost=[99.0, 99.0], v=[0.2, 1.0])
    np.testing.assert_allclose(found.bound, [3.0, 3.0], rtol=1e-8)
    partly = form_of(DEAR, low=0.5, also=(form_of(high=0.25),))  # impossible below 0.5; 5 at 0.25
    found = proven(Plain(partly), cost=[99.0, 99.0, 99.0], v=[0.2, 0.45, 1.0])
    np.testing.assert_allclose(found.bound, [6.0, 5.0, 4.0], rtol=1e-10)


def test_limits_are_widened_by_the_room_of_rounding_and_own_values_by_their_last_digits() -> None:
    """At half of the limit 1 + 2/v is 3: a limit has a room of 2e-9, a value one of 1e-11."""
    own = form_of(most=(0.5,))
    found = proven(Plain(own), cost=[9.0], v=[2.0])
    np.testing.assert_allclose(found.bound, [3.0 - 2.0 * LIMIT_WIDENING * LIMIT_ROUNDING], rtol=2e-10)
    assert found.bound[0] < 3.0 - 3e-9
    plain = proven(Plain(form_of()), cost=[9.0], v=[0.5])
    assert 3.0 - 3.0 * LOOSER < plain.bound[0] < 3.0


def test_a_table_that_is_not_convex_is_bounded_below_its_points() -> None:
    """From 0.1 to 1 it falls along 9, 8.5, 2, 1.9: no less than what the table itself costs."""
    bent = form_of(Table((0.1, 0.2, 0.4, 1.0), (9.0, 8.5, 2.0, 1.9)))
    at = np.array([0.1, 0.15, 0.3, 0.4, 0.7, 1.0])
    cost = np.interp(at, (0.1, 0.2, 0.4, 1.0), (9.0, 8.5, 2.0, 1.9))
    found = proven(Plain(bent), cost=cost.tolist(), v=at.tolist())
    np.testing.assert_allclose(found.bound, cost, rtol=1e-9)


def test_limits_that_contradict_each_other_are_out_of_reach() -> None:
    """Half a part is t uniform: the upper 90 % of it is 0.8 t, at least 0.08."""
    piece = ((Piece(1.0, UNIFORM),),)
    form = replace(form_of(outputs=("v", "w")), quantiles=(Quantile(0.9, piece), None))
    form = replace(
        form, features=(Feature("t", (replace(form.features[0].ways[0], linear=(0.0, 1.0),
                                              spread=(1.0, 0.0)),)),)
    )  # fmt: skip
    limits = np.array([[0.0799, 1.0], [0.0801, 1.0], [0.5, 0.09], [0.5, 0.11]])
    assert within_reach(form, limits).tolist() == [False, True, False, True]
    three = Plain(form, ("cost", "v", "w"))
    found = proven(three, cost=[99.0, 99.0], v=[0.0801, 0.5], w=[1.0, 0.11])
    assert np.all(found.bound <= 11.0)
    with pytest.raises(ModelError, match="bound inf lies above a cost"):
        proven(three, cost=[99.0], v=[0.5], w=[0.09])
    assert within_reach(form_of(), np.array([[0.05]])).tolist() == [True]  # roots are not looked at


def test_limits_by_name() -> None:
    limits = (upper("w", 3.0), upper("v", 0.5), Limit("u", 1.0, np.inf, 1.0, "1"))
    problem = cast("ToleranceProblem", Plain(form_of(), limits=limits))
    assert [upper_limit(problem, name) for name in "vwux"] == [0.5, 3.0, np.inf, np.inf]
    form = form_of(outputs=("v", "w", "x"), most=(0.7, 0.2, np.inf))
    # a requirement's own limit, in its own measure, is in place of that of the output: 0.7 of v above its middle
    np.testing.assert_array_equal(row_limits(problem, form), [0.7, 0.2, np.inf])


def test_restricted_keeps_what_belongs_to_a_requirement() -> None:
    way = Way(CHEAP, 0.1, 1.0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))
    plain = replace(way, offset=())
    quantile = Quantile(0.9, ((Piece(1.0, UNIFORM),),))
    form = Form(("a", "b", "c"), (Feature("t", (way, plain), "p", 2),), np.arange(3.0),
                np.arange(3.0) * 10.0, "", most=(1.0, 2.0, 3.0),
                quantiles=(None, quantile, None))  # fmt: skip
    kept = restrict_form(form, np.array([False, True, True]))
    first, second = kept.features[0].ways
    assert (kept.outputs, kept.most, kept.quantiles) == (("b", "c"), (2.0, 3.0), (quantile, None))
    assert (first.linear, first.spread, first.offset) == ((2.0, 3.0), (5.0, 6.0), (8.0, 9.0))
    assert second.offset == () and kept.features[0].count == 2
    assert kept.offset.tolist() == [1.0, 2.0] and kept.constant.tolist() == [10.0, 20.0]
    doubt = cast("Surplus", object())
    doubted = replace(form, surpluses=(None, doubt, None))
    assert restrict_form(doubted, np.array([False, True, True])).surpluses == (doubt, None)
    assert restrict_form(doubted, np.array([True, False, True])).surpluses == ()
    bare = restrict_form(replace(form, most=(), quantiles=()), np.array([True, False, False]))
    assert (bare.outputs, bare.most, bare.quantiles, bare.surpluses) == (("a",), (), (), ())

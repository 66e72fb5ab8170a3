"""The final answer on given columns and readings, where least squares by hand says what it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.commands.gap_toy import PENALTY, N, directions, member, of_names, readings, settling, squares_left
from tolevo.commands.gap.data import GapData
from tolevo.commands.gap.fit import Fit, Member, is_term
from tolevo.commands.gap.library import Candidate
from tolevo.commands.gap.null_model import significant_forms
from tolevo.commands.gap.scan import generic_residual
from tolevo.models.effects.unresolved import FROM_ZERO, LEVELS, Form, Term, Unresolved

SPEED = np.random.default_rng(8).permutation(np.linspace(0.02, 1.0, N))
WARM = np.random.default_rng(9).permutation(np.linspace(0.0, 1.0, N))
DATA = readings(speed=SPEED, temperature=20.0 + WARM)


def power(exponent: float, variable: str = "speed") -> Form:
    return Form("power", variable, order=exponent, shape=FROM_ZERO)


SPLINE = Form("interval", "speed")


def term(own: Term, data: GapData = DATA) -> Member:
    """A term as a member, with all of its columns."""
    effect = Unresolved(own)
    return Member(Candidate(effect, effect.own_parameters(data.target), ()))


def scaled(values: np.ndarray) -> np.ndarray:
    """Without its mean, of length 1."""
    away = values - values.mean()
    return np.asarray(away / np.linalg.norm(away))


def exponents(fit: Fit) -> list[float]:
    effects = [one.candidate.effect for one in fit.members if is_term(one)]
    return [one.term.exponent for one in effects if isinstance(one, Unresolved)]


# ------------------------------------------------------------- growing


def test_an_answer_grows_by_names_and_forms_until_nothing_is_left() -> None:
    """a is not in the fit yet, and a square of the speed has no name."""
    a, b = directions(2).T
    y = 25.0 * a + 20.0 * b + 40.0 * scaled(SPEED**2)
    one = settling([member("a"), member("b")], {"a": a, "b": b}, y, DATA, [power(1.0), power(2.0)])
    found = one.grown(of_names(one, "b"), frozenset())
    assert {*found.names} >= {"a", "b"} and exponents(found) == [2.0]
    assert found.rss == pytest.approx(0.0, abs=1e-9)
    assert one.grown(found, frozenset()) is found
    term_of_it = next(one.name for one in found.members if is_term(one))
    assert exponents(one.grown(of_names(one, "ab"), frozenset({term_of_it}))) == [1.0]


def test_no_more_names_than_are_asked_for() -> None:
    a, b = directions(2).T
    y = 25.0 * a + 20.0 * b
    for most, names in ((1, {"a"}), (2, {"a", "b"})):
        one = settling([member("a"), member("b")], {"a": a, "b": b}, y, DATA, [power(1.0)],
                       effects_at_most=most)  # fmt: skip
        assert {*one.grown(of_names(one, "a"), frozenset()).names} == names


def test_a_name_takes_the_place_of_a_form_that_does_the_same_with_more_numbers() -> None:
    """Of the spline's columns the name needs one; a power of one number it does not displace."""
    y = 40.0 * scaled(SPEED**2)
    one = settling([member("a")], {"a": SPEED**2}, y, DATA, [SPLINE])
    knots = tuple(np.quantile(SPEED, np.linspace(0.0, 1.0, 5)).tolist())
    wide = of_names(one, "", term(Term("te", "speed", "spline", knots=knots)))
    assert squares_left([SPEED**2], y) == pytest.approx(0.0, abs=1e-9)
    assert [fit.names for fit in one._with_effects(wide, set())] == [("a",)]
    assert list(one._with_effects(wide, {"a"})) == []
    narrow = of_names(one, "", term(Term("te", "speed", "power", exponent=2.0)))
    assert narrow.score == pytest.approx(of_names(one, "a").score)
    assert list(one._with_effects(narrow, set())) == []


def test_names_stay_while_others_are_tried() -> None:
    a, b, c = directions(3).T
    near = 0.9 * b + np.sqrt(0.19) * c
    one = settling([member("a"), member("b"), member("n")], {"a": a, "b": b, "n": near},
                   20.0 * a + 30.0 * b, DATA, [power(1.0)])  # fmt: skip
    tried = list(one._with_effects(of_names(one, "an"), set()))
    assert [fit.names for fit in tried] == [("a", "n", "b")]


def test_terms_are_at_most_three_unless_asked() -> None:
    """Steps of the speed, and a line of the temperature that is not in yet."""
    steps = [term(Term("te", "speed", "step", zero=zero)) for zero in (0.2, 0.5, 0.8)]
    y = 40.0 * scaled(WARM) + sum(20.0 * k * (k + 1 + SPEED**k) for k in range(3))
    one = settling([], {}, y, DATA, [power(1.0, "temperature")])
    assert len(list(one._forms(of_names(one, "", *steps[:-1]), set()))) == 1
    assert len(list(one._forms(of_names(one, "", *steps), set()))) == 0
    asked = settling([], {}, y, DATA, [power(1.0, "temperature")], terms_at_most=4)
    assert len(list(asked._forms(of_names(asked, "", *steps), set()))) == 1


def test_the_weakest_is_left_out_first_and_what_is_needed_stays() -> None:
    """10 is needed: a explains 2, b 6 and c 400."""
    a, b, c = directions(3).T
    y = np.sqrt(2.0) * a + np.sqrt(6.0) * b + 20.0 * c
    members = [member(name) for name in "abc"]
    one = settling(members, {"a": a, "b": b, "c": c}, y, DATA, [power(1.0)])
    for order in ("abc", "bac", "cab"):
        barred: set[str] = set()
        less = one._weaker(of_names(one, order), barred)
        assert less is not None and barred == {"a"} and {*less.names} == {"b", "c"}
    assert one.grown(of_names(one, "abc"), frozenset()).names == ("c",)
    assert one._weaker(of_names(one, "c"), set()) is None


# ------------------------------------------------------------- names that are no more than a form


@pytest.mark.parametrize(("more", "believed"), [(3.0, True), (6.0, False)])
def test_a_name_is_disbelieved_from_a_tenth_on(more: float, believed: bool) -> None:
    """What the form does beside the name, more^2, against a tenth of the name's own 15^2 = 22.5."""
    a, other = np.linalg.qr(np.column_stack([np.ones(N), SPEED, SPEED**2]))[0][:, 1:].T
    y = 15.0 * a + more * other
    knots = tuple(np.quantile(SPEED, np.linspace(0.0, 1.0, 5)).tolist())
    one = settling([member("a")], {"a": a}, y, DATA, [SPLINE])
    assert squares_left([other], y) - squares_left([a, other], y) == pytest.approx(225.0)
    assert squares_left([a], y) == pytest.approx(more**2)
    rest = replace(one, trusted=frozenset({"a"}))
    form = term(Term("te", "speed", "power", exponent=1.0, scale=1.0))
    assert one._explained_by_terms(of_names(one, "a", form)) == -1  # nothing beside the name
    mixed = Unresolved(Term("te", "speed", "spline", knots=knots), _beside(a, knots))
    beside = Member(Candidate(mixed, mixed.own_parameters(DATA.target), ()))
    fit = of_names(one, "a", beside)
    assert fit.rss == pytest.approx(0.0, abs=1e-6)
    assert one._explained_by_terms(fit) == (-1 if believed else 0)
    assert rest._explained_by_terms(fit) == -1
    terms = of_names(one, "", beside, form)
    assert one._explained_by_terms(terms) == -1  # terms have no name


def _beside(a: np.ndarray, knots: tuple[float, ...]) -> np.ndarray:
    """A mix of the columns of a spline that are orthogonal to a and a constant."""
    own = Unresolved(Term("te", "speed", "spline", knots=knots)).columns(DATA.measurements)
    q = np.linalg.qr(np.column_stack([np.ones(N), a]))[0]
    _, _, right = np.linalg.svd(q.T @ own)
    return np.asarray(right[2:].T)


# ------------------------------------------------------------- answers that hold


def test_the_first_answer_that_holds_is_taken() -> None:
    """Beside what was accepted b alone predicts worse, and a as well."""
    a, b = directions(2).T
    one = settling([member("a"), member("b")], {"a": a, "b": b}, 30.0 * a, DATA, [power(1.0)])
    best = of_names(one, "a")
    one = replace(one, accepted=[*one.accepted, (best, one.search.tested(best))])
    found = one._first_that_holds([of_names(one, "b"), best], frozenset())
    assert found.names == ("a",)
    assert not one.holds(of_names(one, "b")) and one.holds(best)
    last = one._first_that_holds([of_names(one, "b")], frozenset())  # none: what predicts best
    assert last.names == ("a",)
    barred = one._first_that_holds([of_names(one, "b")], frozenset({"a"}))
    assert "a" not in barred.names


def test_the_form_that_is_added_is_the_one_that_predicts_best() -> None:
    """A name does what the square of the speed does; without it that square is the answer."""
    y = 60.0 * scaled(SPEED**2) + np.random.default_rng(3).normal(size=N)
    forms = [power(1.0), power(1.5), power(2.0), power(3.0), SPLINE]
    one = settling([member("a")], {"a": SPEED**2}, y, DATA, forms)
    best = of_names(one, "a")
    one = replace(one, accepted=[*one.accepted, (best, one.search.tested(best))])
    found = one._first_that_holds([of_names(one, "")], frozenset({"a"}))
    assert found.names and exponents(found) == [2.0]


def test_an_answer_again_is_without_the_barred_name() -> None:
    a, b = directions(2).T
    one = settling([member("a"), member("b")], {"a": a, "b": b}, 30.0 * a + 20.0 * b, DATA,
                   [power(1.0), power(2.0)])  # fmt: skip
    assert one.again(of_names(one, "ab"), frozenset({"a"})).names == ("b",)
    settled = one.settled(of_names(one, "ab"))
    assert settled.names == ("a", "b")
    assert not significant_forms(one.search, generic_residual(settled, one.search.fitter, one.generic))


# ------------------------------------------------------------- which forms are tried


def found(y: np.ndarray, forms: list[Form], data: GapData, barred: set[str]) -> list[Fit]:
    one = settling([], {}, y, data, forms)
    fit = one.search.fitter.fit(())
    left = generic_residual(fit, one.search.fitter, one.generic)
    return list(one._with_forms(fit, barred, left, range(len(one.generic.forms))))


def test_forms_come_by_gain_and_what_was_left_out_does_not_come_back() -> None:
    y = 40.0 * scaled(SPEED**2)
    forms = [power(1.0), power(2.0), power(3.0)]
    fits = found(y, forms, DATA, set())
    gains = {e: 1600.0 - squares_left([SPEED**e], y) for e in (1.0, 2.0, 3.0)}
    assert [exponents(fit)[0] for fit in fits] == sorted(gains, key=lambda e: -gains[e])
    without = found(y, forms, DATA, {*fits[0].names})
    assert [fit.names for fit in without] == [fit.names for fit in fits[1:]]


def test_a_form_of_the_prediction_is_no_term_and_others_are_still_tried() -> None:
    """It is first, but is no function of the inputs."""
    predicted = scaled(np.sin(5.0 * WARM) + SPEED)
    y = 60.0 * scaled(predicted**2) + 30.0 * scaled(SPEED**2)
    one = settling([], {}, y, DATA, None, predicted)
    forms = [k for k, form in enumerate(one.generic.forms)
             if form.variable.startswith("predicted") or form == power(2.0)]  # fmt: skip
    fit = one.search.fitter.fit(())
    left = generic_residual(fit, one.search.fitter, one.generic)
    assert one.generic.forms[forms[-1]].variable == "predicted te"
    assert left.gains[forms[-1]] - 9 * PENALTY > left.gains[forms[0]]
    fits = list(one._with_forms(fit, set(), left, forms))
    assert [exponents(each) for each in fits] == [[2.0]]


def test_levels_that_come_first_are_tried_alone_and_behind_others_as_one_of_them() -> None:
    lot = np.array(["p", "q", "r", "s"])[np.random.default_rng(4).integers(0, 4, N)]
    data = readings(speed=SPEED, temperature=20.0 + WARM, lot=lot)
    levels = Form("interval", "lot", shape=LEVELS)
    forms = [power(1.0), power(2.0), levels, power(1.0, "temperature")]
    speed, warm = scaled(SPEED), scaled(WARM)
    off = scaled((lot == "q") * 1.0 - (lot == "s"))

    def kinds(y: np.ndarray) -> list[str]:
        fits = found(y, forms, data, set())
        effects = [fit.members[-1].candidate.effect for fit in fits]
        return [one.term.shape for one in effects if isinstance(one, Unresolved)]

    assert kinds(60.0 * off + 30.0 * speed + 25.0 * warm) == ["levels"]
    assert kinds(60.0 * speed + 40.0 * off + 25.0 * warm) == ["power", "power", "levels", "power"]

"""The search for names on given columns, where least squares by hand says what must come out."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.commands.gap_toy import PENALTY, N, directions, member, readings, squares_left, toy
from tolevo.commands.gap import selection
from tolevo.commands.gap.blocks import Improvement
from tolevo.commands.gap.fit import Member
from tolevo.commands.gap.library import Candidate
from tolevo.commands.gap.linear import join_groups
from tolevo.commands.gap.scan import CHUNK, evidence, scan, strongest_evidence, thresholds
from tolevo.commands.gap.selection import (
    AS_WELL,
    BELOW_PRACTICAL_LIMIT,
    NO_FORM,
    TERM,
    UNITS,
    VISITED,
    Other,
    concluding,
    correlation,
    first_of_confounded,
    masked_pair,
    rivals,
    select,
    step_records,
    with_identified_by_likelihood,
)
from tolevo.models.effects.load import LoadFriction
from tolevo.models.effects.memory import Dahl
from tolevo.models.effects.unresolved import Term, Unresolved


def test_names_are_the_best_of_all_subsets() -> None:
    """By brute force over every set of six names, each at its price."""
    drawn = directions(6) + 0.25 * directions(6, seed=2)
    names = [f"n{at}" for at in range(6)]
    columns = dict(zip(names, drawn.T, strict=True))
    y = 20.0 * drawn[:, 1] - 12.0 * drawn[:, 4] + 9.0 * drawn[:, 5] + 3.0
    search = toy([member(one) for one in names], columns, y)
    found = select(search)
    sets = [one for count in range(7) for one in combinations(names, count)]
    best = min(sets, key=lambda s: squares_left([columns[n] for n in s], y) + PENALTY * len(s))
    assert {*found.fit.names} == {*best} == {"n1", "n4", "n5"}
    assert [one.action for one in found.steps] == ["start", "add", "add", "add"]
    for at, step in enumerate(found.steps[1:]):
        less, more = ([columns[n] for n in found.steps[k].names] for k in (at, at + 1))
        assert step.gain == pytest.approx(squares_left(less, y) - squares_left(more, y))
        assert step.better.gain > step.better.error > 0.0
    assert np.isnan(found.steps[0].better.gain)


def test_a_name_that_a_better_one_makes_needless_is_exchanged() -> None:
    """c is nearest to a + b and comes first; beside a, b leaves nothing and c does."""
    a, b, d = directions(3).T
    c = 0.95 * (a + b) / np.sqrt(2.0) + np.sqrt(1.0 - 0.95**2) * d
    search = toy([member(one) for one in "abc"], {"a": a, "b": b, "c": c}, 40.0 * a + 38.0 * b)
    found = select(search)
    assert [(one.action, one.name) for one in found.steps] == [
        ("start", ""), ("add", "c"), ("add", "a"), ("swap", "c for b")
    ]  # fmt: skip
    assert found.steps[-1].names == ("a", "b") and found.steps[-1].accepted
    assert found.identified == ("a", "b") and found.fit.rss == pytest.approx(0.0, abs=1e-9)
    told = [one.held_out for one in step_records(search, found.steps)]
    wanted = [search.held_out_error(search.tested(one.fit)) for one in found.steps]
    assert told == wanted and told[3] < told[2] < told[1] < told[0]  # each step beside its own error


def test_the_same_name_at_a_better_place_is_no_step() -> None:
    """`bent` is first fitted without b, at a wrong place of its grid, and then moves."""
    a, b, d = directions(3).T

    def bent(place: float) -> Any:
        return np.cos(place) * a + np.sin(place) * d

    places = np.linspace(-0.6, 0.6, 13)
    members = [*(member("bent", shape={"place": one}) for one in places), member("b")]
    mixed = 0.8 * b + 0.6 * d
    found = select(toy(members, {"bent": bent, "b": mixed}, 40.0 * a + 20.0 * mixed))
    assert [one.action for one in found.steps] == ["start", "add", "add"]
    at = found.fit.names.index("bent")
    assert found.fit.members[at].shape["place"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("size", "named"), [(4.0, False), (6.0, True)])
def test_what_is_below_the_practical_limit_is_not_named(size: float, named: bool) -> None:
    """A column of length 1 times `size` has an rms of size / 10 over 100 rows; the limit is 0.5."""
    (a,) = directions(1).T
    found = select(toy([member("a")], {"a": a}, size * a, practical_limit=0.5))
    assert found.identified == (("a",) if named else ())
    assert named or [one.reason for one in found.steps[1:]] == [BELOW_PRACTICAL_LIMIT]


def test_a_name_that_failed_is_passed_over() -> None:
    """What is large in one block alone, and of the other sign elsewhere, predicts nothing there."""
    a, d = directions(2).T
    spike = np.eye(N)[7] - np.eye(N)[17]  # both in the same block
    columns = {"spike": spike + 0.1 * d, "a": a}
    y = 12.0 * a + 30.0 * spike - 3.0 * d
    search = toy([member("spike"), member("a")], columns, y)
    empty = search.fitter.fit(())
    first, second = (next(search.additions(empty, barred, empty)) for barred in (set[str](), {"spike"}))
    assert first.names == ("spike",) and second.names == ("a",)
    assert not list(search.additions(empty, {"spike", "a"}, empty))
    assert not list(search.additions(empty, {"spike"}, first))  # which fits better
    search = toy([member("spike")], columns, y)
    found = select(search)
    assert [(one.action, one.name) for one in found.steps] == [("start", ""), ("reject", "spike")]
    assert found.steps[1].gain > 1000.0 and found.steps[1].better.gain < 0.0
    louder = toy([member("spike")], columns, y / 2.0)  # the same record in a noise twice as large
    told = step_records(louder, [one.refitted(louder) for one in found.steps])
    halved = [one.held_out / 2.0 for one in step_records(search, found.steps)]
    assert [one.held_out for one in told] == pytest.approx(halved) and halved[1] > halved[0]
    assert told[1].names == () and not told[1].accepted


# ------------------------------------------------------------- names that show in pairs alone


def pair(total: float, limit: float, share: float = 0.25) -> Any:
    """Two columns whose difference makes y: `total` is what both explain, `share` of it one does,
    and leaving one out costs 1 - share.
    """
    p, q = directions(2).T
    y = np.sqrt(total) * q
    one, other = (np.sqrt(1.0 - share) * p + s * np.sqrt(share) * q for s in (1.0, -1.0))
    assert squares_left([one], y) == pytest.approx((1.0 - share) * total)
    assert squares_left([one, other], y) == pytest.approx(0.0, abs=1e-9)
    return toy([member("one"), member("other")], {"one": one, "other": other}, y, limit)


def test_a_pair_shows_from_1_6_thresholds_on() -> None:
    for total, limit, seen in ((20.0, 10.0, True), (15.5, 10.0, False)):
        search = pair(total, limit)
        found = masked_pair(search, search.fitter.fit(()), set())
        assert (found is not None) == seen
    barred = {frozenset({"one", "other"})}
    search = pair(20.0, 10.0)
    assert masked_pair(search, search.fitter.fit(()), barred) is None
    assert {*select(search).identified} == {"one", "other"}
    assert select(search, quick=True).identified == ()


def test_a_pair_below_the_price_of_its_numbers_is_none() -> None:
    """Two numbers cost 2 ln 100 = 9.2."""
    low, high = pair(8.8, 4.0), pair(9.7, 4.0)
    assert masked_pair(low, low.fitter.fit(()), set()) is None
    assert masked_pair(high, high.fitter.fit(()), set()) is not None


def test_each_name_of_a_pair_must_be_needed() -> None:
    """Together 24 are beyond 1.6 thresholds; the second one alone explains but 3."""
    a, b = directions(2).T
    search = toy([member("a"), member("b")], {"a": a, "b": b}, np.sqrt(21.0) * a + np.sqrt(3.0) * b)
    assert masked_pair(search, search.fitter.fit(()), set()) is None


# ------------------------------------------------------------- what is refined


def test_signs_that_physics_excludes_do_not_hide_what_is_allowed() -> None:
    """Two coefficients that may not be negative gain nothing where both would be; a scan, which
    does not know it, has them far before the only name that fits.
    """
    a, b, c = directions(3).T
    both = member("both", linear=2, low=0.0)
    columns = {"both": np.column_stack([a, b]), "single": c}
    y = -20.0 * a - 20.0 * b + 15.0 * c
    search = toy([both, member("single")], columns, y)
    assert [one.gain for one in search.open(())] == pytest.approx([800.0, 225.0])
    found = search.refined((), search.open(()))
    assert found[0].names == ("single",)
    assert found[0].rss == pytest.approx(800.0)


def test_only_what_gains_is_refined_be_it_little() -> None:
    a, b = directions(2).T
    y = np.sqrt(0.5) * a - 3.0 * b
    search = toy([member("a"), member("b", low=0.0)], {"a": a, "b": b}, y)
    assert [one.gain for one in search.open(())] == pytest.approx([0.5, 0.0], abs=1e-12)
    assert [one.names for one in search.refined((), search.open(()))] == [("a",)]
    assert search.refined((), ()) == []


def test_a_scan_leaves_out_what_is_in_the_fit_and_takes_the_best_place() -> None:
    a, b = directions(2).T
    places = (0.0, 0.4, 0.8)
    members = [*(member("bent", shape={"x": one}) for one in places), member("b")]
    columns = {"bent": lambda x: np.cos(x) * a + np.sin(x) * b, "b": b}
    search = toy(members, columns, 10.0 * (np.cos(0.4) * a + np.sin(0.4) * b))
    found = scan(search.fitter, search.white, search.dictionary, ())
    assert [(one.member.name, one.member.shape) for one in found] == [("bent", {"x": 0.4}),
                                                                      ("b", {})]  # fmt: skip
    assert [one.gain for one in found] == pytest.approx([100.0, 100.0 * np.sin(0.4) ** 2])
    found = scan(search.fitter, search.white, search.dictionary, [members[-1]])
    assert [one.member.name for one in found] == ["bent"]
    assert found[0].gain == pytest.approx(100.0 * np.cos(0.4) ** 2)


# ------------------------------------------------------------- the path as it is told


def test_the_path_beside_a_name_found_by_likelihood() -> None:
    a, b, c = directions(3).T
    search = toy([member(one) for one in "abc"], {"a": a, "b": b, "c": c}, 20.0 * a + 15.0 * b)
    before = select(search)
    other = search.fitter.fit([one for one in search.dictionary.members if one.name in "ac"])
    after = replace(before, fit=other)
    found = with_identified_by_likelihood(search, before, after, "wide", 31.0, 6.0, Improvement(30.0, 2.0))
    new = found.steps[len(before.steps) :]
    assert [(s.action, s.name, s.names) for s in new] == [
        ("add", "wide", ("a", "b", "wide")), ("drop", "b", ("a", "c", "wide")),
        ("add", "c", ("a", "c", "wide")),
    ]  # fmt: skip
    assert all(one.accepted for one in new)
    first = new[0]
    assert (first.gain, first.threshold, first.better) == (31.0, 6.0, Improvement(30.0, 2.0))
    assert first.reason == UNITS and found.fit is other


def test_the_path_ends_with_what_became_of_the_names() -> None:
    """a is struck, c comes, t is a term."""
    a, b, c = directions(3).T
    data = readings(speed=np.linspace(1.0, 9.0, N))
    search = toy([member(one) for one in "ab"], {"a": a, "b": b, "c": c}, 20.0 * a + 15.0 * b, data=data)
    found = select(search)
    term = Unresolved(Term("te", "speed", "power", exponent=2.0))
    t = Member(Candidate(term, term.own_parameters(data.target), ()))
    final = search.fitter.fit([member("b"), member("c"), t])
    steps = concluding(search, found, final)
    assert [one.reason for one in steps[-3:]] == [NO_FORM, AS_WELL, TERM]
    assert [one.name for one in steps[-3:]] == ["a", "c", "unresolved term of speed"]
    assert all(one.names == ("b", "c") and one.accepted for one in steps[-3:])
    assert [one.names for one in steps[:-3]] == [one.names for one in found.steps]


# ------------------------------------------------------------- what cannot be told apart


def test_one_name_instead_of_two_is_a_rival() -> None:
    """c does what a and b do together, at one number less."""
    a, b, d = directions(3).T
    columns = {"a": a, "b": b, "c": (a + b) / np.sqrt(2.0), "d": d}
    search = toy([member(one) for one in "abcd"], columns, 20.0 * (a + b), set_distance=8.0)
    fit = search.fitter.fit([one for one in search.dictionary.members if one.name in "ab"])
    found = rivals(search, fit, (0, 1))
    assert found[0].instead_of == ("a", "b") and found[0].names == ("c",)
    assert found[0].distance == pytest.approx(-PENALTY)
    own = {(one.names, one.instead_of): one.distance for one in found[1:]}
    assert own == {(("c",), ("a",)): pytest.approx(0.0, abs=1e-6),
                   (("c",), ("b",)): pytest.approx(0.0, abs=1e-6)}  # fmt: skip
    assert rivals(search, fit, ()) == []


@pytest.mark.parametrize("angle", [0.3, 1.1])
def test_correlation_is_the_cosine_between_what_names_do(angle: float) -> None:
    a, d, b = directions(3).T
    columns = {"a": a, "o": np.cos(angle) * a + np.sin(angle) * d, "b": b}
    members = [member(one) for one in "aob"]
    search = toy(members, columns, 10.0 * a + 7.0 * b)
    fit, other = search.fitter.fit([members[0], members[2]]), search.fitter.fit(members[2:])
    other = search.fitter.fit([members[2], members[1]])
    rival = Other(other, ("o",), ("a",), 0.0)
    assert correlation(search.fitter, fit, rival) == pytest.approx(np.cos(angle))


@pytest.mark.parametrize("population", [False, True])
@pytest.mark.parametrize("mine", ["load", "instrument"])
@pytest.mark.parametrize("new", ["load", "instrument"])
@pytest.mark.parametrize("distance", [0.0, 0.01])
def test_of_twins_the_instrument_goes_first_in_rows_and_the_process_in_a_batch(
    population: bool, mine: str, new: str, distance: float
) -> None:
    def fit(family: str) -> Any:
        one = member(family[:1], family=family)
        return SimpleNamespace(members=(one,), names=(one.name,))

    own, other = fit(mine), fit(new)
    rival = Other(other, other.names, own.names, distance)
    first = "load" if population else "instrument"
    exchanged = distance == 0.0 and new == first and mine != first
    assert (first_of_confounded(own, [rival], population) is other) == exchanged
    hidden: Any = SimpleNamespace(members=(member("x", family=new, unread=True),), names=("x",))
    unread = Other(hidden, ("x",), own.names, distance)
    assert first_of_confounded(own, [unread], population) is None


@pytest.mark.parametrize(("terms", "simpler"), [(True, True), (False, True), (True, False)])
def test_a_memory_beside_terms_yields_to_an_effect_with_fewer_numbers(terms: bool, simpler: bool) -> None:
    own = SimpleNamespace(name="dahl", candidate=SimpleNamespace(effect=Dahl(), count=2))
    other = SimpleNamespace(
        name="dry", candidate=SimpleNamespace(effect=LoadFriction(), count=1 if simpler else 2, unread=False)
    )
    fit: Any = SimpleNamespace(members=(own,), terms=["a term"] * terms)
    rival = Other(SimpleNamespace(members=(other, "a term")[: 1 + terms]), ("dry",), ("dahl",), 5.0)  # type: ignore[arg-type]
    assert (first_of_confounded(fit, [rival], False) is rival.fit) == (terms and simpler)


# ------------------------------------------------------------- what noise reaches


class Counted:
    """Noise that counts its records."""

    def __init__(self) -> None:
        self.records: list[int] = []

    def standard_normal(self, size: tuple[int, int]) -> Any:
        self.records.append(size[1])
        return np.random.default_rng(len(self.records)).standard_normal(size)


def test_as_many_records_as_asked_for_are_simulated_a_chunk_at_a_time() -> None:
    groups, rng = join_groups([directions(1)], [False], N), Counted()
    count = 2 * CHUNK + 70
    thresholds(groups, groups, np.zeros((N, 0)), count, 0.05, rng)  # type: ignore[arg-type]
    assert rng.records == [CHUNK, CHUNK, 70]


def test_without_forms_there_is_no_evidence_and_without_a_gain_neither() -> None:
    none = join_groups([], [], N)
    np.testing.assert_array_equal(strongest_evidence(none, np.zeros((0, 5))), np.zeros(5))
    groups = join_groups([directions(2), directions(1, 3)], [False, False], N)
    np.testing.assert_array_equal(evidence(groups, np.zeros(2)), np.zeros(2))


def test_a_selection_that_reaches_ever_new_sets_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests that turn every addition into another pair: 105 pairs of 15 effects, all of them new."""
    names = [f"n{at}" for at in range(15)]
    members = [member(one) for one in names]
    columns = dict(zip(names, directions(15).T, strict=True))
    search = toy(members, columns, directions(15) @ np.full(15, 20.0), limit=1.0)
    pairs = combinations(members, 2)
    monkeypatch.setattr(selection, "_retest_effects", lambda search, fit, *_: search.fitter.fit(next(pairs)))
    found = select(search)
    assert sum(step.action == "add" for step in found.steps) == VISITED * search.settings.effects_at_most

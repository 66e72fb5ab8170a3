"""What holds of every answer: on a few records of every group, and that a violation is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from benchmarks.gap.generator.records import GROUPS, record
from benchmarks.gap.invariants import BOUND, NOTHING, RECALIBRATED, STEP, UNKNOWN, broken, violated
from benchmarks.gap.namers.workflow import SIMULATORS, read_as_files
from tolevo.commands.gap.gap import ending, lines_of, result_of
from tolevo.commands.gap.result import Ending

pytestmark = pytest.mark.source_tree
FIRST = 5000
COUNT = 4


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_the_invariants_hold_of_every_answer(group: str) -> None:
    found = {k: broken(group, k) for k in range(FIRST, FIRST + COUNT)}
    assert not {k: reasons for k, reasons in found.items() if reasons}


def test_a_sag_whose_mass_is_hardly_known_is_no_zero() -> None:
    """Three compliances times (mass + payload): of the mass nothing is known where they are 0."""
    assert broken("manipulator good", 22014) == []


@pytest.fixture(scope="module")
def answer(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ending, str]:
    folder = tmp_path_factory.mktemp("invariants")
    plan, data = read_as_files(record("dominant", 5009, SIMULATORS)[0], folder)
    with threadpool_limits(1):
        end = ending(plan, data)
    return end, "\n".join(lines_of(result_of(plan, data, end)))


def test_an_answer_that_predicts_no_better_than_the_model_is_seen(answer: tuple[Ending, str]) -> None:
    end, said = answer
    assert violated(end, said) == []
    worse = replace(end.before, white=1.01 * end.before.white)
    found = violated(replace(end, after=worse), said)
    assert [one.partition(":")[0] for one in found[:1]] == [RECALIBRATED]
    assert {STEP} == {one.partition(":")[0] for one in found[1:]}


def test_an_effect_that_may_be_nothing_is_seen(answer: tuple[Ending, str]) -> None:
    end, said = answer
    wide = replace(end.model, covariance=1e8 * end.model.covariance, errors=1e4 * end.model.errors)
    found = violated(replace(end, model=wide), said)
    assert {one.partition(":")[0] for one in found} == {NOTHING, UNKNOWN}
    assert any(wide.nothing(end.fit.members[at]) for at in end.identified)
    assert not any(end.model.nothing(end.fit.members[at]) for at in end.identified)


def test_whether_an_effect_is_nothing_does_not_depend_on_units(answer: tuple[Ending, str]) -> None:
    """Numbers a million times as large, of one parameter in each effect."""
    model, members = answer[0].model, answer[0].fit.members
    by = np.where(np.arange(len(model.numbers)) % 2, 1e6, 1.0)
    other = replace(model, values=model.values * by, errors=model.errors * by,
                    covariance=model.covariance * np.outer(by, by))  # fmt: skip
    for wider in (1.0, 30.0, 100.0, 300.0, 1e4):
        one, same = (replace(each, covariance=wider**2 * each.covariance,
                             errors=wider * each.errors) for each in (model, other))  # fmt: skip
        for at in answer[0].identified:
            assert one.nothing(members[at]) == same.nothing(members[at])


def test_a_number_at_its_bound_that_is_not_said_is_seen(answer: tuple[Ending, str]) -> None:
    end, said = answer
    at, one = next((k, one) for k, one in enumerate(end.model.numbers)
                   if one.kind == "effect" and np.isfinite(one.low) and one.low)  # fmt: skip
    values = end.model.values.copy()
    values[at] = one.low
    stopped = replace(end, model=replace(end.model, values=values))
    found = [text for text in violated(stopped, said) if text.startswith(BOUND)]
    assert len(found) == 1
    assert one.name in found[0]
    line = f"at its physical bound: {one.name} of {one.owner}"
    assert not [text for text in violated(stopped, line) if text.startswith(BOUND)]

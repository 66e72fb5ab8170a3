"""Steps of a repeated computation are recalled, as long as their inputs are the same."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tolevo.journal import Section, recall_arrays, recall_columns, recording_steps


def worked(calls: list[int], n: int) -> tuple[np.ndarray, ...]:
    """A step of some milliseconds: a square, and whether it is even."""
    calls.append(n)
    until = time.thread_time() + 0.002
    while time.thread_time() < until:
        pass
    return np.array(n * n), np.array([n % 2 == 0]), np.arange(n), np.zeros((0, n))


def repeated(section: Section, numbers: list[int]) -> tuple[list[int], list[int]]:
    """The squares, and the numbers that were computed."""
    calls: list[int] = []
    with recording_steps(section):
        squares = [int(recall_arrays((n,), lambda n=n: worked(calls, n))[0]) for n in numbers]  # type: ignore[misc]
    return squares, calls


def test_steps_are_computed_once_also_from_the_stored_state() -> None:
    section = Section()
    assert repeated(section, [1, 2, 3]) == ([1, 4, 9], [1, 2, 3])
    assert repeated(section, [1, 2, 3, 4]) == ([1, 4, 9, 16], [4])
    stored = Section()
    stored.restore(section.state())
    assert repeated(stored, [1, 2, 3, 4]) == ([1, 4, 9, 16], [])
    with recording_steps(stored):
        arrays = recall_arrays((1,), lambda: worked([], 1))
    assert [array.dtype.kind for array in arrays] == ["i", "b", "i", "f"]
    assert [array.shape for array in arrays] == [(), (1,), (1,), (0, 1)]


def test_other_inputs_are_computed_anew_with_all_that_follows() -> None:
    section = Section()
    repeated(section, [1, 2, 3])
    assert repeated(section, [1, 5, 3]) == ([1, 25, 9], [5, 3])


def test_a_step_that_fails_leaves_its_place_to_the_next_attempt() -> None:
    section = Section()

    def failing() -> tuple[np.ndarray, ...]:
        raise KeyboardInterrupt

    repeated(section, [1])
    with recording_steps(section):
        recall_arrays((1,), lambda: worked([], 1))
        with pytest.raises(KeyboardInterrupt):
            recall_arrays((2,), failing)
    assert repeated(section, [1, 2]) == ([1, 4], [2])


def test_steps_within_a_step_are_part_of_it() -> None:
    section, calls = Section(), list[int]()

    def outer() -> tuple[np.ndarray, ...]:
        return recall_arrays((1,), lambda: worked(calls, 1)) + worked(calls, 2)

    for _ in range(2):
        with recording_steps(section):
            assert len(recall_arrays(("outer",), outer)) == 8
    assert calls == [1, 2]


def test_the_steps_of_a_step_that_was_interrupted_are_recalled() -> None:
    section, calls, ends = Section(), list[int](), [True, False, False]

    def outer() -> tuple[np.ndarray, ...]:
        first = recall_arrays((1,), lambda: worked(calls, 1))
        if ends.pop(0):
            raise KeyboardInterrupt
        return first + recall_arrays((2,), lambda: worked(calls, 2))

    with recording_steps(section), pytest.raises(KeyboardInterrupt):
        recall_arrays(("outer",), outer)
    stored = Section()
    stored.restore(section.state())
    for _ in range(2):
        with recording_steps(stored):
            assert len(recall_arrays(("outer",), outer)) == 8
    assert calls == [1, 2]
    assert "inner" not in stored.state()


def test_columns_keep_their_names() -> None:
    section, calls = Section(), list[int]()
    for _ in range(2):
        with recording_steps(section):
            columns = recall_columns((3,), lambda: dict(zip("abcd", worked(calls, 3), strict=True)))
            assert list(columns) == ["a", "b", "c", "d"]
            assert int(columns["a"]) == 9
            assert recall_columns(("none",), dict) == {}
    assert calls == [3]


def test_steps_within_an_interrupted_step_belong_to_its_inputs() -> None:
    def outer(name: str, calls: list[int], fails: bool) -> tuple[np.ndarray, ...]:
        (value, *_) = recall_arrays((3,), lambda: worked(calls, 3))
        if fails:
            raise KeyboardInterrupt
        return (np.array(int(value) + len(name)),)

    section = Section()
    with pytest.raises(KeyboardInterrupt), recording_steps(section):
        recall_arrays(("first",), lambda: outer("first", [], True))
    for name, computed in (("first", 0), ("another", 1)):
        again, calls = Section(), list[int]()
        again.restore(section.state())
        with recording_steps(again):
            assert int(recall_arrays((name,), lambda n=name, c=calls: outer(n, c, False))[0]) == 9 + len(name)  # type: ignore[misc]
        assert len(calls) == computed


def test_results_that_are_no_numbers_are_computed_again() -> None:
    section = Section()
    for _ in range(2):
        with recording_steps(section):
            until = time.thread_time() + 0.002

            def texts(until: float = until) -> tuple[np.ndarray, ...]:
                while time.thread_time() < until:
                    pass
                return (np.array(["a", None], dtype=object),)

            assert recall_arrays((1,), texts)[0].tolist() == ["a", None]
        section.state()

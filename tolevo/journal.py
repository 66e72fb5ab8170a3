"""Results of the steps of a long computation, so that one that is repeated recalls them.

A step is recalled by its place in the sequence of steps, which is the same each time, and a checksum
of its inputs: where that differs, this step and all later ones are computed anew. Steps that took
little time are computed again rather than stored. The steps within a step are stored until it ends.

What speeds up a computation, as the start of the next iteration, may be remembered within a `stretch`
only, between one step and the next: a recalled step leaves no memory.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = tuple[NDArray[Any], ...]
MIN_RECORDED_SECONDS = 5e-4
"""CPU time [s] of a step from which on its result is stored."""
MAX_JOURNAL_BYTES = 100_000_000
"""Bytes of results that are stored at most in a section; later steps are computed again."""
KINDS = "fiub"
"""Kinds of numpy's types that can be stored."""


class Section:
    """The steps of one part of a computation, which come in the same order each time."""

    def __init__(self, changed: Callable[[], None] = lambda: None) -> None:
        self._changed = changed
        self._checks: list[int] = []
        self._results: dict[int, Arrays] = {}
        self._bytes = 0
        self._at = 0
        self._inner: tuple[int, int, Section] | None = None
        self.stretch = object()

    def begin(self) -> None:
        """Begin again with the first step."""
        self._at = 0
        self.stretch = object()

    def step(self, check: int, compute: Callable[[], Arrays]) -> Arrays:
        """The result of the next step."""
        at, self.stretch = self._at, object()
        if at < len(self._checks) and self._checks[at] != check:
            self._results = {place: result for place, result in self._results.items() if place < at}
            self._bytes = sum(array.nbytes for result in self._results.values() for array in result)
            self._inner = None
            del self._checks[at:]
        self._at += 1
        if at < len(self._checks) and at in self._results:
            return tuple(array.copy() for array in self._results[at])
        if self._inner is None or self._inner[:2] != (at, check):
            self._inner = at, check, Section(self._changed)
        start = time.thread_time()
        try:
            with recording_steps(self._inner[2]):
                result = compute()
        except BaseException:
            self._at = at
            raise
        self._inner = None
        if at == len(self._checks):
            self._checks.append(check)
        size = sum(array.nbytes for array in result)
        savable = all(array.dtype.kind in KINDS for array in result)
        if savable and time.thread_time() - start >= MIN_RECORDED_SECONDS and self._bytes + size <= MAX_JOURNAL_BYTES:
            self._bytes += size
            self._results[at] = tuple(np.array(array) for array in result)
            self._changed()
        return result

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything as arrays."""
        stored = [array for result in self._results.values() for array in result]
        inner = {}
        if self._inner is not None and self._inner[2]._checks:
            inner = {f"inner.{key}": value for key, value in self._inner[2].state().items()}
            inner["inner"] = np.array(self._inner[:2])
        shapes = [[KINDS.index(array.dtype.kind), array.ndim, *array.shape] for array in stored]
        return inner | {
            "checks": np.array(self._checks, dtype=np.int64),
            "places": np.array(list(self._results), dtype=np.int64),
            "counts": np.array([len(result) for result in self._results.values()], dtype=np.int64),
            "shapes": np.array([number for shape in shapes for number in shape], dtype=np.int64),
            "values": np.concatenate([np.zeros(0), *(array.astype(float).ravel() for array in stored)]),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Continue from a `state()`."""
        self._checks = state["checks"].tolist()
        numbers, values, used = iter(state["shapes"].tolist()), state["values"], 0
        for place, count in zip(state["places"].tolist(), state["counts"].tolist(), strict=True):
            arrays = []
            for _ in range(count):
                kind = KINDS[next(numbers)]
                shape = tuple(next(numbers) for _ in range(next(numbers)))
                size = int(np.prod(shape, dtype=np.int64))
                arrays.append(
                    values[used : used + size].reshape(shape).astype({"f": float, "b": bool}.get(kind, np.int64))
                )
                used += size
            self._results[place] = tuple(arrays)
        self._bytes = values.nbytes
        if "inner" in state:
            at, check = state["inner"].tolist()
            self._inner = at, check, Section(self._changed)
            self._inner[2].restore(
                {key.removeprefix("inner."): value for key, value in state.items() if key.startswith("inner.")}
            )


_OPEN: ContextVar[Section | None] = ContextVar("section", default=None)


@contextmanager
def recording_steps(section: Section | None) -> Iterator[None]:
    """Within this context steps are recalled from a section, and stored in it."""
    if section is not None:
        section.begin()
    before = _OPEN.set(section)
    try:
        yield
    finally:
        _OPEN.reset(before)


def recording_suspended() -> Any:
    """Within this context nothing is recalled."""
    return recording_steps(None)


def stretch() -> object:
    """What is the same between two steps, and where no section is open."""
    section = _OPEN.get()
    return None if section is None else section.stretch


def recall_arrays(inputs: Iterable[Any], compute: Callable[[], Arrays]) -> Arrays:
    """What `compute` returns, numbers as arrays; recalled where a section is open.

    `inputs` are arrays and texts on which the result depends, in addition to what is the same
    whenever the computation is repeated.
    """
    section = _OPEN.get()
    return compute() if section is None else section.step(_checksum(inputs), compute)


def recall_columns(inputs: Iterable[Any], compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """`recall_arrays` for arrays by name."""
    if _OPEN.get() is None:
        return compute()

    def listed() -> Arrays:
        columns = compute()
        names = np.frombuffer("\n".join(columns).encode(), dtype=np.uint8)
        return (names, *map(np.asarray, columns.values()))

    names, *columns = recall_arrays(inputs, listed)
    return dict(zip(names.astype(np.uint8).tobytes().decode().split("\n"), columns, strict=bool(columns)))


def _checksum(inputs: Iterable[Any]) -> int:
    check = 0
    for value in inputs:
        content = np.ascontiguousarray(value).tobytes() if isinstance(value, np.ndarray) else str(value).encode()
        check = zlib.crc32(content, check)
    return check

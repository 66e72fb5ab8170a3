"""Everything tolevo raises on purpose.

TolevoError            exit status 1
|-- InputError         exit status 2: the user's input is wrong; carries every fault
|-- RunError           exit status 1: a run failed; says what is saved and how to continue
`-- ModelError         exit status 1: a model returned what it must not (NaN, wrong shape)
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

MAX_COMPARED_NAME = 100
"""Characters of a name for which the nearest valid one is looked for."""
_PART = re.compile(r" \(part [^()]*\)$")
"""The part that a message is about, whose place says so as well."""
LINES = 1000
"""Lines of faults at most."""
REPEATED = 3
"""Places with one message that get lines of their own."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault in the user's input: where it is, and what would be right."""

    place: str
    message: str

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


class UnknownKey(Fault):
    """A key of a configuration that nothing reads."""

    __slots__ = ()


class TolevoError(Exception):
    """Root of the tree; `exit_status` is what the command line returns."""

    exit_status = 1


class InputError(TolevoError):
    """The user's input is wrong: configuration, data or arguments."""

    exit_status = 2

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        lines = list(islice(_lines(self.faults), LINES))
        more = [f"more than {LINES} faults: the others are not listed"] if len(lines) == LINES else []
        super().__init__("\n".join([*lines, *more]))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Fault, ...]]]:
        return type(self), (self.faults,)


def _lines(faults: tuple[Fault, ...]) -> Iterator[str]:
    """A line per fault; one line for all places of a message that is repeated."""
    places: dict[str, list[str]] = {}
    for fault in faults:
        places.setdefault(_PART.sub("", fault.message), []).append(fault.place)
    for fault in faults:
        message = _PART.sub("", fault.message)
        first, others = places[message][:REPEATED], len(places[message]) - REPEATED
        if others <= 0:
            yield str(fault)
        elif fault.place == first[0]:
            yield f"{', '.join(first)} and {others} other places: {message}"


ConfigurationError = InputError
"""Its name in the Python interface."""


class RunError(TolevoError):
    """A run failed after it had begun."""


class StorageError(RunError):
    """Results could not be written; the message states the remedy and how to continue."""


class ModelError(TolevoError):
    """A model or problem broke its own contract (shape, finiteness)."""


def refuse(place: str, message: str) -> InputError:
    """An `InputError` with a single fault, to be raised."""
    return InputError([Fault(place, message)])


def raise_all(faults: Iterable[Fault]) -> None:
    """Raise one `InputError` that carries all `faults`; do nothing where there are none.

    That a key is unknown is left out where another fault says more of it.
    """
    collected = tuple(faults)
    told = {fault.place for fault in collected if not isinstance(fault, UnknownKey)}
    if collected := tuple(f for f in collected if not isinstance(f, UnknownKey) or f.place not in told):
        raise InputError(collected)


def abbreviated_list(names: Iterable[str]) -> str:
    """The first ten of some names."""
    first = [*islice(names, 11)]
    return ", ".join(first[:10] + ["..."] * (len(first) > 10))


def nearest(name: str, valid: Iterable[str]) -> str:
    """' (did you mean `x`?)' for the closest valid name, else an empty string."""
    if len(name) > MAX_COMPARED_NAME:
        return ""
    close = difflib.get_close_matches(name, list(valid), n=1, cutoff=0.6)
    return f" (did you mean `{close[0]}`?)" if close else ""

"""Result records of the next measurement that `tolevo gap` plans."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Separation:
    """How well the next measurement, together with the present data, separates `names` from
    `instead_of`.

    `now` and `expected` are the discrimination without and with it: the squared norm, in noise
    units, of the part of one prediction that a refit of the other cannot follow. `chance` is the
    probability that the right one then fits better, `alike` the same with as many measurements
    like the present ones, `alone` that only the right one stays within the distance of a set;
    `needed` measurements like the planned ones raise the chance to 0.95 (0 where none do). `text`
    says so. `possible` is false where no design in the range separates them.
    """

    names: tuple[str, ...]
    instead_of: tuple[str, ...]
    now: float
    expected: float
    chance: float
    alike: float
    alone: float
    needed: int
    text: str
    possible: bool = True

    def __str__(self) -> str:
        names, rivals = " + ".join(self.names), " + ".join(self.instead_of)
        return f"{names} instead of {rivals}: {self.text}"


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How sensitive the next measurement is to an effect that is barely detectable.

    `amount` is the value of `parameter` that is looked for; `now`, `then` and `alike` the chances
    that an effect of that size passes the threshold of the whole library in the present data, with
    the planned measurements, and with as many like the present ones; `least_now` and `least_then`
    the smallest values that are detected nine times out of ten.
    """

    name: str
    parameter: str
    unit: str
    amount: float
    now: float
    then: float
    alike: float
    least_now: float
    least_then: float

    def __str__(self) -> str:
        return (
            f"{self.name} of {self.parameter} = {self.amount:.3g} {self.unit}: detected with probability "
            f"{self.then:.2f} (now {self.now:.2f}, with as many measurements like these {self.alike:.2f}); detected "
            f"from {self.least_then:.3g} instead of {self.least_now:.3g}"
        )


@dataclass(frozen=True, slots=True)
class NextMeasurement:
    """The points of the next measurement, in `file` (empty where there are none), and what they
    are expected to show of every pair of effects, or of effects that are barely detectable.

    `telling` are the inputs whose values matter most for the separation.
    """

    text: str
    readings: int = 0
    pairs: tuple[Separation, ...] = ()
    effects: tuple[Sensitivity, ...] = ()
    notes: tuple[str, ...] = ()
    telling: tuple[str, ...] = ()
    file: str = ""

    def __str__(self) -> str:
        return self.text

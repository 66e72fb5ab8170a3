"""Pins and pin holes that are sorted into classes and matched, in the closed form.

The zones of holes and pins, half-widths t_h and t_p, are each divided into k classes of equal width, and pins of a
class are built into holes of the like class. A uniform deviation is z = C + U/k, C one of the k class centres,
(2 c - k + 1)/k, and U uniform from -1 to 1. What matched parts have in common is C, so that

    t_h z_h - t_p z_p = (t_h/k) U_h - (t_p/k) U_p + (t_h - t_p) C + e,

e ~ N(0, u^2) what the measurement does not tell. Where both zones are equal no class differs from another in its mean
clearance. Reference: Mansoor (1961), Int. J. Production Research 1(1), 13-24.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...errors import Fault
from ...models.inputs import Distribution, Normal, Uniform
from ...models.propagation.sums import ClippedSum, Term
from ...models.stack.matching import Matching
from ...section import Array, Output, Parameter, Section, Value, number
from ..declaration import Declaration
from ..settings import Settings
from .shift import TERMS

HOLE, PIN = "pin_hole_radius_um", "pin_radius_um"
CLASSES, ACCURACY, PRICE = "pin_classes", "pin_match_um", "pin_sorting_price"
SORTING = (
    Parameter(
        CLASSES,
        5,
        "",
        "classes that pins and their holes are sorted into by their diameters; pins are built into holes of the like "
        "class",
        low=2,
        high=50,
    ),
    Parameter(
        ACCURACY,
        0.3,
        "um",
        "standard deviation with which the difference of the diameters of a hole and its pin is known",
        assumed=True,
        low=0.0,
        high=100.0,
    ),
    Parameter(PRICE, 0.0, "", "cost of sorting the pins and holes of a unit", assumed=True, low=0.0, high=1e9),
)
LEFT_OVER, PER_GOOD_UNIT = "pins_left_over_percent", "cost_per_good_unit"
OF_SORTING = (
    Output(LEFT_OVER, "percent", "pins and holes without a mate of the like class", low=0.0, high=100.0),
    Output(PER_GOOD_UNIT, "", "cost with the parts left over, of each unit that keeps the yield's limit", low=0.0),
)
STANDARD_NORMAL = Normal(1.0 / 3.0)


def with_matching(plain: Declaration, stated: Collection[str]) -> Declaration:
    """The declaration with pins in classes, where their number is `stated`."""
    if CLASSES not in stated:
        return plain
    return replace(plain, parameters=(*plain.parameters, *SORTING), outputs=(*plain.outputs, *OF_SORTING))


def refuse_alone(parameters: Section, names: Collection[str]) -> None:
    """A fault for each of the parameters `names` of pins in classes that is stated without their number."""
    for name in names:
        if CLASSES not in parameters and parameters.take(name) is not None:
            parameters.fault(name, f"changes nothing: state parameters.{CLASSES}, or leave it out")


def refuse_rotation(variables: Section) -> None:
    """A fault of the third modification of document B, which is known where flanks alone are designed."""
    if "rotation_arcmin" in variables:
        text = "is of a second pass, which no units are drawn with: search it with tooth_modification, or leave it out"
        variables.fault("rotation_arcmin", text)


@dataclass(frozen=True, slots=True)
class ClassCentres(Distribution):
    """The centre of one of `classes` equal classes of the zone, each as frequent as the others."""

    classes: int

    @property
    def _centres(self) -> Array:
        return (2.0 * np.arange(self.classes) - self.classes + 1.0) / self.classes

    @property
    def support(self) -> tuple[float, float]:
        return float(self._centres[0]), float(self._centres[-1])

    def raw_moments(self, order: int) -> Array:
        return np.array([np.mean(self._centres**k) for k in range(order + 1)])

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        upto = np.searchsorted(self._centres, z, side="right")
        sums = [np.concatenate([[0.0], np.cumsum(self._centres**k)]) / self.classes for k in range(3)]
        return sums[0][upto], sums[1][upto], sums[2][upto]

    def quantile(self, probability: Array) -> Array:
        at = np.clip(np.ceil(probability * self.classes) - 1.0, 0.0, self.classes - 1.0)
        return np.asarray(self._centres[at.astype(np.int64)])


@dataclass(frozen=True, slots=True)
class PinMatching:
    """How many classes, the accuracy [um of the radius] with which pins and holes are matched, and the price."""

    classes: int
    accuracy: float
    price: float

    @classmethod
    def of(cls, parameters: Mapping[str, Value]) -> PinMatching | None:
        """None where pins are taken as they come."""
        if CLASSES not in parameters:
            return None
        return cls(int(number(parameters[CLASSES])), 0.5 * number(parameters[ACCURACY]), number(parameters[PRICE]))

    def matched(self, total: ClippedSum, per_um: float) -> ClippedSum:
        """The sum over units [rad] of matched parts; a hole opens phi_2 by `per_um` [rad/um], and a pin closes it."""
        terms = list(total.clipped)
        hole, pin = (terms[TERMS.index(name)] for name in (HOLE, PIN))
        nothing = np.zeros_like(hole.linear)
        for name, term in ((HOLE, hole), (PIN, pin)):
            terms[TERMS.index(name)] = replace(term, linear=term.linear / self.classes)
        terms.append(Term(ClassCentres(self.classes), nothing, hole.linear + pin.linear))
        terms.append(Term(STANDARD_NORMAL, nothing, nothing + per_um * self.accuracy))
        return replace(total, clipped=tuple(terms))

    def added(self, total: ClippedSum) -> tuple[Term, Term]:
        """What the measurement does not tell, and the class centres, of a sum of matched parts."""
        return total.clipped[-1], total.clipped[-2]

    def left_over(self, t: Array) -> Array:
        """Fraction (n,) of the parts without a mate, at half-widths t (n, 2) [um]."""
        error = self.accuracy / np.sqrt(2.0)
        pair = Matching((0, 1), (Uniform(), Uniform()), self.classes, (error, error))
        return np.array([pair.left_over((hole, pin)) for hole, pin in t.tolist()])


def matching_faults(given: Settings, matching: PinMatching, widest: Mapping[str, float]) -> Iterator[Fault]:
    """Faults of pins in classes; `widest` are the widest zones of pins and holes [um]."""
    for name, t in widest.items():
        width, least = 4.0 * t / matching.classes, 4.0 * matching.accuracy
        if width < least:
            yield Fault(
                f"parameters.{CLASSES}",
                f"{matching.classes} classes of {name} are {width:.3g} um of the diameter wide at most, narrower than "
                f"the measurement can tell: the match is known to {2.0 * matching.accuracy:g} um, so that {least:g} um "
                f"is the least width; take fewer classes, or a wider range of variables.{name}",
            )
        setting = given.variables.get(name)
        if setting is not None and setting.distribution not in (None, Uniform()):
            yield Fault(f"variables.{name}.distribution", "must be uniform where pins are sorted into classes")
        if setting is not None and setting.sample is not None:
            yield Fault(
                f"variables.{name}.measured", "is not known for parts that are sorted into classes: leave it out"
            )
        if name in given.machines:
            yield Fault(
                f"variables.{name}.machine", "parts that are sorted into classes have no machines: leave it out"
            )
    if given.promise is not None:
        text = "is not known where pins are sorted into classes: leave [promise] out, and limit yield_percent"
        yield Fault("promise", text)

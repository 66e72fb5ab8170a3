"""Faults of pins and discs: teeth, room, undercut and interference with their angles."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from ....errors import Fault
from ....units import MM, UM
from .geometry import ContactGeometry, curve
from .nominal import Nominal

LEAST_GAP = -1e-9
"""Overlap [m] that still counts as none: the accuracy of nominal gaps."""
_POINTS = 3601


@lru_cache(maxsize=64)
def faults(geometry: ContactGeometry, place: str = "parameters") -> tuple[Fault, ...]:
    """Every fault of the profile, at the keys of a configuration (`dr_p_mm`, `pin_radius_mm`)."""
    return shape_faults(geometry, place) or tuple(interference(geometry, f"{place}.dr_p_mm"))


@lru_cache(maxsize=64)
def shape_faults(geometry: ContactGeometry, place: str = "parameters") -> tuple[Fault, ...]:
    """Faults of the nominal parts, independent of the play of the modification."""
    return (*_teeth(geometry, place), *_pins(geometry, place), *_profile(geometry, place))


def _teeth(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    expected = geometry.nominal.cycloid_teeth + 1
    if geometry.pins != expected:
        yield Fault(
            f"{place}.pins",
            f"must be {expected}, one more than the {expected - 1} teeth of a disc, got "
            f"{geometry.pins}: the profile advances by one tooth per turn of the cranks",
        )
    if geometry.pins % geometry.discs:
        yield Fault(
            f"{place}.discs", f"must divide the {geometry.pins} pins, got {geometry.discs}: the discs would differ"
        )


def _pins(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    """Neighbouring pins of the housing need room."""
    nominal = geometry.nominal
    apart = 2.0 * nominal.pin_circle_radius * np.sin(np.pi / nominal.pins)
    if apart <= 2.0 * nominal.pin_radius:
        yield Fault(
            f"{place}.pin_radius_mm",
            f"neighbouring pins overlap: {nominal.pins} pins on a circle of radius "
            f"{nominal.pin_circle_radius / MM:g} mm are {apart / MM:.4g} mm apart, the pins' "
            f"diameter is {2.0 * nominal.pin_radius / MM:.4g} mm; take thinner or fewer pins or a "
            "larger circle",
        )


def _profile(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    if 0.0 < geometry.nominal.k1 < 1.0:
        yield from _undercut(geometry, place)
    else:
        k1 = f"e z_p/r_p = {geometry.nominal.k1:.4g}"
        yield Fault(f"{place}.eccentricity_mm", f"{k1} must lie between 0 and 1")


def _undercut(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    """The tooth is cut away where C is bent outwards with a radius below that of the offset."""
    phi = np.linspace(0.0, np.pi, _POINTS)
    c = curve(geometry, phi, np.zeros_like(phi))
    bend = np.imag(c.first.conj() * c.second) / np.abs(c.first) ** 3
    offset = geometry.nominal.pin_radius + geometry.dr_rp
    worst = int(np.argmax(bend))
    if bend[worst] * offset >= 1.0:
        yield Fault(
            f"{place}.pin_radius_mm",
            f"the profile is undercut at a profile angle of {np.degrees(phi[worst]):.1f} deg: "
            f"its radius of curvature there, {1.0 / bend[worst] / MM:.3g} mm, is below the pin's "
            f"with the equidistance modification, {offset / MM:.3g} mm; take thinner pins or a "
            "smaller eccentricity",
        )


def interference(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    """A modified profile that leaves no play.

    Symmetric in phi: where a gap is negative, no rotation opens it on both flanks.
    """
    phi = np.linspace(0.0, np.pi, _POINTS)
    gap = Nominal.at(geometry, phi).gap
    worst = int(np.argmin(gap))
    if gap[worst] < LEAST_GAP:
        yield Fault(
            place,
            f"the modified profile interferes with the pins by {-gap[worst] / UM:.3g} um at a "
            f"profile angle of {np.degrees(phi[worst]):.1f} deg (dr_rp {geometry.dr_rp / MM:g} mm, "
            f"dr_p {geometry.dr_p / MM:g} mm); raise dr_rp_mm or lower dr_p_mm",
        )

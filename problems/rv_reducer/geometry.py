"""Faults and warnings of the geometry that a configuration states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from ...declarations import Value, number
from ...errors import Fault
from ...models.rv_reducer.contact.faults import interference, shape_faults
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.population.lattice import nearest_prime, shares_a_factor, spreads_evenly
from ...units import MM
from ..declaration import Interval
from ..settings import Bound, Settings

GEARS = range(8, 41)
"""Numbers of teeth of the sun gear with which a ratio of gears is sought."""
ROUNDING = 0.005
"""Part of a tooth by which a rounded reduction ratio may miss whole teeth of the planet."""
OUT_OF_LINE = 0.02
"""Fraction by which the crank circle may differ from the centre distance of the gears."""
LEAST_GAP_MM = 0.007
"""Radial gap [mm] below which pins that the population leaves out may close the backlash."""
LATTICES = ("positions", "search_positions", "te_positions")


def faults(geometry: ContactGeometry, given: Settings, ends: Mapping[str, Interval]) -> list[Fault]:
    """Every fault of the geometry; `ends` [mm] of `dr_rp_mm` and `dr_p_mm` are their ranges."""
    (_, most), (least, _) = ends["dr_rp_mm"], ends["dr_p_mm"]
    opened = replace(geometry, dr_rp=most * MM, dr_p=least * MM)
    shape = [*shape_faults(opened), *_ratio(geometry, given.parameters), *_cranks(geometry), *_unused(geometry, given)]
    return shape or [*interference(opened, "variables.dr_p_mm")]


def _ratio(geometry: ContactGeometry, given: Mapping[str, Value]) -> Iterator[Fault]:
    place, ratio = "parameters.reduction_ratio", geometry.nominal.reduction_ratio
    teeth = geometry.nominal.cycloid_teeth
    if not geometry.involute_stage and number(given.get("reduction_ratio", teeth)) != teeth:
        text = f"without an involute stage it is the number of teeth of a disc, {teeth}"
        yield Fault(place, f"{text}, got {ratio:g}; leave it out")
    if geometry.involute_stage and ratio <= 1.0:
        text = "must be above 1: it is 1 + pins z2/z1, with the teeth of planet and sun"
        yield Fault(place, f"{text}, got {ratio:g}")


def _cranks(geometry: ContactGeometry) -> Iterator[Fault]:
    nominal = geometry.nominal
    root = nominal.pin_circle_radius - nominal.pin_radius - nominal.eccentricity
    if nominal.centre_distance >= root:
        yield Fault(
            "parameters.centre_distance_mm",
            f"the cranks stand on a radius of {nominal.centre_distance / MM:g} mm, outside of the discs, whose tooth "
            f"roots are at {root / MM:.4g} mm",
        )


def _unused(geometry: ContactGeometry, given: Settings) -> Iterator[Fault]:
    """Faults of settings for an involute stage that does not exist."""
    grade = given.variables.get("involute_grade")
    text = "there is no involute stage (parameters.involute_stage = false): leave it out"
    if not geometry.involute_stage and grade is not None and grade.value is None:
        yield Fault("variables.involute_grade", text)
    if not geometry.involute_stage and "involute_grade" in given.costs:
        yield Fault("costs.involute_grade", text)


# ---------------------------------------------------------------- warnings


def warnings(geometry: ContactGeometry, parameters: Mapping[str, Value], radial_gap: Bound) -> Iterator[str]:
    """Warnings about geometries that are computed but questionable."""
    yield from _gears(geometry)
    for name in LATTICES:
        yield from _lattice(geometry, name, int(number(parameters[name])))
    if radial_gap.low < LEAST_GAP_MM:
        yield (
            f"no limit keeps radial_gap_mm at {LEAST_GAP_MM:g} mm or above: pins near tip and root may close the "
            "backlash of a nearly unmodified profile, and units are computed without these pins"
        )


def _gears(geometry: ContactGeometry) -> Iterator[str]:
    nominal = geometry.nominal
    if not geometry.involute_stage:
        return
    ratio = (nominal.reduction_ratio - 1.0) / nominal.pins
    formula = f"(reduction_ratio - 1)/pins = {ratio:.6g}"
    if all(abs(sun * ratio - round(sun * ratio)) > ROUNDING for sun in GEARS):
        yield (
            f"no pair of gears has the ratio z2/z1 = {formula} with {GEARS[0]} to {GEARS[-1]} teeth of the sun: "
            "reduction_ratio and pins may contradict each other"
        )
    apart = nominal.sun_pitch_radius * (1.0 + ratio)
    if abs(apart / nominal.centre_distance - 1.0) > OUT_OF_LINE:
        yield (
            f"centre_distance_mm is {nominal.centre_distance / MM:g} mm, but planets of a sun of pitch radius "
            f"{nominal.sun_pitch_radius / MM:g} mm with z2/z1 = {formula} stand at {apart / MM:.4g} mm"
        )


def _lattice(geometry: ContactGeometry, name: str, positions: int) -> Iterator[str]:
    if positions <= 1 or spreads_evenly(positions, geometry):
        return
    nominal = geometry.nominal
    why = f"do not cover the turns of disc and cranks evenly ({nominal.cycloid_teeth} teeth)"
    if shares_a_factor(positions, geometry):
        why = (
            f"have a common factor with {nominal.cycloid_teeth} teeth or {nominal.pins} pins, so that the same phases "
            "of the mesh are repeated"
        )
    better = nearest_prime(positions, geometry)
    yield f"{name}: {positions} positions {why}, and the greatest backlash is underestimated; use {better}"

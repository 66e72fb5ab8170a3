"""Staggered assembly of the two discs: backlash against interference, and the parts it takes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....arrays import Array
from ....declarations import Value, number
from ....models.propagation import Convolution, Propagated
from ....models.propagation.sums import ClippedSum
from ....models.rv_reducer import stagger
from ....models.rv_reducer.backlash import BacklashModel
from ....models.rv_reducer.contact.contact import LoadedContact
from ....models.rv_reducer.contact.errors import PartErrors
from ....models.rv_reducer.contact.geometry import ContactGeometry
from ....models.rv_reducer.contact.performance import backlash
from ....models.rv_reducer.geometry import RvGeometry
from ....units import ARCMIN, MM, MRAD, UM
from ..calculation import Calculation, Chart, Computed, ComputedTable
from . import reducer_inputs
from .results import assumed, output, parameter, quantities, tabulated

COVERAGE = 0.9973
ANGLES = 40
"""Crank angles over a pin pitch at which the contact model is evaluated."""


STATISTICS = {
    "backlash_mean_arcmin": "mean of the backlash over units",
    "backlash_std_arcmin": "its standard deviation",
    "backlash_quantile_arcmin": "its quantile at 0.9973",
    "above_limit_percent": "units above the backlash limit",
    "interference_percent": "units that interfere (phi_2 < 0)",
    "backlash_most_arcmin": "largest backlash that the zones allow",
}
OUTPUTS = (
    *(output(name, f"{text}, staggered") for name, text in STATISTICS.items()),
    *(output(f"without_{name}", f"{text}, no stagger") for name, text in STATISTICS.items()),
    output(
        "stagger_for_every_unit_arcmin",
        "least stagger at which the zones allow no unit above "
        "the limit; infinite where the other stages alone exceed it",
    ),
    output("turn_of_disc_arcmin", "the stagger: turn of each disc, one ahead and one back"),
    output("hole_offset_um", "for it: offset of a disc's bearing holes along their circle"),
    output("blank_angle_mrad", "or: angle at which the profile is machined to the holes"),
    output("blank_at_rim_um", "the same on the radius of the pin circle"),
    output("journal_phase_mrad", "or: phase of a disc's journals on all cranks"),
    output("journal_offset_um", "the same as a displacement of the journal's centre"),
    output(
        "contact_by_turn_arcmin", "what the contact model says that turned discs take from the backlash of the discs"
    ),
    output("contact_by_journals_arcmin", "the same of discs on journals ahead and behind"),
)


class StaggeredAssembly(Calculation):
    """Backlash and interference against the stagger, and the parts that make it.

    The stagger is the turn of each disc, one ahead and one back: twice the delta' of document B.
    """

    name = "staggered_assembly"
    about = "Backlash against interference over the stagger of the discs, and the parts it takes."
    reference = "document B, structural adjustment"
    sampled = False
    outputs = OUTPUTS
    parameters = (
        *(parameter for parameter in reducer_inputs.PARAMETERS if parameter.name != "stagger_arcmin"),
        parameter(
            "stagger_arcmin",
            0.2,
            "turn of each disc, one ahead and one back, for the quantities",
            "document B: twice its delta'",
            0.0,
            60.0,
        ),
        assumed("stagger_most_arcmin", 0.6, "end of the sweep", low=0.0, high=60.0, open_low=True),
        assumed("points", 31, "points of the sweep", low=2, high=10_000),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        model = reducer_inputs.model_of(parameters)
        limit = number(parameters["backlash_limit_arcmin"]) * ARCMIN
        at = np.array([0.0, number(parameters["stagger_arcmin"])])
        total = reducer_inputs.total_of(model, parameters, stagger_arcmin=at)
        numbers = _outcome(Convolution().propagate(total, COVERAGE, limit), total, limit, model)
        numbers |= {name: float(column[1]) for name, column in _dimensions(model.geometry, at).items()}
        numbers |= _contact(model.geometry, parameters, at[1] * ARCMIN)
        sweep = np.linspace(0.0, number(parameters["stagger_most_arcmin"]), int(number(parameters["points"])))
        swept = reducer_inputs.total_of(model, parameters, stagger_arcmin=sweep)
        table = _sweep(sweep, Convolution().propagate(swept, COVERAGE, limit))
        return Computed(quantities(numbers), (table, _mountings(sweep, model.geometry)))


def _most(total: ClippedSum) -> tuple[Array, Array]:
    """Largest phi_1 + phi_3 and phi_2 that the zones allow [rad], each (n,)."""
    free, clipped = (np.sum([term.bounds()[1] for term in part], axis=0) for part in (total.free, total.clipped))
    return free, clipped


def _outcome(propagated: Propagated, total: ClippedSum, limit: float, model: BacklashModel) -> dict[str, float]:
    """Without and with the stagger (rows 0 and 1)."""
    free, clipped = _most(total)
    worst = free + np.maximum(clipped, 0.0)
    columns = _statistics(propagated) | {"backlash_most_arcmin": worst / ARCMIN}
    named = {
        f"{prefix}{name}": float(column[row])
        for row, prefix in ((0, "without_"), (1, ""))
        for name, column in columns.items()
    }
    needed = np.maximum(free[0] + clipped[0] - limit, 0.0) / (model.output_factor * model.stagger_gain)
    reached = needed if free[0] <= limit else np.inf
    return named | {"stagger_for_every_unit_arcmin": float(reached) / ARCMIN}


def _statistics(propagated: Propagated) -> dict[str, Array]:
    return {
        "backlash_mean_arcmin": propagated.mean.value / ARCMIN,
        "backlash_std_arcmin": propagated.std.value / ARCMIN,
        "backlash_quantile_arcmin": propagated.quantile.value / ARCMIN,
        "above_limit_percent": 100.0 * (1.0 - propagated.conforming.value),
        "interference_percent": 100.0 * propagated.negative.value,
    }


def _dimensions(geometry: RvGeometry, staggers: Array) -> dict[str, Array]:
    """What a disc is turned by, and each alternative to do it; the other disc is the opposite."""
    parts = stagger.parts(geometry, staggers * ARCMIN)
    return {
        "turn_of_disc_arcmin": staggers,
        "hole_offset_um": parts.hole_offset / UM,
        "blank_angle_mrad": parts.blank_angle / MRAD,
        "blank_at_rim_um": parts.at_rim / UM,
        "journal_phase_mrad": parts.journal_phase / MRAD,
        "journal_offset_um": parts.at_journal / UM,
    }


def _contact(geometry: RvGeometry, parameters: Mapping[str, Value], turn: float) -> dict[str, float]:
    """What the contact model says that the discs' turn takes from the backlash of the discs."""
    dr_rp, dr_p = (number(parameters[name]) * MM for name in ("dr_rp_mm", "dr_p_mm"))
    contact = LoadedContact(ContactGeometry(geometry, dr_rp, dr_p), exact=True)
    phase = float(stagger.parts(geometry, np.array([turn])).journal_phase[0])
    mountings = {
        "": PartErrors(),
        "contact_by_turn_arcmin": PartErrors(angle=np.array([[turn, -turn]])),
        "contact_by_journals_arcmin": PartErrors(crank_phase=np.array([[[-phase, phase]]])),
    }
    angles = 2.0 * np.pi / geometry.pins * np.arange(ANGLES) / ANGLES
    ratio = contact.geometry.output_ratio / ARCMIN
    play = {name: backlash(contact, errors, angles).mean() * ratio for name, errors in mountings.items()}
    return {name: float(play[""] - value) for name, value in play.items() if name}


def _sweep(sweep: Array, propagated: Propagated) -> ComputedTable:
    columns = {"stagger_arcmin": sweep} | _statistics(propagated)
    meaning = "Backlash (quantile at 0.9973) and interference (phi_2 < 0) over the stagger"
    chart = Chart("lines", "stagger_arcmin", ("above_limit_percent", "interference_percent"))
    return tabulated("sweep", meaning, columns, chart)


def _mountings(sweep: Array, geometry: RvGeometry) -> ComputedTable:
    columns = {"stagger_arcmin": sweep} | _dimensions(geometry, sweep)
    meaning = (
        "Three mountings to the stagger, each alone, of either disc (the other one opposite): bearing "
        "holes offset along their circle, blank turned to its holes, journals of all cranks ahead"
    )
    return tabulated("ways", meaning, columns)

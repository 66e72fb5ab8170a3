"""One unit over a turn and the population of a design, as tables for a reader."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ...arrays import Array
from ...declarations import Value, number
from ...models.rv_reducer.population.gradient import Slopes
from ...models.rv_reducer.population.lattice import Lattice, turn_lattice
from ...models.rv_reducer.population.turn import Population
from ...records import UnitsShown
from .evaluation import Evaluation

FINE = 1021
"""Positions of a turn at which the one unit is drawn: a prime, 26 to a turn of the crank."""
BINS = 80
"""Steps of the distribution over units."""
INTERFERENCE = {
    "turn_mean": "the mean of the cycloid stage's backlash over the turn is below zero",
    "share_of_turn": "the cycloid stage's backlash is below zero, as a fraction of all positions of all units",
    "overlap": "the flanks overlap by more than {overlap:g} arcmin at one of the positions",
    "preload": "the flanks are preloaded by more than {preload:g} % of the rated torque",
}
"""What counts as interference, by the parameter of that name."""


def units_shown(evaluation: Evaluation, parameters: Mapping[str, Value]) -> UnitsShown:
    """The tables of an evaluated design, and what they mean in words."""
    turn = _turn(evaluation)
    return UnitsShown(_words(evaluation, parameters, turn), turn, _population(evaluation))


def _largest(evaluation: Evaluation) -> Array:
    """Largest backlash of the cycloid stage over the turn (units,) [arcmin]."""
    return np.asarray(np.maximum(evaluation.turn.play.max(axis=0).astype(float), 0.0))


def _turn(evaluation: Evaluation) -> pd.DataFrame:
    """The unit whose largest backlash is the median, at the mean of phi_1.

    `measured` marks the positions of the population; between them the turn is drawn finely.
    """
    largest = _largest(evaluation)
    unit = int(np.argsort(largest, kind="stable")[len(largest) // 2])
    rough = evaluation.turn.play[:, unit].astype(float)
    fine = _population_of_one(evaluation, unit).turn(evaluation.design).play[:, 0].astype(float)
    count = (len(rough), len(fine))
    play = np.concatenate([rough, fine])
    frame = pd.DataFrame(
        {
            "turn_deg": np.concatenate([360.0 * (np.arange(n) + 0.5) / n for n in count]),
            "cycloid_arcmin": play,
            "backlash_arcmin": evaluation.involute.mean + np.maximum(play, 0.0),
            "measured": np.arange(sum(count)) < count[0],
        }
    )
    return frame.sort_values(["turn_deg", "measured"], kind="stable", ignore_index=True)


def _population_of_one(evaluation: Evaluation, unit: int) -> Population:
    """A population of one unit at `FINE` positions."""
    geometry = evaluation.model.geometry
    sample = evaluation.drawn.rigid.sample.part(slice(unit, unit + 1))
    lattice = Lattice.of(geometry, turn_lattice(FINE, geometry.nominal.cycloid_teeth))
    return Population(lattice, sample, Slopes.of(geometry, sample), evaluation.drawn.rigid.engine)


def _population(evaluation: Evaluation) -> pd.DataFrame:
    """Fraction of units up to each value of their largest backlash, phi_1 integrated."""
    largest = _largest(evaluation)
    low, high = evaluation.involute.ends()
    at = np.linspace(low + largest.min(), high + largest.max(), BINS + 1)
    within = 100.0 * np.array([float(np.mean(evaluation.involute.cdf(v - largest))) for v in at])
    change, mean = evaluation.model.change, float(largest.mean()) + evaluation.involute.mean
    moved = mean + change.effective + (1.0 + change.growth) * (at - mean)  # outside the contact
    return pd.DataFrame(
        {
            "backlash_max_arcmin": moved,
            "share_within_percent": within,
            "share_percent": np.diff(within, prepend=within[0]),
        }
    )


def _words(evaluation: Evaluation, parameters: Mapping[str, Value], turn: pd.DataFrame) -> tuple[str, ...]:
    conditions, drawn = evaluation.model.conditions, evaluation.drawn.rigid
    positions, percent = drawn.lattice.shape[0], 100.0 * conditions.coverage
    measured = turn.loc[turn["measured"], "backlash_arcmin"].max()
    kind = INTERFERENCE[conditions.interference].format(
        overlap=conditions.overlap, preload=number(parameters["preload_percent_of_rated"])
    )
    stage = (
        f"The involute stage adds the backlash phi_1 of the unit, {evaluation.involute.mean:.3g} arcmin in the mean; "
        "it is the same at all positions, and its distribution over units is integrated exactly, not drawn."
        if parameters["involute_stage"]
        else "There is no involute stage."
    )
    words = [
        "The backlash of a unit at a position is the angle by which the carrier (the output) turns from one flank to "
        "the other with the sun (the input) held: zero torque, rigid parts, play of the crank bearings included.",
        f"It is computed at {positions} positions, evenly over one turn of the output; the largest of them is the "
        "backlash of the unit. Between the positions it can be larger: the unit drawn here reaches "
        f"{turn['backlash_arcmin'].max():.4g} arcmin over the whole turn, and {measured:.4g} at the positions.",
        f"backlash_max_arcmin is the value that {percent:g} % of the units stay within (one-sided quantile, from "
        f"{drawn.units} fresh units); yield_percent is the percentage of units within {conditions.limit:g} arcmin.",
        stage,
        f"Interference: {kind} (interference_probability). Where flanks interfere at zero torque the backlash of the "
        "cycloid stage counts as zero: the flat parts of the first figure.",
    ]
    if evaluation.model.change.outside:
        words.append("What effects add to the contact is in the population and not in the unit that is drawn.")
    return tuple(words)

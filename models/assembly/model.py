"""The model `assembly` of successive reducers as measured on the assembly line, and its declarations by the
names of configurations.

The declarations are those of the problem `rv_transmission_error` as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault, InputError, refuse
from ...section import Array, Output, Parameter, Value
from ...units import MRAD
from ..inputs import Distribution
from ..measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Outside, Role, ranks_of_units
from .assemble import Departures, assemble
from .process import (
    INSERTIONS,
    READINGS,
    DatumFlowChain,
    Estimator,
    Process,
    gains,
    kalman,
    plane_process,
    terminal_weight,
)

_TABLE = "document A, table of steps"
STEPS = 4
FLOW, DIAGONAL = "error_flow", "final_weights"
TRANSITIONS = tuple(f"transition_{k}" for k in range(1, STEPS + 1))

PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        "reading",
        "printed",
        "",
        "quantities that the precision weight acts on: every angle (printed), or the "
        "combined errors y = C x of the document's cost (consistent)",
        "document A",
        choices=READINGS,
    ),
    Parameter(
        "insertion",
        "before",
        "",
        "whether step k adjusts before part k is installed (printed) or after",
        "document A",
        choices=INSERTIONS,
    ),
    Parameter(
        "hangs_on",
        (0.0, 1.0, 0.0, 3.0),
        "",
        "datum flow chain: the number of the part that "
        "crankshaft 1, gear 1, crankshaft 2, gear 2 hang on; 0 is the housing",
        "document A",
    ),
    Parameter(
        FLOW,
        (),
        "",
        "F (4 x 4, row by row): column k is what the error of part k moves at its installation; empty: B, from "
        "hangs_on, which is what its adjustment moves",
        "document A: F = B",
    ),
    *(
        Parameter(
            name,
            (),
            "",
            f"A at step {k} (4 x 4, row by row): what the angles before step {k} become after it; empty: identity",
            "document A: A = I",
        )
        for k, name in enumerate(TRANSITIONS, 1)
    ),
    Parameter(
        DIAGONAL,
        (),
        "",
        "diagonal of Q(N) over precision_weight: a weight for each final angle, with the reading consistent for each "
        "combined error; empty: 1 each",
        "document A: Q(4) = Q I",
        low=0.0,
    ),
    Parameter("adjustment_weights_1", (5.0, 1000.0, 1000.0, 1000.0), "", "R at step 1", _TABLE),
    Parameter("adjustment_weights_2", (10.0, 5.0, 1000.0, 1000.0), "", "R at step 2", _TABLE),
    Parameter("adjustment_weights_3", (10.0, 5.0, 5.0, 1000.0), "", "R at step 3", _TABLE),
    Parameter("adjustment_weights_4", (10.0, 5.0, 10.0, 5.0), "", "R at step 4", _TABLE),
    Parameter(
        "absent_weight",
        1000.0,
        "",
        "the weight from which a part counts as not adjustable",
        _TABLE,
        low=0.0,
        open_low=True,
    ),
    Parameter(
        "measurement_std_mrad",
        0.0,
        "mrad",
        "standard deviation of each angle measured during assembly; 0: the state is known",
        "assumed: exact, as the document computes",
        assumed=True,
        low=0.0,
        high=1e3,
    ),
    Parameter(
        "measured",
        "angles",
        "",
        "quantities of the installed parts that each step measures: every angle, or the combined errors C x",
        "assumed",
        assumed=True,
        choices=("angles", "combined"),
    ),
)
"""Parameters of both."""

PART_STD = Parameter(
    "part_std_mrad",
    3.0,
    "mrad",
    "standard deviation of part errors that the estimate assumes where measurement_std_mrad is above 0",
    "assumed: rms of the document's four errors is 4.3",
    assumed=True,
    low=0.0,
    high=1e3,
)


def completed(parameters: Mapping[str, Value]) -> dict[str, Any]:
    """Parameters by name; omitted ones keep their defaults."""
    return {p.name: p.default for p in (*PARAMETERS, PART_STD)} | dict(parameters)


def process_of(parameters: Mapping[str, Value]) -> Process:
    """The process about one axis, of parameters by declared name.

    Raises InputError with every fault, placed below `parameters`.
    """
    p = completed(parameters)
    weights = np.array([p[f"adjustment_weights_{k}"] for k in range(1, STEPS + 1)], dtype=float)
    hangs_on = np.array(p["hangs_on"], dtype=float)
    faults = list(_matrix_faults(p))
    if np.any(hangs_on != np.rint(hangs_on)):
        faults.append(Fault("hangs_on", f"must hold whole numbers, got {p['hangs_on']}"))
    else:
        try:
            chain = DatumFlowChain(tuple(hangs_on.astype(int).tolist()))
            faults += _diagonal_faults(p, len(chain.observation()))
            error, *transition = (_matrix(p[name]) for name in (FLOW, *TRANSITIONS))
            if not faults:
                steps = np.stack([np.eye(STEPS) if a is None else a for a in transition])
                return plane_process(chain, weights, float(p["absent_weight"]), steps, error)
            plane_process(chain, weights, float(p["absent_weight"]))
        except InputError as error_of_chain:
            faults += error_of_chain.faults
    raise InputError(Fault(f"parameters.{f.place.replace('chain.', '')}", f.message) for f in faults)


def _matrix(values: Sequence[float]) -> Array | None:
    """The square matrix that a list holds row by row, None where it is empty or does not fit."""
    return np.array(values, dtype=float).reshape(STEPS, STEPS) if len(values) == STEPS**2 else None


def _matrix_faults(p: Mapping[str, Any]) -> Iterator[Fault]:
    for name in (FLOW, *TRANSITIONS):
        if len(p[name]) not in (0, STEPS**2):
            text = f"must be empty or hold {STEPS**2} numbers ({STEPS} x {STEPS}, row by row), got {len(p[name])}"
            yield Fault(name, text)
        elif not np.all(np.isfinite(p[name])):
            yield Fault(name, f"must be finite, got {p[name]}")


def _diagonal_faults(p: Mapping[str, Any], combined: int) -> Iterator[Fault]:
    values = np.array(p[DIAGONAL], dtype=float)
    count, what = (combined, "combined errors") if p["reading"] == "consistent" else (STEPS, "final angles")
    if len(values) not in (0, count):
        yield Fault(DIAGONAL, f"must be empty or hold a weight for each of the {count} {what}, got {len(values)}")
    elif len(values) and not (np.all(np.isfinite(values) & (values >= 0.0)) and values.any()):
        text = f"must be finite and at least 0 with one above 0 (Q may not be negative), got {p[DIAGONAL]}"
        yield Fault(DIAGONAL, text)


def gains_of(process: Process, parameters: Mapping[str, Value], precision: Array) -> Array:
    """Gains (n, N, m, n) of precision weights (n,), about one axis or in space."""
    p = completed(parameters)
    diagonal = np.repeat(np.array(p[DIAGONAL], dtype=float), process.transition.shape[-1] // STEPS)
    weights = terminal_weight(process, precision, str(p["reading"]), diagonal if len(diagonal) else None)
    return gains(process, weights)


def estimator_of(process: Process, parameters: Mapping[str, Value], part_std: Array) -> Estimator | None:
    """The estimator under measurement noise, None where the state is known; `part_std` [rad]."""
    p = completed(parameters)
    noise = float(p["measurement_std_mrad"]) * MRAD
    if noise == 0.0 and p["measured"] == "angles":
        return None
    measured = process.observation if p["measured"] == "combined" else None
    return kalman(process, part_std, noise, str(p["insertion"]), measured)


# Assemblies of successive reducers, as measured on the assembly line.


PARTS = ("crankshaft 1", "gear 1", "crankshaft 2", "gear 2")


class Assembly(MeasurableModel):
    """Angles of the key characteristics after the adjusted assembly of each unit (document A).

    x(k+1) = x(k) + B u(k) + F w(k) about one axis, u(k) = -K(k) x(k) with the gains of the row's
    precision weight. Effects may change the following quantities, each 0 by default:

    - `adjustment_gain_error` g: the achieved adjustment is (1 + g) times the commanded one.
    - `adjustment_backlash_mrad` b >= 0: dead band; a commanded adjustment u moves
      sign(u) max(|u| - b, 0), times 1 + g.
    - `chain_coupling` c: when a part of chain 2 is installed and moves delta_3 and delta_4 by
      F w(k), delta_1 and delta_2 move by c times that.
    - `springback` s: after the last step, s times the sum of all achieved B u(k) returns.

    The adjuster measures the actual state: later steps correct the residuals of earlier ones.
    """

    columns = (
        Column("unit", "", "name or number of the unit", text=True, role=Role.UNIT),
        *(
            Column(f"dtheta_{at}_mrad", "mrad", f"angular error of {part} before assembly")
            for at, part in enumerate(PARTS, 1)
        ),
        Column("precision_weight", "", "weight Q of the final error; 0: no adjustment"),
    )
    outputs = tuple(
        Output(f"delta_{at}_mrad", "mrad", f"final angle of {part} (KC{at}) to the housing")
        for at, part in enumerate(PARTS, 1)
    )
    parameters = (*PARAMETERS, PART_STD)
    free: ClassVar[Mapping[str, float]] = {}
    corrects = ("rv_transmission_error",)
    made_to_a_drawing = True
    geometry = ("reading", "insertion", "hangs_on")
    changeable = (
        Changeable("adjustment_gain_error", "", "relative error of the achieved adjustment"),
        Changeable("adjustment_backlash_mrad", "mrad", "dead band of every adjustment"),
        Changeable("chain_coupling", "", "fraction of the movement by installing chain 2 that chain 1 follows"),
        Changeable("springback", "", "fraction of the total adjustment that returns at the end"),
    )

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        self.values = values = completed(parameters or {})
        self.process, self.insertion = process_of(values), str(values["insertion"])
        prior = np.full(self.process.steps, float(values["part_std_mrad"]) * MRAD)
        self.estimator = estimator_of(self.process, values, prior)
        self.noise = float(values["measurement_std_mrad"]) * MRAD

    def gains(self, precision: Array) -> Array:
        """Gains (n, N, m, n) of precision weights (n,). Raises InputError below zero."""
        wrong = np.flatnonzero(~(np.isfinite(precision) & (precision >= 0.0)))
        if len(wrong):
            text = f"must be at least 0, got {precision[wrong[0]]:g} in row {wrong[0] + 1}"
            raise refuse("precision_weight", text)
        weights, row = np.unique(precision, return_inverse=True)
        return gains_of(self.process, self.values, weights)[row]

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        weight = np.asarray(table["precision_weight"], dtype=float)
        return {"precision_weight": (weight < 0.0, "must be at least 0 (0: no adjustment)")}

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        errors = np.stack([table[f"dtheta_{at}_mrad"] for at in range(1, 5)], axis=1) * MRAD
        departures = Departures(
            gain_error=changes.get("adjustment_gain_error", 0.0),
            dead_band=np.asarray(changes.get("adjustment_backlash_mrad", 0.0)) * MRAD,
            coupling=changes.get("chain_coupling", 0.0),
            springback=changes.get("springback", 0.0),
        )
        deviations = assemble(
            self.process,
            self.gains(np.asarray(table["precision_weight"], dtype=float)),
            errors,
            self.insertion,
            departures,
            self.estimator,
            self._measurement_noise(table, len(errors), rng),
        )
        return {f"delta_{at}_mrad": deviations.state[:, at - 1] / MRAD for at in range(1, 5)}

    def _measurement_noise(
        self, table: Mapping[str, NDArray[Any]], count: int, rng: np.random.Generator
    ) -> Array | None:
        """Noise (n, N, q) [rad] of the measurements during assembly, None where there is none."""
        if self.estimator is None or self.noise == 0.0:
            return None
        steps, _, measurements = self.estimator.gain.shape
        noise = self.noise * rng.standard_normal((count, steps, measurements))
        return noise[ranks_of_units(table)] if "unit" in table else noise

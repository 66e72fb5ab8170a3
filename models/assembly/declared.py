"""Declarations of the assembly models, by the names of configurations.

Shared by the model `assembly` and the problem `rv_transmission_error`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...arrays import Array
from ...declarations import Parameter, Value
from ...errors import Fault, InputError, refuse
from ...units import MRAD
from .chain import DatumFlowChain
from .estimator import Estimator, kalman
from .process import Process
from .regulator import INSERTIONS, READINGS

_TABLE = "document A, table of steps"
STEPS = 4

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


def process_of(parameters: Mapping[str, Value], build: Callable[[DatumFlowChain, Array, float], Process]) -> Process:
    """The process (`plane_process`, `space_process`) of parameters by declared name.

    Raises InputError with every fault, placed below `parameters`.
    """
    p = completed(parameters)
    weights = np.array([p[f"adjustment_weights_{k}"] for k in range(1, STEPS + 1)], dtype=float)
    hangs_on = np.array(p["hangs_on"], dtype=float)
    if np.any(hangs_on != np.rint(hangs_on)):
        raise refuse("parameters.hangs_on", f"must hold whole numbers, got {p['hangs_on']}")
    try:
        chain = DatumFlowChain(tuple(hangs_on.astype(int).tolist()))
        return build(chain, weights, float(p["absent_weight"]))
    except InputError as error:
        places = (fault.place.replace("chain.", "") for fault in error.faults)
        raise InputError(
            Fault(f"parameters.{place}", fault.message) for place, fault in zip(places, error.faults, strict=True)
        ) from error


def estimator_of(process: Process, parameters: Mapping[str, Value], part_std: Array) -> Estimator | None:
    """The estimator under measurement noise, None where the state is known; `part_std` [rad]."""
    p = completed(parameters)
    noise = float(p["measurement_std_mrad"]) * MRAD
    if noise == 0.0 and p["measured"] == "angles":
        return None
    measured = process.observation if p["measured"] == "combined" else None
    return kalman(process, part_std, noise, str(p["insertion"]), measured)

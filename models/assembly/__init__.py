"""Assembly as a state-space process: part errors propagate, adjustments reduce them."""

from __future__ import annotations

from .assemble import Assembled, Departures, assemble
from .chain import AdjustmentWeights, DatumFlowChain
from .estimator import Estimator, kalman
from .process import Process, plane_process, space_process
from .regulator import INSERTIONS, READINGS, gains, terminal_weight
from .response import Response, response

__all__ = [
    "INSERTIONS",
    "READINGS",
    "AdjustmentWeights",
    "Assembled",
    "DatumFlowChain",
    "Departures",
    "Estimator",
    "Process",
    "Response",
    "assemble",
    "gains",
    "kalman",
    "plane_process",
    "response",
    "space_process",
    "terminal_weight",
]

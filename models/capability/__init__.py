"""Inference from measured parts on the process that made them."""

from .knowledge import (
    Aim,
    Knowledge,
    Level,
    Norm,
    Prior,
    Processes,
    Surplus,
    Ways,
    calibrated,
    draw_cumulants,
    fraction_within_limits,
    knowledge_of,
    norm_of,
)
from .samples import PartSample, read_sample
from .subpopulations import subpopulations

__all__ = [
    "Aim",
    "Knowledge",
    "Level",
    "Norm",
    "PartSample",
    "Prior",
    "Processes",
    "Surplus",
    "Ways",
    "calibrated",
    "draw_cumulants",
    "fraction_within_limits",
    "knowledge_of",
    "norm_of",
    "read_sample",
    "subpopulations",
]

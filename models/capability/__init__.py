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
    fraction_within_limits,
    knowledge_of,
    norm_of,
)
from .knowledge import draw_cumulants as cumulants_drawn
from .samples import PartSample, read_sample

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
    "cumulants_drawn",
    "fraction_within_limits",
    "knowledge_of",
    "norm_of",
    "read_sample",
]

"""Inference from measured parts on the process that made them."""

from .bootstrap import cumulants_drawn, fraction_within_limits
from .choosing import Aim, Level, Processes, Ways, calibrated
from .knowledge import Knowledge, Prior, knowledge_of
from .norm import Norm, Surplus, norm_of
from .reading import PartSample, read_sample

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

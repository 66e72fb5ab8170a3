"""Inference from measured parts on the process that made them."""

from .bootstrap import cumulants_drawn, fraction_within_limits
from .choosing import Aim, Level, Processes, Ways, calibrated
from .indices import Index, capability
from .knowledge import Gauge, Knowledge, Prior, knowledge_of
from .norm import Norm, Surplus, norm_of
from .reading import PartSample, read_sample
from .stability import Finding, distribution_type, findings

__all__ = [
    "Aim",
    "Finding",
    "Gauge",
    "Index",
    "Knowledge",
    "Level",
    "Norm",
    "PartSample",
    "Prior",
    "Processes",
    "Surplus",
    "Ways",
    "calibrated",
    "capability",
    "cumulants_drawn",
    "distribution_type",
    "findings",
    "fraction_within_limits",
    "knowledge_of",
    "norm_of",
    "read_sample",
]

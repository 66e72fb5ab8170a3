"""What measured parts tell of the process that made them."""

from __future__ import annotations

from .indices import Index, capability
from .knowledge import Gauge, Knowledge, Prior, knowledge_of
from .reading import PartSample, read_sample
from .stability import Finding, distribution_type, findings

__all__ = [
    "Finding",
    "Gauge",
    "Index",
    "Knowledge",
    "PartSample",
    "Prior",
    "capability",
    "distribution_type",
    "findings",
    "knowledge_of",
    "read_sample",
]

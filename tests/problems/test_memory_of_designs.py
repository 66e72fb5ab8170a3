"""What a design was tried with goes when the design does, not when Python searches for cycles.

The arrays of one design take a megabyte and more and few objects, so that a search is rare: memory
of a run grew by 1 MB with every design.
"""

from __future__ import annotations

import gc
import weakref

import pytest

from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.rv_reducer.declared import MEASURES
from tolevo.problems.settings import Settings

SMALL = {"report_units": 64, "search_units": 64, "elastic_units": 16, "te_positions": 31}


@pytest.mark.parametrize("kind", ["mean", "share_of_turn", "overlap"])
def test_a_design_leaves_nothing_behind(kind: str) -> None:
    problem = RvReducer(Settings(parameters={**SMALL, "interference": kind}))
    design = problem.complete(0.5 * (problem.xl + problem.xu)[None, :])[0]
    gc.disable()
    try:
        tried = problem.evaluation(design, searching=False)
        for name in MEASURES:
            tried.value(name)
            tried.gradient(name)
        measures = weakref.ref(tried.measures)
        assert measures() is not None
        del tried
        assert measures() is None
    finally:
        gc.enable()

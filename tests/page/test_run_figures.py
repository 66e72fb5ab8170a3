"""Figures of a run for papers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

from tolevo.page.drawing import as_svg
from tolevo.page.figures import convergence_figure
from tolevo.page.page import figures
from tolevo.records import Axis, RunResult


@pytest.fixture
def result() -> RunResult:
    front = pd.DataFrame({"a_um": [4.0, 2.0], "b_mm": [0.5, 0.0], "cost": [1.0, 2.0],
                          "error_um": [2.0, 1.0], "knee": [False, True]})  # fmt: skip
    references = pd.DataFrame({"label": ["document $x$"], "feasible": [True], "cost": [3.0],
                               "error_um": [1.5], "a_um": [4.0], "b_mm": [0.1]})  # fmt: skip
    convergence = pd.DataFrame({"evaluations": [10, 20], "hypervolume": [0.5, 0.6],
                                "hypervolume_ratio": [0.8, 0.9],
                                "feasible_fraction": [1.0, 1.0]})  # fmt: skip
    contributions = pd.DataFrame({"point": [0, 1], "output": "error_um", "explained": "error_um",
                                  "a_um": [80.0, -30.0], "b_mm": [20.0, 70.0]})  # fmt: skip
    return RunResult(
        "t", front, references, convergence, {}, (Axis("cost", ""), Axis("error_um", "um")),
        (Axis("a_um", "um"), Axis("b_mm", "mm")),
        choices=pd.DataFrame({"choice": ["knee"], "meaning": ["m"], "point": [1]}),
        contributions=contributions, exact_front=front[["cost", "error_um"]] * 0.9,
    )  # fmt: skip


def only(result: RunResult, name: str) -> Axes:
    (axes,) = figures(result)[name].axes
    return axes


def widths(axes: Axes) -> list[float]:
    return [patch.get_width() for patch in axes.patches]  # type: ignore[attr-defined]


def test_tolerances_over_those_of_the_document(result: RunResult) -> None:
    axes = only(result, "tolerances")
    assert widths(axes) == [0.5]  # b is 0 at the knee: it has no ratio
    assert [text.get_text() for text in axes.get_yticklabels()] == ["a, 2 um"]
    assert axes.get_xlabel() == "knee / document $x$"


def test_tolerances_without_a_document_have_their_units(result: RunResult) -> None:
    axes = only(replace(result, references=pd.DataFrame()), "tolerances")
    assert widths(axes) == pytest.approx([2.0])
    assert [text.get_text() for text in axes.get_yticklabels()] == ["a [um]"]
    assert axes.get_xscale() == "log"


def test_contributions_of_the_chosen_point_with_their_sign(result: RunResult) -> None:
    axes = only(result, "contributions")
    assert widths(axes) == [-30.0, 70.0]
    assert axes.get_xlabel() == "share in error [%]"


def test_convergence_has_the_exact_value_as_a_line(result: RunResult) -> None:
    upper, _ = convergence_figure(result.convergence).axes
    assert np.asarray(upper.lines[0].get_ydata()).tolist() == [0.8, 0.9]
    assert np.asarray(upper.lines[1].get_ydata()).tolist() == [1.0, 1.0]
    unknown = result.convergence.assign(hypervolume_ratio=np.nan)
    upper, _ = convergence_figure(unknown).axes
    assert len(upper.lines) == 1


def test_the_exact_front_is_drawn(result: RunResult) -> None:
    drawn = {str(line.get_label()): line for line in only(result, "front").lines}
    assert np.asarray(drawn["exact front"].get_xdata()).tolist() == pytest.approx([0.9, 1.8])


def test_same_bytes_every_time(result: RunResult) -> None:
    first, second = ({n: as_svg(f) for n, f in figures(result).items()} for _ in range(2))
    assert set(first) == {"front", "convergence", "contributions", "tolerances"}
    assert first == second


def test_what_is_not_known_is_not_drawn(result: RunResult) -> None:
    nothing = replace(result, choices=None, contributions=None, convergence=pd.DataFrame())
    assert set(figures(nothing)) == {"front"}

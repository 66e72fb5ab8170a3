from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tolevo.page import front_figure
from tolevo.page.drawing import as_png, as_svg, axis_label
from tolevo.page.figures import pictures
from tolevo.records import Axis, RunResult

COST = Axis("cost", "")
BACKLASH = Axis("backlash_arcmin", "arcmin")


@pytest.fixture
def result() -> RunResult:
    front = pd.DataFrame(
        {
            "cost": [12.0, 10.0, 11.0],
            "backlash_arcmin": [1.0, 2.0, 1.2],
            "radial_gap_mm": [0.03, 0.03, 0.03],
            "knee": [False, False, True],
        }
    )
    references = pd.DataFrame(
        {
            "label": ["document", "_staggered $x$"],
            "feasible": [True, False],
            "cost": [12.5, 12.6],
            "backlash_arcmin": [1.4, 0.9],
        }
    )
    return RunResult("t", front, references, pd.DataFrame(), {}, (COST, BACKLASH))


def saved(result: RunResult) -> dict[str, bytes]:
    return pictures(result)


def test_axis_label_has_the_unit_once() -> None:
    assert axis_label(BACKLASH) == "backlash [arcmin]"
    assert axis_label(COST) == "cost"
    assert axis_label(Axis("yield_percent", "%")) == "yield [%]"


def test_front_is_drawn_in_the_order_of_the_first_objective(result: RunResult) -> None:
    (axes,) = front_figure(result).axes
    assert np.asarray(axes.lines[0].get_xdata()).tolist() == [10.0, 11.0, 12.0]
    assert axes.get_xlabel() == "cost"
    assert axes.get_ylabel() == "backlash [arcmin]"


def test_knee_is_marked(result: RunResult) -> None:
    (axes,) = front_figure(result).axes
    assert np.asarray(axes.lines[1].get_xdata()).tolist() == [11.0]
    assert axes.lines[1].get_label() == "knee"


def test_references_are_distinct_and_hollow_where_infeasible(result: RunResult) -> None:
    (axes,) = front_figure(result).axes
    feasible, broken = axes.lines[2:]
    assert feasible.get_marker() != broken.get_marker()
    assert feasible.get_markerfacecolor() == feasible.get_markeredgecolor()
    assert broken.get_markerfacecolor() == "white"
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()][2:] == ["document", "staggered $x$ (breaks limits)"]


def test_same_bytes_every_time(result: RunResult) -> None:
    first, second = saved(result), saved(result)
    assert first == second
    assert first["front.png"].startswith(b"\x89PNG")
    assert b"<svg" in first["front.svg"]


def test_no_date_and_no_version_in_the_files(result: RunResult) -> None:
    files = saved(result)
    assert b"dc:date" not in files["front.svg"]
    assert b"Software" not in files["front.png"]


def test_letters_are_outlines(result: RunResult) -> None:
    assert b"<text" not in saved(result)["front.svg"]


def test_three_objectives_show_the_first_two_without_a_line(result: RunResult) -> None:
    three = replace(result, objectives=(COST, BACKLASH, Axis("radial_gap_mm", "mm")))
    (axes,) = front_figure(three).axes
    assert axes.lines[0].get_linestyle() == "None"
    assert "projection" in axes.get_title()


def test_one_objective(result: RunResult) -> None:
    (axes,) = front_figure(replace(result, objectives=(COST,))).axes
    assert axes.lines[0].get_label() == "best found"
    assert len(axes.lines) == 3


@pytest.mark.parametrize("objectives", [(COST, BACKLASH), (COST,), ()])
def test_nothing_found(result: RunResult, objectives: tuple[Axis, ...]) -> None:
    empty = replace(result, front=pd.DataFrame(), references=pd.DataFrame(), objectives=objectives)
    figure = front_figure(empty)
    assert figure.axes[0].texts[0].get_text() == "no feasible point"
    assert as_png(figure)
    assert as_svg(figure)


def test_letters_that_the_font_lacks_do_not_stop_a_run(result: RunResult) -> None:
    references = result.references.assign(label=["基準", "b"])
    assert saved(replace(result, references=references))


def test_proven_bounds_are_drawn_where_there_are_any(result: RunResult) -> None:
    bound = result.front.assign(bound=[11.5, 9.5, 10.5])
    (axes,) = front_figure(replace(result, front=bound)).axes
    drawn = {str(line.get_label()): line for line in axes.lines}
    assert np.asarray(drawn["proven bound of the cost"].get_xdata()).tolist() == [9.5, 10.5, 11.5]
    assert np.asarray(drawn["proven bound of the cost"].get_ydata()).tolist() == [2.0, 1.2, 1.0]
    nothing = result.front.assign(bound=np.nan)
    (axes,) = front_figure(replace(result, front=nothing)).axes
    assert "proven bound of the cost" not in [line.get_label() for line in axes.lines]

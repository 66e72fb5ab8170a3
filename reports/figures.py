"""The figures of a run for a paper, in a common style."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..records import RunResult
from .contributions import contributions_figure
from .convergence import convergence_figure
from .figure import front_figure
from .tolerances import tolerances_figure
from .units import population_figure, turn_figure


def figures(result: RunResult) -> dict[str, Figure]:
    """Figures by the stem of their files; those without data are omitted."""
    drawn = {
        "front": front_figure(result) if result.objectives else None,
        "convergence": None if result.convergence.empty else convergence_figure(result.convergence),
        "contributions": contributions_figure(result),
        "tolerances": tolerances_figure(result),
        "unit_turn": None if result.unit_turn is None else turn_figure(result),
        "population": None if result.population is None else population_figure(result),
    }
    return {name: figure for name, figure in drawn.items() if figure is not None}

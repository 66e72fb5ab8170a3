"""Which problems a model belongs to, as the problem or the model declares."""

from __future__ import annotations

from ..models.measurable import MeasurableModel


def belongs(problem: str, problem_model: str, model: str, measured: type[MeasurableModel]) -> bool:
    """Whether a correction of the model named `model` applies to `problem`, whose own model is
    `problem_model`.
    """
    return problem_model == model or problem in measured.corrects


def stranger(problem: str, model: str, measured: type[MeasurableModel]) -> str:
    """The message for a problem that a model does not belong to."""
    corrected = " or ".join(f'"{name}"' for name in measured.corrects)
    reason = f"it corrects {corrected}" if corrected else "it corrects none (`simulate` takes it)"
    return f'the model {model} does not belong to the problem "{problem}": {reason}'

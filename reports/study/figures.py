"""The figures of a study, by the names of their files."""

from __future__ import annotations

import re

from ...records import StudyResult
from ..drawing import Named
from .course import course_caption, course_figure
from .response import response_caption, response_figure
from .sensitivity import sensitivity_caption, sensitivity_figure


def figures(result: StudyResult) -> list[Named]:
    """The course of every key, every response against the settings, and the sensitivities."""
    drawn = [
        Named(f"course_{stem(key)}", course_figure(result, key), course_caption(result, key), key)
        for key in result.courses["key"].unique()
    ]
    drawn += [
        Named(f"response_{stem(response.name)}", response_figure(result, response), response_caption(result, response))
        for response in result.responses
    ]
    if len(result.sensitivity):
        drawn.append(Named("sensitivity", sensitivity_figure(result), sensitivity_caption(result)))
    return drawn


def stem(key: str) -> str:
    """A key as part of a file name: `algorithm.crossover.probability` as crossover_probability."""
    return re.sub(r"\W+", "_", key.removeprefix("algorithm."))

"""The figures of a study, by the names of their files."""

from __future__ import annotations

import re
from dataclasses import dataclass

from matplotlib.figure import Figure

from ...records import StudyResult
from .course import course_caption, course_figure
from .response import response_caption, response_figure
from .sensitivity import sensitivity_caption, sensitivity_figure


@dataclass(frozen=True, slots=True)
class Named:
    """A figure, the stem of its files, what it shows in words, and its key where it has one."""

    name: str
    figure: Figure
    caption: str
    key: str = ""


def figures(result: StudyResult) -> list[Named]:
    """Courses of each key, then each response against the settings, then the sensitivities."""
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

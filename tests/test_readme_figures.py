"""The figures of the README are those of its script, its configuration and the present model."""

from __future__ import annotations

import io
import re

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

from tolevo.problems.tolerance_problem import designs_of

pytest.importorskip("tools.readme_figures", reason="the tools are not shipped")
pytestmark = pytest.mark.source_tree

from tools.readme_figures import DATA, FIGURES, ROOT, configuration, drawn  # noqa: E402

LOCKED = re.findall(r"^matplotlib==(\d+\.\d+\.)", (ROOT / "requirements.lock").read_text(encoding="utf-8"), re.M)[0]
"""Major and minor version of the matplotlib that drew the figures."""
NAMES = sorted(set(FIGURES.values()))


def test_every_picture_of_the_readme_has_its_script() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"!\[[^\]]*\]\(([^)]*)\)", text)) == sorted(FIGURES)


@pytest.mark.parametrize("path", FIGURES)
def test_the_figure_is_drawn_from_the_stored_data(path: str) -> None:
    kept, again = imread(ROOT / path), imread(io.BytesIO(drawn(FIGURES[path])))
    if not matplotlib.__version__.startswith(LOCKED):  # another version lays out texts otherwise
        np.testing.assert_allclose(again.shape, kept.shape, rtol=0.01)
        return
    assert kept.shape == again.shape
    assert np.mean(np.abs(kept - again) > 0.1) < 1e-3  # other versions of a font move a few pixels


@pytest.mark.parametrize("name", NAMES)
def test_the_data_are_those_of_the_configuration(name: str) -> None:
    stored = (DATA / f"{name}.sha256").read_text(encoding="utf-8").strip()
    assert stored == configuration(name).hash, "run `make figures`"


@pytest.mark.parametrize("name", NAMES)
def test_the_data_are_those_of_the_model(name: str) -> None:
    problem = configuration(name).problem
    assert problem is not None
    front = pd.read_csv(DATA / f"{name}_front.csv")
    some = front.iloc[np.linspace(0, len(front) - 1, 12).astype(int)]
    found = problem.reported().outputs_of(designs_of(problem, some), errors=False)
    for objective in problem.objectives:
        np.testing.assert_allclose(some[objective], found[objective], rtol=1e-4)

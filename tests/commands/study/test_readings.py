from __future__ import annotations

from pathlib import Path

import pytest

from tolevo import configs
from tolevo.commands.study.configuration import read_study
from tolevo.errors import InputError

CASE = Path(configs.__path__[0]) / "document_ga_study.toml"


def edited(tmp_path: Path, old: str, new: str) -> Path:
    text = CASE.read_text(encoding="utf-8")
    assert old in text
    text = text.replace('"pose_accuracy_ga.toml"', f'"{CASE.parent / "pose_accuracy_ga.toml"}"')
    path = tmp_path / "study.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_the_documents_study_is_as_the_document_says() -> None:
    settings = read_study(CASE).settings
    assert settings.seeds == 30
    sizes, crossover, mutation = (factor.grid() for factor in settings.factors)
    assert sizes == (20, 40, 60, 80)
    assert crossover[0] == 0.05 and crossover[-1] == 0.99
    assert mutation[0] == 0.001 and mutation[-1] == 0.08
    assert {one.figure for one in settings.hypotheses} == {"Figure 9", "Figure 10", "Figure 11"}
    slow = next(one for one in settings.hypotheses if one.response == "evaluations_to_99")
    assert (slow.a, slow.b, slow.better) == (80, 20, False)


def test_readings_survive_the_resolved_configuration(tmp_path: Path) -> None:
    first = read_study(CASE).settings
    again = tmp_path / "again.toml"
    again.write_text(first.configuration, encoding="utf-8")
    assert read_study(again).settings.hypotheses == first.hypotheses


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("a = 80\n", "a = 70\n", r"reading\[0\].a: is not a level of algorithm.population: 20, 40"),
        ("b = 20\n", "b = 80\n", r"reading\[0\].b: is the same level as a"),
        ('says = "it', 'sais = "it', r"reading\[1\].sais: is not a known key .did you mean `says`"),
        ('expect = "worse"', 'expect = "wors"', r"reading\[1\].expect: must be one of better, wor"),
        ('response = "evaluations_to_99"', 'response = "cpu_s_to_99"', r"reading\[1\].response"),
        ('key = "algorithm.mutation.prob', 'key = "algorithm.mutation.pr', r"reading\[3\].key"),
    ],
)
def test_faults_of_readings_have_their_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_study(edited(tmp_path, old, new))

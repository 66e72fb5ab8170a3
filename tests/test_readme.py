"""The README does what it says: its mechanism, its Python, its configurations."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import tolevo

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.source_tree


def blocks(kind: str) -> list[str]:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(rf"```{kind}[^\n]*\n(.*?)```", text, re.DOTALL)


def test_the_mechanism_of_the_readme_comes_out_as_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (written,), (code,) = blocks("toml"), blocks("python")
    lines = len([line for line in written.splitlines() if line.strip()])
    assert f"in {lines} lines" in text
    (tmp_path / "end_play.toml").write_text(written, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(code, names)
    result = names["result"]
    assert isinstance(result, tolevo.Run)
    sheet = names["sheet"]
    assert isinstance(sheet, tolevo.Analysis)
    row, shares = sheet.requirements.iloc[0], sheet.contributions.set_index("part")["variance_percent"]
    words = " ".join(text.split())
    assert f"{row['worst_case_least']:.2f} to {row['worst_case_greatest']:.2f} mm in the worst case" in words
    assert f"Cpk is {row['cpk']:.2f} and {row['yield_percent']:.2f} % of the assemblies" in words
    assert f"the housing has {shares['housing']:.1f} % of the variance" in words
    assert result.allocation is not None
    cost, said = result.front["cost"].iloc[0], re.search(r"least cost is ([\d.]+) EUR", text)
    assert said is not None
    assert f"{cost:.2f}" == said[1]
    assert 0.0 <= result.front["gap_percent"].iloc[0] <= 0.03
    assert "percent binds: lowering it to 99.703 percent would save" in result.summary["answers"]["limits"]
    notations = result.allocation.set_index("variable")["notation"]
    for part in ("housing", "shaft", "spacer"):
        assert str(notations[f"{part}_t"]).partition(" (")[0].removesuffix(" mm") in text


def test_every_configuration_that_the_readme_names_is_shipped() -> None:
    commands = "\n".join(blocks("console"))
    named = re.findall(r"(configs/\w+\.toml|docs/\S+)", commands)
    assert len(named) >= 6
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_tour_of_a_designer_comes_out_as_it_says(tmp_path: Path) -> None:
    text = " ".join((ROOT / "docs" / "tour_designer.md").read_text(encoding="utf-8").split())
    page = (ROOT / "docs" / "tour_designer.md").read_text(encoding="utf-8")
    found = re.search(r'```toml title="encoder.toml"\n(.*?)```', page, re.DOTALL)
    assert found is not None
    path = tmp_path / "encoder.toml"
    path.write_text(found[1], encoding="utf-8")
    front = tolevo.run(path).front
    least, most, knee = front["cost"].min(), front["cost"].max(), front[front["knee"]].iloc[0]
    assert f"{len(front)} allocations from {least:.2f} EUR" in text
    assert f"to {most:.2f} EUR (+- {front['variation'].min():.2f} mm)" in text
    assert f"costs {knee['cost']:.2f} EUR at +- {knee['variation']:.3f} mm" in text
    assert front["gap_percent"].max() < 1e-6
    settings = ['objectives.minimise=["cost"]', "limits.yield_percent=99.73"]
    one = tolevo.run(path, settings=settings).front
    assert f"at {one['cost'].iloc[0]:.2f} EUR" in text

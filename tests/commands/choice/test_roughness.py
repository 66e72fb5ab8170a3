"""Roughness of a surface by the process of its cost curve and the width of its zone."""

from pathlib import Path

import pytest

import tolevo
from tolevo.commands.run.tolerances import roughness

TURNED = """
problem = "stack"
[objectives]
minimise = ["cost"]
[limits]
variation = 0.05
[requirement]
name = "gap"
unit = "mm"
[[part]]
name = "ring"
nominal = 20.0
unit = "mm"
sensitivity = 1.0
[[part.process]]
name = "turned"
t_min = 0.02
t_max = 0.2
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part.process]]
name = "ground"
t_min = 0.005
t_max = 0.03
cost = { model = "reciprocal", a = 2.0, b = 0.1 }
"""


@pytest.mark.parametrize(
    ("process", "width", "unit", "ra"),
    [
        ("turned", 0.25, "mm", 6.3),  # the coarsest that turning leaves; 12.5 um of the zone
        ("turned", 0.04, "mm", 1.6),  # a twentieth is 2 um
        ("ground", 54.0, "um", 1.6),
        ("Honed", 8.0, "um", 0.4),
        ("turned", 0.002, "mm", 0.4),  # finer than turning reaches
        ("forged", 0.04, "mm", None),
        ("", 0.04, "mm", None),
        ("ground", 0.01, "rad", None),
    ],
)
def test_roughness(process: str, width: float, unit: str, ra: float | None) -> None:
    assert roughness(process, width, unit) == ra


def test_a_share_of_ones_own() -> None:
    """A tenth of 40 um is 4 um: 3.2 is the preferred value below."""
    assert roughness("turned", 0.04, "mm", 0.1) == 3.2


def test_the_share_is_an_assumption_that_can_be_set(tmp_path: Path) -> None:
    """The zone is IT10 at 20 mm, 84 um: a twentieth is 4.2, a hundredth 0.84 um."""
    path = tmp_path / "c.toml"
    path.write_text(TURNED, encoding="utf-8")
    assert "choice.roughness_share = 0.05 (default)" in tolevo.check(path)
    own = tolevo.read(path, ["choice.roughness_share=0.01"])
    assert "roughness_share = 0.01" in own.toml()
    usual, finer = tolevo.run(path), tolevo.run(own)
    told = [one for one in finer.record.summary["assumptions"] if "roughness" in one["name"]]
    assert [(one["value"], one["set_by"]) for one in told] == [(0.01, "configuration")]
    tables = [run.record.allocation for run in (usual, finer)]
    columns = [None if one is None else one["roughness_Ra_um"].max() for one in tables]
    assert columns == [3.2, 0.8]


def test_a_share_out_of_range_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(TURNED, encoding="utf-8")
    with pytest.raises(tolevo.ConfigurationError, match=r"choice\.roughness_share: must"):
        tolevo.read(path, ["choice.roughness_share=0"])

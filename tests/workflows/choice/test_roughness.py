"""Roughness of a surface by the process of its cost curve and the width of its zone."""

import pytest

from tolevo.workflows.choice.roughness import roughness


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

"""A real record: a friction damper with backlash, whose dead band a plain model misses."""

from __future__ import annotations

from pathlib import Path

from tests.gap_benchmark.damper import Jenkins, arts
from tolevo import registry
from tolevo.commands.gap import gap
from tolevo.commands.gap.plan import GapPlan
from tolevo.commands.gap.read import read_data


def test_the_clearance_is_named_and_located(tmp_path: Path) -> None:
    """Its full width by least squares alone is 0.17 to 0.18 in. (test_arts)."""
    arts("1").to_csv(tmp_path / "damper.csv", index=False)
    given = {one.name: one.default for one in Jenkins.parameters}
    plan = GapPlan(
        model_name="jenkins",
        model=Jenkins(given),
        parameters=given,
        free=dict(Jenkins.free),
        library=tuple(registry.names("effects")),
        rebuild=lambda parameters: Jenkins({**given, **parameters}),
    )
    result = gap.analysis_result(plan, read_data(plan, tmp_path / "damper.csv"))
    assert result.verdict == "partial"  # the rest of a measured loop stands out from its noise
    # channels of the test rig that are a few milliseconds apart may stand beside it
    assert set(result.names) - {"delay"} == {"bearing_clearance"}
    # it is no single delay, which is said
    uneven = any(note.startswith("delay_s differs between kinds of rows") for note in result.notes)
    assert uneven == ("delay" in result.names)
    (width,) = next(e for e in result.effects if e.name == "bearing_clearance").parameters
    assert width.low < 0.18 and width.high > 0.17
    assert abs(width.value / 0.175 - 1.0) < 0.05
    place = result.where[0]
    assert place.variable == "predicted force_kip"
    assert max(abs(place.low), abs(place.high)) < 0.1 * result.residuals["force_kip"].abs().max()
    assert result.gap_after["force_kip"] < 0.6 * result.gap_before["force_kip"]

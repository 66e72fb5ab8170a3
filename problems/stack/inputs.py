"""The distribution of a part, from and to its table."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ...models.inputs import DISTRIBUTIONS, Distribution, Normal
from ...section import POSITIVE, Range, Section


def read_input(section: Section) -> Distribution | None:
    """The distribution of a part; normal with Cp = 1 where nothing is said."""
    name = section.text("distribution", DISTRIBUTIONS)
    cp = section.number("cp", within=POSITIVE)
    cpk = section.number("cpk", within=Range(low=0.0))
    shift = section.number("shift", within=Range(-1.0, 1.0))
    given = [key for key in ("cp", "cpk", "shift") if key in section]
    if name is None:
        if "distribution" in section:
            return None
        name = "normal"
    if name == "uniform":
        for key in given:
            section.fault(key, "a uniform input fills its zone and takes none: set "
                          'distribution = "normal" or "truncated_normal"')  # fmt: skip
        return DISTRIBUTIONS[name]()
    capability = Normal().cp if cp is None else cp
    if cpk is not None:
        if shift is not None:
            section.fault("cpk", "is given beside shift: keep one, cpk = cp (1 - |shift|)")
        if cpk > capability:
            section.fault("cpk", f"must not be above cp ({capability:g}), got {cpk:g}")
            return None
        shift = 1.0 - cpk / capability
    return DISTRIBUTIONS[name](cp=capability, shift=0.0 if shift is None else shift)  # type: ignore[call-arg]


def input_table(distribution: Distribution) -> dict[str, Any]:
    """The keys that state a distribution."""
    name = next(name for name, kind in DISTRIBUTIONS.items() if type(distribution) is kind)
    shape: dict[str, Any] = asdict(distribution)  # type: ignore[call-overload]
    return {"distribution": name} | shape

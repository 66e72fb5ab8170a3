"""A distribution as keys of a table: `distribution`, its parameters, and `cpk` for `shift`."""

from __future__ import annotations

from dataclasses import MISSING, Field, asdict, fields, replace
from typing import Any

from ..section import Range, Section
from .inputs import DISTRIBUTIONS, Distribution, declared_range

Stated = dict[str, Any]
"""Parameters by name; None where a fault has been reported."""


def _parameters(kind: type[Distribution]) -> dict[str, Field[Any]]:
    return {parameter.name: parameter for parameter in fields(kind)}  # type: ignore[arg-type]


def keys() -> tuple[str, ...]:
    """Every key that `read_distribution` takes from a table.

    Parameters of a plugin's distribution are among them once it has been named.
    """
    parameters = (name for kind in DISTRIBUTIONS.sound().values() for name in _parameters(kind))
    return ("distribution", *dict.fromkeys(parameters), "cpk")


def read_distribution(section: Section, default: Distribution | None = None) -> Distribution | None:
    """The distribution that `section` states by `keys`, which are then known to it.

    Without `distribution` its other keys change parameters of `default`, which is returned
    unchanged where nothing is stated. None after a fault; every fault is reported at its key.
    """
    name = section.text("distribution", DISTRIBUTIONS)
    kind = None if default is None else type(default)
    if "distribution" in section:
        kind, default = (DISTRIBUTIONS[name] if name else None), None
    known = keys()
    stated = {key: _value(section, key, kind) for key in known[1:] if key in section}
    section.accept(known)
    if kind is not None:
        return _build_distribution(section, kind, default, stated)
    if "distribution" not in section:
        for key in stated:
            section.fault(key, f"needs a distribution that takes it: {_remedy(key)}")
    return None


def written(distribution: Distribution) -> dict[str, Any]:
    """The table that `read_distribution` reads back as the same distribution."""
    shape: dict[str, Any] = asdict(distribution)  # type: ignore[call-overload]
    return {"distribution": name_of(type(distribution))} | {
        key: list(value) if isinstance(value, tuple) else value for key, value in shape.items()
    }


def name_of(kind: type[Distribution]) -> str:
    """The configuration name of a distribution."""
    return DISTRIBUTIONS.name_of(kind)


def _remedy(key: str) -> str:
    """The settings of `distribution` that make `key` valid."""
    needed = "shift" if key == "cpk" else key
    named = [f'"{name}"' for name, kind in DISTRIBUTIONS.sound().items() if needed in _parameters(kind)]
    return f"set distribution = {' or '.join(named)}"


def _value(section: Section, key: str, kind: type[Distribution] | None) -> Any:
    """The value that `key` states, within the range of the parameter; None after a fault."""
    if key == "cpk":
        return section.number(key, within=Range(low=0.0))
    kinds = ([] if kind is None else [kind]) + list(DISTRIBUTIONS.sound().values())
    parameter = next(parameters[key] for parameters in map(_parameters, kinds) if key in parameters)
    if str(parameter.type).startswith("tuple"):
        return section.numbers(key)
    return section.number(key, within=declared_range(parameter))


def _build_distribution(
    section: Section, kind: type[Distribution], default: Distribution | None, stated: Stated
) -> Distribution | None:
    """The distribution of a kind from the stated parameters; the others are those of `default`."""
    parameters = _parameters(kind)
    taken = {*parameters, *(["cpk"] if "shift" in parameters else [])}
    unsuited = [key for key in stated if key not in taken]
    for key in unsuited:
        section.fault(key, f"does not apply to {name_of(kind)}: {_remedy(key)}")
    needed = [key for key, parameter in parameters.items() if parameter.default is MISSING]
    missing = [key for key in needed if default is None and key not in stated]
    for key in missing:
        section.fault(key, f"is missing: {name_of(kind)} needs {' and '.join(needed)}")
    if "cpk" in stated and "cpk" in taken:
        cp = parameters["cp"].default if default is None else getattr(default, "cp", None)
        if cp is not None and stated["cpk"] is not None:
            cp = max(cp, stated["cpk"])  # a Cpk alone, as suppliers state it, above the usual Cp: centred
        stated = _apply_cpk_shift(section, {"cp": cp} | stated)
    if unsuited or missing or None in stated.values():
        return None
    distribution = kind(**stated) if default is None else replace(default, **stated)  # type: ignore[type-var]
    faults = distribution.faults()
    for key, message in faults:
        section.fault(key, message)
    return None if faults else distribution


def _apply_cpk_shift(section: Section, stated: Stated) -> Stated:
    """`cpk` replaced by the shift, towards the upper limit, of Cpk = Cp (1 - |shift|)."""
    cp, cpk = stated["cp"], stated["cpk"]
    shift = None
    if "shift" in stated:
        section.fault("cpk", "is given together with shift: leave one of them out, since Cpk = Cp (1 - |shift|)")
    elif cp is not None and cpk is not None:
        if cpk <= cp:
            shift = 1.0 - cpk / cp
        else:
            section.fault("cpk", f"must not be above cp ({cp:g}), got {cpk:g}: raise cp, since Cpk = Cp (1 - |shift|)")
    return {key: value for key, value in stated.items() if key != "cpk"} | {"shift": shift}

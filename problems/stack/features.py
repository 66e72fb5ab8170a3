"""Reads `[[feature]]`: tolerances of position and size as they act in the formulas of a stack.

A feature is a part that has a place in a zone instead of a size. Its pieces are the components of that
place z, |z| <= 1; its quantities, which formulas use, follow from them with half the zone t, the bonus b
from the size of a part as made, and the lever of a tilt:

    position, datum_shift, runout, profile   (t + b/2) z
    perpendicularity                         2 arm/height (t + b/2) z
    float                                    (hole - pin)/2 z

with b = |size - its maximum (or least) material size|. The zone of a feature without a bonus may be
searched. Reference: ASME Y14.5-2018, ISO 2692:2021.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ...errors import Fault, nearest
from ...models.expressions import Formula, Let
from ...models.iso286 import SYMBOLS, Fit
from ...models.stack.mechanism import PLANE, Disc, component
from ...section import POSITIVE, Range, Section
from ...units import NO_ZONE, family
from .definition import Part, Process, Requirement
from .formulas import name_complaint
from .parts import drawing_number, length_unit_of, read_process

ZONE, SIZE, LEVER = ("zone", "t_min", "t_max", "cost"), ("material", "size", "internal"), ("height", "arm")
RFS = ("rfs", "mmc", "lmc")
"""Regardless of feature size, maximum and least material condition."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a feature of a kind takes: keys of the groups above, those that it needs, its laws and material
    conditions, the first by default, and its symbol of ISO 1101.
    """

    takes: tuple[str, ...] = ZONE
    needs: tuple[str, ...] = ("zone",)
    laws: tuple[str, ...] = (*PLANE, "uniform")
    materials: tuple[str, ...] = RFS[:1]
    symbol: str = ""


KINDS: Mapping[str, Kind] = {
    "position": Kind(ZONE + SIZE, materials=RFS, symbol="position"),
    "datum_shift": Kind(("zone", *SIZE), (), materials=RFS[1:]),
    "float": Kind((), ("of",), (*PLANE, "uniform", "pushed")),
    "perpendicularity": Kind(ZONE + SIZE + LEVER, ("zone", *LEVER), materials=RFS, symbol="perpendicularity"),
    "runout": Kind(laws=PLANE, symbol="circular_runout"),
    "profile": Kind(laws=("uniform", "normal"), symbol="surface_profile"),
}
Named = list[tuple[str, Part | None]]
"""Pieces, each with its part, None where the part has a fault of its own."""


@dataclass(frozen=True, slots=True)
class Feature:
    """What a part that `[[feature]]` states adds to formulas.

    `names` are those that formulas may use, `pieces` the components of its place, by `law`. `quantities`
    are the formulas of names that are no pieces; `{1}` and `{2}` in them are the `lengths`, in `unit`.
    `stated` is its table, and `place` where it stands in the configuration.
    """

    law: str
    names: tuple[str, ...]
    pieces: tuple[str, ...]
    quantities: Mapping[str, str]
    stated: Mapping[str, Any]
    place: str
    unit: str = ""
    lengths: tuple[float, ...] = field(default=())

    def disc(self, owner: Sequence[int], at: int) -> Disc | None:
        """The zone of a place in two directions, of the part `at` by the part of each piece; else None."""
        first = owner.index(at) if len(self.pieces) == 2 else -1
        return Disc((first, first + 1), self.law) if first >= 0 else None

    def steps(self, base: Mapping[str, float]) -> tuple[Let, ...]:
        """Its quantities in the units of a formula: the SI factor of each kind, 1 where it has none."""
        kind, factor = family(self.unit)
        lengths = [repr(length * factor / base.get(kind, factor)) for length in self.lengths]
        formulas = {name: Formula(text.format("", *lengths)) for name, text in self.quantities.items()}
        return tuple(Let(name, formula, self.place) for name, formula in formulas.items())


def read_features(
    top: Section, requirements: Sequence[Requirement], parts: Sequence[Part | None], faults: list[Fault]
) -> list[Part | None]:
    """Each `[[feature]]` as a part, None for each that is faulty; `parts` are those of `[[part]]`."""
    owners: dict[str, Part | None] = {str(table.get("name")): None for table in top.tables("part")}
    for part in parts:
        owners |= {} if part is None else dict.fromkeys((part.name, *part.pieces), part)
    length_unit = length_unit_of(requirements)
    taken = {known: f"part {known if part is None else part.name}" for known, part in owners.items()}
    features: list[Part | None] = []
    for at in range(len(top.tables("feature"))):
        own: list[Fault] = []
        section = top.item("feature", at, own)
        if not any(requirement.formula for requirement in requirements):
            section.fault("", "acts by its name in a formula, and no requirement has one: state requirement.formula")
        stated = top.tables("feature")[at]
        features.append(part := _read(section, stated, owners, length_unit))
        section.finish()
        name = stated.get("name")
        names = [name] if part is None else part.names
        for clash in (known for known in names if isinstance(known, str) and known in taken):
            section.fault("name", f'"{clash}" is already a name of {taken[clash]}; rename one of the two')
        taken |= {known: f"feature {name}" for known in names if isinstance(known, str)}
        label = f" (feature {name})" if isinstance(name, str) else ""
        faults += [Fault(fault.place, fault.message + label) for fault in own]
    return features


def _read(
    section: Section, stated: Mapping[str, Any], owners: Mapping[str, Part | None], length_unit: str
) -> Part | None:
    """A feature as a part; None where it has a fault, or where one of its parts has."""
    name, key = section.text("name"), section.text("kind", KINDS)
    drawing, characteristic = (drawing_number(section, label) for label in ("drawing", "characteristic"))
    if name is not None and (why := name_complaint(name)):
        section.fault("name", why)
    for needed, what in (("name", "formulas use the feature by its name"), ("kind", f"one of {', '.join(KINDS)}")):
        if needed not in section:
            section.fault(needed, f"is missing: {what}")
    if key is None:
        section.accept(section.all_keys())
        return None
    kind = KINDS[key]
    section.accept(kind.takes)
    for other in (other for other in ZONE + SIZE + LEVER if other in section and other not in kind.takes):
        section.take(other)
        section.fault(other, f"does not apply to {key}")
    for needed in (needed for needed in kind.needs if needed not in section):
        if needed != "zone" or "t_min" not in section:
            section.fault(needed, f"is missing: {key} needs {' and '.join(kind.needs)}")
    law = section.text("distribution", kind.laws) or kind.laws[0]
    cp = section.number("cp", within=POSITIVE)
    if "cp" in section and law != "normal":
        section.fault("cp", 'is the capability of a normal place: state distribution = "normal", or leave it out')
    of = _named(section, "of", owners, 2 if key == "float" else 1)
    size = _named(section, "size", owners, 1) or of[:1]
    unit = section.text("unit") or next((part.unit for _, part in size if part is not None), "") or length_unit
    if not _is_length(unit):
        if "unit" in section or not {"of", "size"} & set(stated):  # else those are at fault
            section.fault("unit", f'must be a length: write "mm", "um", ...; got "{unit}"')
        unit = "mm"
    material = (section.text("material", kind.materials) if "material" in kind.takes else None) or kind.materials[0]
    process, lengths = _zone(section, kind, unit, material), tuple[float, ...]()
    text = _clearance(section, of) if key == "float" else "{0}"
    if material != "rfs":
        text, lengths = _widened(section, size, unit, material, process)
    if "arm" in kind.takes:  # an axis leans by the whole zone over the height
        height, arm = (section.number(end, unit, POSITIVE) or 1.0 for end in LEVER)
        text = f"{2.0 * arm / height!r}*{text}"
    if section.faults or name is None or process is None or any(part is None for _, part in (*of, *size)):
        return None
    plane = law in PLANE and key != "profile"
    names, pieces, quantities = _quantities(name, law, text, plane)
    half = process.high > 0.0  # else the place is in units of half the clearance or bonus
    return Part(
        name=name,
        unit=unit if half else "",
        processes=(process if half else Process(float(bool(pieces)), float(bool(pieces))),),
        distribution=component(law, 1.0 if cp is None else cp),
        fixed=process.low == process.high,
        assumed={} if "distribution" in section else {"distribution": "the configuration names none"},
        drawing=drawing,
        characteristic=characteristic,
        geometry=kind.symbol,
        drawn_as=_drawn(kind.symbol, plane and key != "runout", material) if kind.symbol or half else NO_ZONE,
        feature=Feature(law, names, pieces, quantities, stated, section.place(), unit, lengths),
    )


def _drawn(symbol: str, diametral: bool, material: str) -> str:
    """How a drawing states the zone "{}": symbol, sign of a diameter, and material condition."""
    zone, modifier = "⌀{}" if diametral else "{}", {"mmc": "Ⓜ", "lmc": "Ⓛ"}.get(material, "")
    return " ".join(filter(None, (SYMBOLS.get(symbol, ""), zone, modifier)))


def _is_length(unit: str) -> bool:
    try:
        return family(unit)[0] == "meter"
    except ValueError:
        return False


def _named(section: Section, key: str, owners: Mapping[str, Part | None], count: int) -> Named:
    """The pieces that a key names, none after a fault."""
    value = section.take(key)
    names = section.names(key) if isinstance(value, list) else [section.text(key)]
    if names is None or value is None:
        return []
    if len(set(names)) != count:
        what = "two different parts, the hole first" if count > 1 else "one part"
        section.fault(key, f"must name {what}, got {len(names)}")
    before = len(section.faults)
    for name in filter(None, names):
        part = owners.get(name)
        if name not in owners:
            section.fault(key, f'"{name}" is not a part{nearest(name, owners)}')
        elif part is not None and part.count > 1 and name == part.name:
            section.fault(key, f"{name} is built in {part.count} times: name {part.pieces[0]}, ...")
        elif part is not None and (part.nominal is None or not _is_length(part.unit)):
            section.fault(key, f"{name} has no size: give it a nominal in a unit of length")
    whole = len(set(names)) == count and len(section.faults) == before
    return [(name, owners[name]) for name in names if name] if whole else []


def _zone(section: Section, kind: Kind, unit: str, material: str) -> Process | None:
    """Half of the zone, fixed or searched; 0 where a feature has none."""
    searched = [key for key in ("t_min", "t_max", "cost") if key in section and key in kind.takes]
    if searched and ("zone" in section or material != "rfs"):
        section.accept(("zone", *searched))
        other = "zone" if "zone" in section else f'material = "{material}"'
        section.fault(searched[0], f"is not possible together with {other}: leave one of the two out")
        return None
    if searched:
        return read_process(section, unit, None)
    zone = section.number("zone", unit, POSITIVE if material == "rfs" else Range(low=0.0)) if kind.takes else 0.0
    return None if zone is None and "zone" in section else Process(0.5 * (zone or 0.0), 0.5 * (zone or 0.0))


def _limits(part: Part) -> tuple[float, float]:
    """Least and largest size [m] within the (loosest) limits of a part."""
    middle, factor = (part.nominal or 0.0) + part.mid, family(part.unit)[1]
    return (middle - part.high) * factor, (middle + part.high) * factor


# Formulas of a place: {0} is the component z of it times half the zone, or z alone without a zone.


def _widened(
    section: Section, size: Named, unit: str, material: str, process: Process | None
) -> tuple[str, tuple[float, ...]]:
    """The component in a zone that grows with the departure of a size from a limit, and its lengths."""
    internal = section.flag("internal")
    if not {"size", "of"} & set(section.all_keys()):
        section.fault("size", f"is missing: name the part whose size gives the bonus at {material.upper()}")
    name, part = size[0] if size else ("", None)
    if part is None:
        return "", ()
    if not part.fixed:
        text = f"{name} has no fixed limits, so that its {material.upper()} size is not known: state its "
        section.fault("size" if "size" in section else "of", f"{text}tolerance, limits, grade or fit")
    if internal is None and isinstance(fit := part.stated.get("fit"), str):
        internal = str(Fit.of_text(fit)).isupper()
    if internal is None and "internal" not in section:
        section.fault("internal", f"is missing: state true if {name} is a hole or a slot, false if it is a pin")
    least, half = internal == (material == "mmc"), 0.0 if process is None else process.high
    departure = f"({name} - {{1}})" if least else f"({{1}} - {name})"
    text = f"{{0}}*(1 + {departure}/(2*{{2}}))" if half else f"{{0}}*{departure}/2"
    return text, (_limits(part)[not least] / family(unit)[1], half)


def _clearance(section: Section, of: Named) -> str:
    """The component within half the clearance of two parts, which is none where there is interference."""
    if len(parts := [part for _, part in of if part is not None]) < 2:
        return ""
    (least, largest), (thinnest, thickest) = (_limits(part) for part in parts)
    if largest <= thinnest:
        section.fault("of", f"{of[0][0]} is never larger than {of[1][0]}: name the hole first")
    room = f"{of[0][0]} - {of[1][0]}"
    return f"{{0}}*({room})/2" if least >= thickest else f"{{0}}*max(0, {room})/2"


def _quantities(name: str, law: str, text: str, plane: bool) -> tuple[tuple[str, ...], tuple[str, ...], dict[str, str]]:
    """Names, pieces and the formulas of names that are no pieces: `<name>_x` and `<name>_y`, of which
    `<name>` is the first, or `<name>` alone.
    """
    components = (f"{name}_x", f"{name}_y") if plane else (name,)
    names = (*components, name) if plane else components
    alias = {name: components[0]} if plane else {}
    if text == "{0}":
        return names, components, alias
    if law == "pushed":
        return names, (), {name: text.replace("{0}*", "")}
    pieces = tuple(f"{component}_in_zone" for component in components)
    formulas = [text.replace("{0}", piece) for piece in pieces]
    return names, pieces, dict(zip(components, formulas, strict=True)) | alias

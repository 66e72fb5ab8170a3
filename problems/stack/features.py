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
from ...models.iso286 import Fit
from ...models.stack.features import PLANE, Disc, component
from ...section import POSITIVE, Range, Section
from ...units import family
from .definition import Part, Process, Requirement
from .formulas import name_complaint
from .parts import drawing_number, length_unit_of, read_process


@dataclass(frozen=True, slots=True)
class Kind:
    """What a feature of a kind may state: its laws, the first by default, whether its zone grows with
    the size of a part (`material`), its symbol of ISO 1101, and the keys that it needs.
    """

    laws: tuple[str, ...] = (*PLANE, "uniform")
    material: bool = False
    symbol: str = ""
    needs: tuple[str, ...] = ("zone",)


KINDS: Mapping[str, Kind] = {
    "position": Kind(material=True, symbol="position"),
    "datum_shift": Kind(material=True, needs=()),
    "float": Kind((*PLANE, "uniform", "pushed"), needs=("of",)),
    "perpendicularity": Kind(material=True, symbol="perpendicularity", needs=("zone", "height", "arm")),
    "runout": Kind(PLANE, symbol="circular_runout"),
    "profile": Kind(("uniform", "normal"), symbol="surface_profile"),
}
MATERIALS = ("rfs", "mmc", "lmc")
"""Regardless of feature size, maximum and least material condition."""


@dataclass(frozen=True, slots=True)
class Feature:
    """What a part that `[[feature]]` states adds to formulas.

    `names` are those that formulas may use, `pieces` the components of its place, by `law`. `quantities`
    are the formulas of names that are no pieces; `{1}` and `{2}` in them are the `lengths`, in `unit`.
    `stated` is its table, and `place` where it stands in the configuration.
    """

    kind: str
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
        return tuple(
            Let(name, Formula(text.format("", *lengths)), self.place) for name, text in self.quantities.items()
        )


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
        text = f" (feature {name})" if isinstance(name, str) else ""
        faults += [Fault(fault.place, f"{fault.message}{text}") for fault in own]
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
    for needed in kind.needs:
        if needed not in section and not (needed == "zone" and "t_min" in section):
            section.fault(needed, f"is missing: {key} needs {' and '.join(kind.needs)}")
    law = section.text("distribution", kind.laws) or kind.laws[0]
    cp = section.number("cp", within=POSITIVE)
    if "cp" in section and law != "normal":
        section.fault("cp", 'is the capability of a normal place: state distribution = "normal", or leave it out')
    of = _named(section, "of", owners, 2 if key == "float" else 1)
    size = _named(section, "size", owners, 1) or of[:1]
    unit = section.text("unit") or next((part.unit for _, part in size if part is not None), "") or length_unit
    if _kind_of(unit) != "meter":
        section.fault("unit", f'must be a length: write "mm", "um", ...; got "{unit}"')
        unit = "mm"
    material = _material(section, key)
    process = _zone(section, key, unit, material)
    bonus = _bonus(section, size, unit, material) if material != "rfs" else None
    lever = _lever(section, unit) if key == "perpendicularity" else 1.0
    ready = None not in (name, process, lever) and (material == "rfs") == (bonus is None)
    if section.faults or not ready or any(part is None for _, part in (*of, *size)):
        return None
    assert name is not None and process is not None and lever is not None
    if key == "float":
        text, lengths = _clearance(*of, pushed=law == "pushed"), ()
    else:
        text, lengths = _scaled_place(bonus, process.high, lever)
    names, pieces, quantities = _quantities(name, law, text, law in PLANE and key != "profile")
    assumed = {"distribution": f"{law.replace('_', ' ')}; the configuration names none"}
    t = 0.0 if law == "pushed" else 1.0  # a place in a clearance is in units of it
    return Part(
        name=name,
        unit=unit if process.high > 0.0 else "",
        processes=(process if process.high > 0.0 else Process(t, t),),
        distribution=component(law, 1.0 if cp is None else cp),
        fixed=process.low == process.high,
        assumed={} if "distribution" in section else assumed,
        drawing=drawing,
        characteristic=characteristic,
        geometry=kind.symbol,
        feature=Feature(key, law, names, pieces, quantities, stated, section.place(), unit, lengths),
    )


def _kind_of(unit: str) -> str:
    try:
        return family(unit)[0]
    except ValueError:
        return "an unknown unit"


def _named(section: Section, key: str, owners: Mapping[str, Part | None], count: int) -> list[tuple[str, Part | None]]:
    """The pieces that a key names, each with its part, None for a part with a fault of its own."""
    if key not in section:
        return []
    names = section.names(key) if isinstance(section.take(key), list) else [section.text(key)]
    if names is None or None in names:
        return []
    if len(set(names)) != count:
        section.fault(
            key, f"must name {'two different parts, the hole first' if count > 1 else 'one part'}, got {len(names)}"
        )
    pairs = []
    for name in filter(None, names):
        part = owners.get(name)
        if name not in owners:
            section.fault(key, f'"{name}" is not a part{nearest(name, owners)}')
        elif part is not None and part.count > 1 and name == part.name:
            section.fault(key, f"{name} is built in {part.count} times: name {part.pieces[0]}, ...")
        elif part is not None and (part.nominal is None or _kind_of(part.unit) != "meter"):
            section.fault(key, f"{name} has no size: give it a nominal in a unit of length")
        pairs.append((name, part))
    return pairs if len(pairs) == count else []


def _material(section: Section, key: str) -> str:
    """The condition at which the zone applies."""
    default = "mmc" if key == "datum_shift" else "rfs"
    if KINDS[key].material:
        material = section.text("material", MATERIALS[key == "datum_shift" :]) or default
    else:
        material = default
        for unused in ("material", "size", "internal"):
            if unused in section:
                section.take(unused)
                section.fault(unused, f"does not apply to {key}: its zone does not grow with the size of a part")
    return material


def _zone(section: Section, key: str, unit: str, material: str) -> Process | None:
    """Half of the zone, fixed or searched; 0 where a feature has none."""
    searched = [name for name in ("t_min", "t_max", "cost") if name in section]
    if key == "float":
        for name in ("zone", *searched):
            if name in section:
                section.take(name)
                section.fault(name, "does not apply to float: the place is within the clearance of two parts")
        return Process(0.0, 0.0)
    if searched and "zone" in section:
        section.accept(searched)
        section.fault("zone", f"is stated in addition to {', '.join(searched)}: keep only one of the two")
        return None
    if searched and material != "rfs":
        section.accept(searched)
        section.fault(searched[0], f'is not possible with material = "{material}": state a fixed zone')
        return None
    if searched:
        return read_process(section, unit)
    zone = section.number("zone", unit, POSITIVE if material == "rfs" else Range(low=0.0))
    if zone is None and (key != "datum_shift" or "zone" in section):
        return None
    return Process(0.5 * (zone or 0.0), 0.5 * (zone or 0.0))


def _bonus(
    section: Section, size: Sequence[tuple[str, Part | None]], unit: str, material: str
) -> tuple[str, str, float] | None:
    """Sign, piece and limit [unit] of the size whose departure from the limit widens the zone."""
    internal = section.flag("internal")
    if not size:
        if not {"size", "of"} & set(section.all_keys()):
            section.fault("size", f"is missing: name the part whose size gives the bonus at {material.upper()}")
        return None
    ((name, part),) = size
    if part is None or part.nominal is None or _kind_of(part.unit) != "meter":
        return None
    place = "size" if "size" in section else "of"
    if not part.fixed:
        text = f"{name} has no fixed limits, so that its {material.upper()} size is not known: state its tolerance, "
        section.fault(place, f"{text}limits, grade or fit")
        return None
    if internal is None and isinstance(fit := part.stated.get("fit"), str):
        internal = str(Fit.of_text(fit)).isupper()
    if internal is None:
        if "internal" not in section:
            section.fault("internal", f"is missing: state true if {name} is a hole or a slot, false if it is a pin")
        return None
    smallest = internal == (material == "mmc")
    limit = part.nominal + part.mid + (-part.high if smallest else part.high)
    return "+" if smallest else "-", name, limit * family(part.unit)[1] / family(unit)[1]


def _lever(section: Section, unit: str) -> float | None:
    """Displacement at the arm in halves of the zone: an axis leans by the zone over the height."""
    height, arm = (section.number(key, unit, POSITIVE) for key in ("height", "arm"))
    return None if height is None or arm is None else 2.0 * arm / height


# The formulas of a place: {0} is the component z of it times half the zone, or z alone without a zone.


def _scaled_place(bonus: tuple[str, str, float] | None, half: float, lever: float) -> tuple[str, tuple[float, ...]]:
    """The formula of a component, and its lengths."""
    text = "{0}" if lever == 1.0 else f"{lever!r}*{{0}}"
    if bonus is None:
        return text, ()
    sign, name, limit = bonus
    departure = f"({name} - {{1}})" if sign == "+" else f"({{1}} - {name})"
    if half > 0.0:
        return f"{text}*(1 + {departure}/(2*{{2}}))", (limit, half)
    return f"{text}*{departure}/2", (limit,)


def _clearance(hole: tuple[str, Part | None], pin: tuple[str, Part | None], pushed: bool) -> str:
    """The formula of a component within half the clearance, which is none where there is interference."""
    ends = []
    for (_, part), side in ((hole, -1.0), (pin, 1.0)):
        assert part is not None and part.nominal is not None
        ends.append((part.nominal + part.mid + side * part.high) * family(part.unit)[1])
    room = f"{hole[0]} - {pin[0]}"
    room = f"({room})" if ends[0] >= ends[1] else f"max(0, {room})"
    return f"{room}/2" if pushed else f"{{0}}*{room}/2"


def _quantities(name: str, law: str, text: str, plane: bool) -> tuple[tuple[str, ...], tuple[str, ...], dict[str, str]]:
    """Names, pieces and the formulas of names that are no pieces: `<name>_x` and `<name>_y`, of which
    `<name>` is the first, or `<name>` alone.
    """
    components = (f"{name}_x", f"{name}_y") if plane else (name,)
    names = (*components, name) if plane else components
    alias = {name: components[0]} if plane else {}
    if text == "{0}":
        return names, components, alias
    pieces = tuple(f"{component}_in_zone" for component in components) if law != "pushed" else ()
    texts = [text.replace("{0}", piece) for piece in pieces or ("",)]
    return names, pieces, dict(zip(components, texts, strict=True)) | alias

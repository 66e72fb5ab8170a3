"""Reads the sensitivity of a part: a number, or a number for each of several requirements."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import Fault, nearest
from ...models.expressions import CONSTANTS, FUNCTIONS, Formula, FormulaError, Intermediate, UnsettledError
from ...models.stack.mechanism import Mechanism, box, least_margin
from ...section import Array, Section
from ...units import family, to_unit
from .definition import Correlation, Part, Requirement, base_units, place_of

if TYPE_CHECKING:
    from .features import Feature

USUAL = 0.1, 10.0
"""Sensitivities of a length by a length, as of one angle by another, that loops of dimensions have."""


def read_sensitivities(section: Section, unit: str | None, requirements: Sequence[Requirement]) -> dict[str, float]:
    """d requirement / d part by the key of the requirement; `unit` is that of the part."""
    if "sensitivity" not in section:
        section.accept(("sensitivity",))
        return {}
    several = any(requirement.key for requirement in requirements)
    if not several:
        return _single_sensitivity(section, unit, requirements[0])
    if not isinstance(section.take("sensitivity"), Mapping):
        keys = ", ".join(f"{requirement.key} = ..." for requirement in requirements[:3])
        section.fault("sensitivity", f"must state the requirement: write sensitivity = {{ {keys} }}")
        return {}
    table, sensitivities = section.section("sensitivity"), dict[str, float]()
    known = {requirement.key: requirement for requirement in requirements}
    for key in table.all_keys():
        if key not in known:
            close = nearest(key, known)
            table.take(key)
            table.fault(key, f'"{key}" is not the name of a [[requirement]]{close}')
        elif (value := table.number(key, _quotient(known[key].unit, unit))) is not None:
            sensitivities[key] = value
    return sensitivities


def _single_sensitivity(section: Section, unit: str | None, requirement: Requirement) -> dict[str, float]:
    """The one number of a stack with one requirement."""
    value = section.number("sensitivity", _quotient(requirement.unit, unit))
    if value == 0.0:
        section.fault("sensitivity", "must not be 0: the part does not matter; remove it")
    return {} if value is None else {requirement.key: value}


def sensitivity_note(part: Part, requirement: Requirement) -> str:
    """A warning where a sensitivity is usual without units, but not as what it counts as in units of one kind (1 mm
    per in); empty where it is not.
    """
    value, quotient = part.sensitivities.get(requirement.key, 0.0), _quotient(requirement.unit, part.unit)
    try:
        (kind, one), (kind_of_part, one_of_part) = family(requirement.unit), family(part.unit)
    except ValueError:  # a scale with a zero of its own
        return ""
    plain = value * one / one_of_part
    as_stated, without_units = (USUAL[0] <= abs(number) <= USUAL[1] for number in (value, plain))
    if not quotient or kind != kind_of_part or not as_stated or without_units:
        return ""
    unit = requirement.unit
    text = f"part {part.name}: its sensitivity counts as {value:g} {quotient}, which is {plain:.3g} without units"
    return f'{text}; if {value:g} without units is meant, write "{value:g} {unit}/{unit}"'


def _quotient(unit: str, per: str | None) -> str:
    """The unit of a sensitivity; empty for a plain number."""
    try:
        same = per is None or family(unit) == family(per)
    except ValueError:
        same = True
    return "" if same and unit == (per or "") else f"{unit or '1'}/{per}" if per else unit


def sensitivity_faults(requirements: Sequence[Requirement], tables: Sequence[Mapping[str, Any]]) -> list[Fault]:
    """A formula or sensitivities for each requirement, never both, and no part without effect.

    `tables` are those of the parts, faulty ones included.
    """
    keys = [key for table in tables for key in _keys(table)]
    faults = []
    for requirement in requirements:
        if requirement.formula and requirement.key in keys:
            text = f"is given in addition to {requirement.place}.formula: keep only one of the two"
            faults += [
                Fault(f"part[{at}].sensitivity.{requirement.key}", text + _name(table))
                for at, table in enumerate(tables)
                if requirement.key in _keys(table)
            ]
        elif not requirement.formula and requirement.key and requirement.key not in keys:
            text = (
                f'"{requirement.key}" has no parts: give it a formula, or name it in the '
                f"sensitivity of a part, like sensitivity = {{ {requirement.key} = 1.0 }}"
            )
            faults.append(Fault(requirement.place, text))
    if not any(requirement.formula for requirement in requirements):
        text = "is missing: no requirement depends on the part"
        faults += [
            Fault(f"part[{at}].sensitivity", text + _name(table))
            for at, table in enumerate(tables)
            if "sensitivity" not in table
        ]
    return faults


def unused_part_faults(parts: Sequence[Part], used: Sequence[bool]) -> list[Fault]:
    """A fault for every part on which no requirement depends."""
    return [
        Fault(f"{place_of(parts, at)}.name", f"no requirement depends on it: remove it ({part.label})")
        for at, (part, is_used) in enumerate(zip(parts, used, strict=True))
        if not is_used
    ]


def _keys(table: Mapping[str, Any]) -> tuple[str, ...]:
    value = table.get("sensitivity")
    return tuple(value) if isinstance(value, Mapping) else ()


def _name(table: Mapping[str, Any]) -> str:
    name = table.get("name")
    return f" (part {name})" if isinstance(name, str) else ""


# Names in formulas.


_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


def form_complaint(name: str) -> str:
    """Why a text has not the form of a name, empty where it has."""
    if _NAME.fullmatch(name):
        return ""
    return f'must be letters, digits and _, and begin with a letter, got "{name}"'


def name_complaint(name: str) -> str:
    """Why a quantity in formulas cannot have a name, empty where it can."""
    if why := form_complaint(name):
        return why
    known = name in FUNCTIONS or name in CONSTANTS
    return f"{name} means something in formulas; choose another name" if known else ""


def unknown_name(name: str, column: int, parts: Sequence[Part], others: Iterable[str]) -> str:
    """Why a name in a formula is neither a part nor one of `others`; empty where it is."""
    whole = next((part for part in parts if part.name == name and part.count > 1), None)
    if whole is not None:
        return f"column {column}: {name} is built in {whole.count} times: write {', '.join(whole.pieces)}"
    known = [*(written for part in parts for written in part.written), *others]
    return "" if name in known else f'column {column}: "{name}" is not a part{nearest(name, [*known, *FUNCTIONS])}'


# The mechanism of a formula, and its faults.


NEGLIGIBLE = 1e-12
"""A part that adds less than this fraction of the worst case does not matter."""
STEP = 1e-4
"""Step to both sides of the mid-limits by which a kink is detected, in tolerances."""
KINK = 0.05
"""Difference of the slopes on both sides, as a fraction of all slopes, from which there is a kink."""


def mechanism_with_formula(
    bare: Mechanism,
    requirement: Requirement,
    parts: Sequence[Part],
    steps: tuple[Intermediate, ...],
    faults: list[Fault],
) -> Mechanism | None:
    """The mechanism of the requirement's formula, which may use the quantities of `steps`; None and
    faults where it has none.
    """
    place = f"{requirement.place}.formula"
    try:
        formula = Formula(requirement.formula, (*_steps_of(parts, {}), *steps))
    except FormulaError as error:
        faults.append(Fault(place, str(error)))
        return None
    before = len(faults)
    faults += _name_faults(formula, parts, requirement, [name for step in steps for name in step.names])
    used = [any(piece in formula.names for piece in part.pieces) for part in parts]
    faults += [
        Fault(f"part[{at}].nominal", f"is missing: the formula needs it (part {part.name})")
        for at, part in enumerate(parts)
        if used[at] and part.nominal is None and part.feature is None
    ]
    if len(faults) > before:
        return None
    users = [part for part, is_used in zip(parts, used, strict=True) if is_used]
    gain, scale = _units(requirement, users)
    formula = Formula(requirement.formula, (*_steps_of(parts, base_units(requirement, users)), *steps))
    scales = np.ones(len(parts))
    scales[used] = scale
    nominals = scales * np.array([part.nominal or 0.0 for part in parts])
    mids = nominals + scales * np.array([part.mean for part in parts])
    try:
        formula = formula.settled(*(dict(zip(bare.names, x[bare.owners], strict=True)) for x in (nominals, mids)))
    except UnsettledError as error:
        faults += [fault for reason in error.reasons if (fault := Fault(*reason)) not in faults]
        return None
    mechanism = replace(bare, formula=formula, mids=mids[bare.owners], scale=scales[bare.owners], gain=gain)
    if why := _undefined_reason(mechanism, nominals[bare.owners], parts):
        faults.append(Fault(place, why))
        return None
    mechanism, without_effect = linearise_mechanism(mechanism, np.array([part.high for part in parts])[bare.owners])
    faults += _effect_faults(mechanism, without_effect, parts, requirement)
    faults += _nominal_faults(requirement, value_at(mechanism, nominals[bare.owners]))
    loosest = np.array([[part.high for part in parts]])
    return replace(mechanism, undefined=domain_violation(mechanism, loosest[0], least_margin(mechanism, loosest)[0]))


def _steps_of(parts: Sequence[Part], base: Mapping[str, float]) -> Iterator[Intermediate]:
    """The quantities of features, in the units `base` of a formula."""
    return (step for part in parts if part.feature is not None for step in part.feature.steps(base))


def value_at(mechanism: Mechanism, x: Array) -> float:
    """The requirement by its formula at one point, pieces (k,) in the units of the formula."""
    return mechanism.gain * float(mechanism.stated[0].value(dict(zip(mechanism.names, x, strict=True))))


def linearise_mechanism(mechanism: Mechanism, loosest: Array) -> tuple[Mechanism, list[str]]:
    """The mechanism with its value and sensitivities at the mid-limits, and the pieces of the formula
    on which it does not depend anywhere within the loosest tolerances (k,).

    `rough` are the pieces without a finite slope other than 0, and those with a kink.
    """
    formula, mids, scale = mechanism.stated
    gradient = formula.gradient(dict(zip(mechanism.names, mids, strict=True)))
    slopes = mechanism.gain * scale * np.array([float(gradient.get(name, 0.0)) for name in mechanism.names])
    known = np.where(np.isfinite(slopes), slopes, 0.0)
    centre = value_at(mechanism, mids)
    mechanism = replace(mechanism, sensitivities=known, centre=centre)
    effects = np.abs(known) * loosest
    rough: list[str] = []
    without_effect: list[str] = []
    for i, name in enumerate(mechanism.names):
        if name not in formula.names or loosest[i] <= 0.0:
            continue
        steep = np.isfinite(slopes[i]) and effects[i] > NEGLIGIBLE * effects.sum()
        if steep and not (formula.kinked and _kink(mechanism, i, loosest[i], effects.sum())):
            continue
        matters = steep or not np.isfinite(slopes[i]) or _depends_on_piece(mechanism, i, loosest)
        (rough if matters else without_effect).append(name)
    return replace(mechanism, rough=tuple(rough)), without_effect


def _kink(mechanism: Mechanism, at: int, t: float, total: float) -> bool:
    """Whether the slopes on both sides of the mid-limit of a piece differ; `total` is the effect of
    the tolerances of all pieces.
    """
    _, mids, scale = mechanism.stated
    step = np.zeros_like(mids)
    step[at] = STEP * t * scale[at]
    ends = [value_at(mechanism, mids + side * step) for side in (-1.0, 0.0, 1.0)]
    return bool(abs(ends[0] - 2.0 * ends[1] + ends[2]) > KINK * STEP * total)


def _depends_on_piece(mechanism: Mechanism, at: int, loosest: Array) -> bool:
    """Whether the formula depends on a piece somewhere within the loosest tolerances (k,)."""
    formula, mids, scale = mechanism.stated
    used = [i for i, name in enumerate(mechanism.names) if name in formula.names]
    inside = box(len(used))
    points = np.zeros((len(mids), inside.shape[1]))
    points[used] = inside
    values = []
    for points[at] in (-1.0, 0.0, 1.0):
        x = mids[:, None] + (loosest * scale)[:, None] * points
        values.append(np.broadcast_to(formula.value(dict(zip(mechanism.names, x, strict=True))), inside.shape[1:]))
    return bool(np.nanmax(np.ptp(values, axis=0)) > NEGLIGIBLE * np.nanmax(np.abs(values)))


def _name_faults(
    formula: Formula, parts: Sequence[Part], requirement: Requirement, others: Sequence[str]
) -> list[Fault]:
    """Names that neither a part nor a quantity of `others` has, and parts that the one formula of a
    stack leaves out.
    """
    place = f"{requirement.place}.formula"
    reasons = (unknown_name(name, column, parts, others) for name, column in formula.written.items())
    faults = [Fault(place, why) for why in reasons if why]
    if requirement.key and not formula.names:
        faults.append(Fault(place, "has no parts: a requirement depends on at least one part"))
    for at, part in enumerate(parts if not requirement.key else ()):
        unused = [piece for piece in part.pieces or (part.name,) if piece not in formula.names]
        if unused and part.name not in formula.names and not _acts_in(part.feature, formula):
            text = f"{', '.join(unused)} does not appear in the formula: the requirement does not depend on it"
            faults.append(Fault(f"{place_of(parts, at)}.name", f"{text} ({part.label})"))
    return faults


def _acts_in(feature: Feature | None, formula: Formula) -> bool:
    """Whether there is a feature and a formula depends on it, by a piece or a quantity of it."""
    used = {*formula.names, *(name for step in formula.given for name in step.names)}
    return feature is not None and not used.isdisjoint((*feature.names, *feature.pieces))


def _units(requirement: Requirement, parts: Sequence[Part]) -> tuple[float, Array]:
    """The requirement's unit per unit of the formula, and the formula's units per unit of a part."""
    kind, factor = family(requirement.unit)
    base = base_units(requirement, parts)
    scale = [family(part.unit)[1] / base[family(part.unit)[0]] for part in parts]
    return base[kind] / factor, np.array(scale)


def _undefined_reason(mechanism: Mechanism, nominals: Array, parts: Sequence[Part]) -> str:
    """Why no design is within the domain: none at the nominals, or at the tightest tolerances."""
    formula = mechanism.stated[0]
    at_nominals = dict(zip(mechanism.names, nominals[:, None], strict=True))
    if why := formula.trouble(at_nominals):
        return f"at the nominal values, {why}"
    tightest = np.array([part.low for part in parts])
    if not formula.assembles and (why := formula.trouble(_points_within(mechanism, tightest))):
        remedy = "tighten the ranges or correct the formula"
        return f"even within the tightest tolerances, {why}; {remedy}"
    return ""


def _points_within(mechanism: Mechanism, t: Array) -> dict[str, Array]:
    """Points within the tolerances t (p,) of the pieces that the formula names."""
    formula, mids, scale = mechanism.stated
    used = [i for i, name in enumerate(mechanism.names) if name in formula.names]
    reach, points = t[mechanism.owners] * scale, box(len(used))
    points = mechanism.rounded(points, used)
    return {mechanism.names[i]: mids[i] + reach[i] * z for i, z in zip(used, points, strict=True)}


def domain_violation(mechanism: Mechanism, loosest: Array, margin: float) -> str:
    """Where the formula leaves its domain within the loosest tolerances (p,); empty if nowhere."""
    why = mechanism.stated[0].trouble(_points_within(mechanism, loosest))
    return why or ("some function leaves its domain" if margin < 0.0 else "")


def _effect_faults(
    mechanism: Mechanism, without_effect: Sequence[str], parts: Sequence[Part], requirement: Requirement
) -> list[Fault]:
    """Pieces without effect on the requirement."""
    owner = dict(zip(mechanism.names, mechanism.owner, strict=True))
    return [
        Fault(
            f"{requirement.place}.formula" if requirement.key else f"{place_of(parts, owner[name])}.name",
            f"the requirement does not depend on {name} anywhere within the tolerances: leave it out "
            f"({parts[owner[name]].label})",
        )
        for name in without_effect
    ]


def _nominal_faults(requirement: Requirement, computed: float) -> list[Fault]:
    """The stated nominal against the formula's, up to the digits it is stated with."""
    if requirement.nominal is None:
        return []
    rounding = _rounding(requirement.stated_nominal, requirement.unit)
    allowed = min(rounding, 1e-3 * abs(computed)) * 1.001 + 1e-12 * abs(computed)
    if abs(requirement.nominal - computed) <= allowed:
        return []
    given = f"{computed:.10g} {requirement.unit}".rstrip()
    text = f"is stated as {requirement.nominal:.10g}, but the formula gives {given} at the nominals; correct either"
    return [Fault(f"{requirement.place}.nominal", text)]


def _rounding(stated: object, unit: str) -> float:
    """Half a step of the last digit that a nominal is stated with."""
    match = re.match(r"\s*[+-]?\d*\.?(\d*)(?:[eE]([+-]?\d+))?\s*(.*)", str(stated))
    assert match is not None
    step = 0.5 * 10.0 ** (int(match[2] or 0) - len(match[1]))
    return step * abs(to_unit(f"1 {match[3]}", unit)) if match[3].strip() else step


# From requirements and parts to mechanisms, with everything checked that can be.


def mechanisms_of(
    requirements: Sequence[Requirement],
    parts: Sequence[Part],
    correlations: Sequence[Correlation],
    steps: tuple[Intermediate, ...],
    faults: list[Fault],
) -> tuple[Mechanism, ...]:
    """The mechanism of each requirement; fewer, and every fault, where the parts make none.

    `steps` are intermediate quantities, each after those that it depends on.
    """
    correlation = _matrix(parts, correlations, faults)
    candidates = [_mechanism(requirement, parts, correlation, steps, faults) for requirement in requirements]
    mechanisms = tuple(mechanism for mechanism in candidates if mechanism is not None)
    if steps and len(mechanisms) == len(requirements):
        from .intermediate import intermediate_faults

        pairs = zip(requirements, mechanisms, strict=True)
        used = [(requirement, m.formula) for requirement, m in pairs if m.formula is not None]
        faults += intermediate_faults(steps, used, parts)
    if requirements[0].key and len(mechanisms) == len(requirements):
        acting = np.any([mechanism.acting for mechanism in mechanisms], axis=0)
        owners = mechanisms[0].owners
        formulas = [mechanism.formula for mechanism in mechanisms if mechanism.formula is not None]
        used_parts = [
            bool(np.any(acting[owners == at])) or any(_acts_in(part.feature, formula) for formula in formulas)
            for at, part in enumerate(parts)
        ]
        faults += unused_part_faults(parts, used_parts)
    return mechanisms


def _mechanism(
    requirement: Requirement,
    parts: Sequence[Part],
    correlation: Array | None,
    steps: tuple[Intermediate, ...],
    faults: list[Fault],
) -> Mechanism | None:
    """The mechanism of one requirement; None and every fault where the parts do not make one."""
    owner = tuple(at for at, part in enumerate(parts) for _ in part.pieces)
    bare = Mechanism(
        names=tuple(piece for part in parts for piece in part.pieces),
        owner=owner,
        inputs=tuple(part.distribution for part in parts),
        sensitivities=np.zeros(len(owner)),
        centre=0.0,
        lower=-np.inf if requirement.lower is None else requirement.lower,
        upper=np.inf if requirement.upper is None else requirement.upper,
        correlation=correlation,
        discs=tuple(disc for at, part in enumerate(parts) if part.feature and (disc := part.feature.disc(owner, at))),
    )
    if requirement.formula:
        return mechanism_with_formula(bare, requirement, parts, steps, faults)
    return _mechanism_with_sensitivities(bare, requirement, parts, faults)


def _matrix(parts: Sequence[Part], correlations: Sequence[Correlation], faults: list[Fault]) -> Array | None:
    """The correlation matrix of the pieces, None where all are independent."""
    if not correlations:
        return None
    at = {piece: i for i, piece in enumerate(p for part in parts for p in part.pieces)}
    matrix = np.eye(len(at))
    for correlation in correlations:
        i, j = (at[piece] for piece in correlation.pieces)
        matrix[i, j] = matrix[j, i] = correlation.coefficient
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least < -1e-10:
        text = f"the matrix is not positive semidefinite (its smallest eigenvalue is {least:.4g}): "
        faults.append(Fault("correlation", f"{text}no parts can vary like this; make the coefficients smaller"))
        return None
    return matrix


def _mechanism_with_sensitivities(
    bare: Mechanism, requirement: Requirement, parts: Sequence[Part], faults: list[Fault]
) -> Mechanism | None:
    """The mechanism whose parts state their sensitivities."""
    slopes = np.array([part.sensitivities.get(requirement.key, 0.0) for part in parts])
    nominal = requirement.nominal
    if nominal is None:
        missing = [
            part.name for part, slope in zip(parts, slopes, strict=True) if part.nominal is None and slope != 0.0
        ]
        if missing and bare.bounded:
            text = "is missing: lower and upper need it, or the nominal of every part (not given: "
            faults.append(Fault(f"{requirement.place}.nominal", f"{text}{', '.join(missing)})"))
            return None
        nominal = nominal_sum(requirement, parts)
    moved = float(sum(s * part.mean * part.count for s, part in zip(slopes, parts, strict=True)))
    return replace(bare, sensitivities=slopes[bare.owners], centre=nominal + moved)


def nominal_sum(requirement: Requirement, parts: Sequence[Part]) -> float:
    """The requirement of a loop of dimensions: sum of sensitivity times nominal, to twelve digits of the largest of
    them: 40.1 - 40 is 0.1.
    """
    terms = [p.sensitivities.get(requirement.key, 0.0) * (p.nominal or 0.0) * p.count for p in parts]
    largest = max(map(abs, terms), default=0.0)
    return round(math.fsum(terms), 12 - math.ceil(math.log10(largest))) if largest else 0.0

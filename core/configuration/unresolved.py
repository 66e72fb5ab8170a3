"""`[[unresolved]]`: smooth terms of the corrected model that no effect of the library explains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from ..models.effects.compose import Active
from ..models.effects.measurements import target_of
from ..models.effects.unresolved import SHAPES, Term, Unresolved, unresolved_of
from ..models.measurable import MeasurableModel
from ..section import Section, shown
from .plugins import ModelClass

UNRESOLVED = "unresolved"
TEXTS, FLAGS = ("output", "variable", "shape", "times"), ("signed", "turns", "times_magnitude")
LISTS = ("knots", "heights", "coefficients", "labels")


def read_unresolved(top: Section, model: ModelClass | MeasurableModel | None, name: str) -> tuple[Active, ...]:
    """The terms in the model `name`, of the class `model` (None where it is not known)."""
    sections = top.items(UNRESOLVED)
    terms = [_term(section) for section in sections]
    if model is None:
        return ()
    target = target_of(model, name) if sections else None
    for section, term in zip(sections, terms, strict=True):
        if term is not None and target is not None and not term.effect.own_applies(target):
            section.fault("variable", f"the model {name} lacks a column or the output of this term")
    return tuple(term for term in terms if term is not None)


def _term(section: Section) -> Active | None:
    """One table; None where it is at fault."""
    faulty = False
    for key in ("output", "variable", "shape", "coefficients"):
        if key not in section:
            section.fault(key, "is missing: a term has an output, a variable, a shape and coefficients")
            faulty = True
    term_table: dict[str, Any] = {}
    for key in (*(field.name for field in fields(Term)), "coefficients"):
        if key in section:
            value = _value(section, key)
            faulty |= value is None
            term_table[key] = value
    if not faulty and len(term_table.get("heights", ())) != len(term_table.get("knots", ())) * (
        term_table["shape"] == "curve"
    ):
        section.fault("heights", "must have as many numbers as a curve has knots, and none for another shape")
        faulty = True
    section.finish()
    if faulty:
        return None
    effect, values = unresolved_of(term_table)
    if len(values) != effect.term.count:
        section.fault("coefficients", f"are {len(values)}, but a {effect.term.shape} like this has {effect.term.count}")
        return None
    return Active(effect, values)


def _value(section: Section, key: str) -> Any:
    if key == "shape":
        return section.text(key, SHAPES)
    if key in TEXTS:
        return section.text(key)
    if key in FLAGS:
        return section.flag(key)
    if key not in LISTS:
        return section.number(key, "")
    value = section.take(key)
    kinds, what = ((str,), "texts") if key == "labels" else ((int, float), "numbers")
    if not isinstance(value, list) or not all(type(entry) in kinds for entry in value):
        section.fault(key, f"must be a list of {what}, got {shown(value)}")
        return None
    return value if key == "labels" else [float(number) for number in value]


def resolved_unresolved(effects: Iterable[Active]) -> dict[str, list[Mapping[str, Any]]]:
    """The `[[unresolved]]` tables of the effects that are such terms; none where there is none."""
    tables: list[Mapping[str, Any]] = [
        active.effect.term.table(active.effect.coefficients(active.values))
        for active in effects
        if isinstance(active.effect, Unresolved)
    ]
    return {UNRESOLVED: tables} if tables else {}

"""Document A's table of precision weights: final errors, transmission error, force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from ....declarations import Output, Parameter, Value, number
from ....models.assembly.document import Row, rows
from ....models.assembly.regulator import INSERTIONS, READINGS
from ....models.assembly.transmission import ECCENTRICS, AngleMapping, Transmission
from ....records import Axis
from ....units import ARCSEC
from ..calculation import Calculation, Computed, ComputedTable, Quantity
from .results import assumed, parameter

LABELS = ("q0", "q5", "q10", "ideal")
"""The rows: precision weight 0, 5, 10, infinite."""
UNITS = {"mrad": "mrad", "percent": "percent", "mrad2": "mrad**2", "arcsec": "arcsec", "N": "N"}
SCALARS = tuple(field.name for field in fields(Row) if field.name not in ("precision_weight", "state_mrad"))
STATES = tuple(f"state_{at}_mrad" for at in range(1, 5))
_FIT = "assumed: no document prints how the angles act on the contact"


def _unit(name: str) -> str:
    return UNITS[name.rpartition("_")[2]]


def _choice(name: str, choices: tuple[str, ...], meaning: str) -> Parameter:
    return parameter(name, choices[0], meaning, "document A", choices=choices)


class AssemblyAdjustment(Calculation):
    """Final errors, transmission error and force of document A's parts at Q = 0, 5, 10, infinity.

    The four printed part errors, assembled with the printed recursion, then the loaded contact.
    """

    name = "assembly_adjustment"
    about = "Final errors, transmission error and force of document A's parts by precision weight."
    reference = "document A, table of precision weights"
    sampled = False
    parameters = (
        _choice("reading", READINGS, "what the weight Q weighs"),
        _choice("insertion", INSERTIONS, "whether a step adjusts before or after its part is put in"),
        assumed(
            "eccentrics",
            ECCENTRICS[0],
            "crankshafts 1 and 2 act on eccentrics of one crank, or of a crank of their own",
            _FIT,
            choices=ECCENTRICS,
        ),
        assumed("absorption", 1.0, "share of an angle that reaches the contact", _FIT, 0.0, 10.0),
        assumed(
            "floor_arcsec", 0.0, "amplitude of the transmission error that is not due to these angles", _FIT, 0.0, 1e3
        ),
    )
    outputs = tuple(
        Output(f"{label}_{name}", _unit(name), f"{name.replace('_', ' ')} at {label}")
        for label in LABELS
        for name in (*SCALARS, *STATES)
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        floor = number(parameters["floor_arcsec"]) * ARCSEC
        mapping = AngleMapping(str(parameters["eccentrics"]), number(parameters["absorption"]), floor)
        computed_rows = rows(Transmission(mapping=mapping), str(parameters["reading"]), str(parameters["insertion"]))
        quantities = {
            f"{label}_{name}": Quantity(value, _unit(name))
            for label, row in zip(LABELS, computed_rows, strict=True)
            for name, value in _values(row).items()
        }
        return Computed(quantities, (_table(computed_rows, parameters),))


def _values(row: Row) -> dict[str, float]:
    states = dict(zip(STATES, row.state_mrad, strict=True))
    return {name: float(getattr(row, name)) for name in SCALARS} | states


def _table(computed_rows: tuple[Row, ...], parameters: Mapping[str, Value]) -> ComputedTable:
    names = (*STATES, *SCALARS)
    columns = [np.array([_values(row)[name] for row in computed_rows]) for name in names]
    stated = ", ".join(f"{key} {value}" for key, value in parameters.items())
    return ComputedTable(
        "rows",
        f"Document A's table recomputed: {stated}",
        (Axis("precision_weight", "1"), *(Axis(name, _unit(name)) for name in names)),
        (np.array(["0", "5", "10", "infinite"]), *columns),
    )

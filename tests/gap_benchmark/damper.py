"""A friction damper of the tests' own: a Coulomb-elastic (Jenkins) element along a path."""

from __future__ import annotations

import hashlib
import json
import lzma
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tolevo.models.inputs import Distribution
from tolevo.models.measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Role
from tolevo.section import Array, Output, Parameter, Value, number

ARTS = Path(__file__).parent / "arts"
SHA256 = {
    "0.5": "7ded96e7236317bcdc574182473967c5c072e687c7d7b5e0b694bcf93a4eb7f9",
    "1": "3d58d0f71296a6221974c14454352fa29a27d536295fd5cb05e6d946a7cf30db",
}
EVERY = 8
"""One row in so many is used: 128 per second of a movement of 0.5 Hz."""


def arts(amplitude: str) -> pd.DataFrame:
    """The record of that amplitude [in], in the columns of the model."""
    packed = ARTS / f"0.5Hz30lbtension{amplitude}amplitude.json.xz"
    content = lzma.decompress(packed.read_bytes())
    assert hashlib.sha256(content).hexdigest() == SHA256[amplitude]
    rows = np.array(json.loads(content)["data"])[::EVERY]
    names = {"time_s": rows[:, 0], "displacement_in": rows[:, 1], "force_kip": rows[:, 2]}
    return pd.DataFrame(names)


def deflection(path: Array, limit: float, start: float) -> Array:
    """How far (n,) the spring and its play are drawn along a path (n,), at most `limit`."""
    here, found = start, np.empty(len(path))
    for at, step in enumerate(np.diff(path, prepend=path[0]).tolist()):
        here = min(max(here + step, -limit), limit)
        found[at] = here
    return found


class Jenkins(MeasurableModel):
    """A spring in series with a Coulomb slider; a clearance in series opens before it.

    F = k sgn(u) max(|u| - c/2, 0); u follows the displacement within +-(c/2 + F_slip/k).
    """

    columns = (Column("displacement_in", "in", "movement of the damper", role=Role.POSITION),)
    outputs = (Output("force_kip", "kip", "friction force"),)
    parameters = (
        Parameter("stiffness_kip_per_in", 12.0, "kip/in", "spring", low=0.1, high=1000.0),
        Parameter("slip_force_kip", 2.0, "kip", "force at which it slips", low=0.01, high=100.0),
        Parameter("start_in", 0.0, "in", "deflection at the first row", low=-1.0, high=1.0),
    )
    free: ClassVar[Mapping[str, float]] = {
        "stiffness_kip_per_in": 50.0, "slip_force_kip": 2.0, "start_in": 0.3,
    }  # fmt: skip
    changeable = (Changeable("bearing_clearance_in", "in", "full width of the play in series"),)

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        given = {one.name: one.default for one in self.parameters} | dict(parameters or {})
        names = (one.name for one in self.parameters)
        self.stiffness, self.slip, self.start = (number(given[name]) for name in names)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        width = float(np.max(changes.get("bearing_clearance_in", np.zeros(1))))
        path = np.asarray(table["displacement_in"], dtype=float)
        drawn = deflection(path, width / 2.0 + self.slip / self.stiffness, self.start)
        pressed = np.maximum(np.abs(drawn) - width / 2.0, 0.0)
        return {"force_kip": self.stiffness * np.sign(drawn) * pressed}

"""The arm of a configuration without a table: KUKA KR 5 arc."""

from __future__ import annotations

from functools import lru_cache

from ...models.serial_arm.cell import Cell
from ...models.serial_arm.declared import nominal
from ..reducers.documents import documents_reducer
from .definition import Definition, Gearing, Joint

SOURCE = (
    "KUKA KR 5 arc: Denavit-Hartenberg table of Robotics Toolbox for Python 1.5 (P. Corke, "
    "J. Haviland, MIT licence), after A. Gil's ARTE; masses, wrist and cell are assumed"
)
ROWS = {
    "d": (400.0, 0.0, 0.0, -620.0, 0.0, -115.0),
    "a": (180.0, 600.0, 120.0, 0.0, 0.0, 0.0),
    "alpha": (-90.0, 0.0, 90.0, -90.0, 90.0, 180.0),
    "offset": (0.0,) * 6,
}
MASS = (30.0, 22.0, 30.0, 5.0, 3.0, 2.0)
CENTRE = ((-0.08, 0.0, 0.05), (-0.32, 0.0, 0.1), (-0.02, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.02), (0.0, 0.0, 0.03))
STIFFNESS = (108.0, 108.0, 108.0, 20.0, 20.0, 10.0)
WRIST = 3
"""Joints before the wrist, whose reducers cost half and have 1.5 times the backlash."""


@lru_cache(maxsize=4)
def shipped_arm(nested: bool = True, per_drive: bool = True, cell: Cell | None = None) -> Definition:
    """The KR 5 arc before a cube of 400 mm, tool down."""
    table = {nominal(column, at): value for column, row in ROWS.items() for at, value in enumerate(row, 1)}
    joints = tuple(
        Joint(
            mass, centre, gearing=Gearing(documents_reducer(), *((1.0, 1.0) if at < WRIST else (0.5, 1.5)), stiffness=k)
        )
        for at, (mass, centre, k) in enumerate(zip(MASS, CENTRE, STIFFNESS, strict=True))
    )
    return Definition(table, joints, cell or Cell((0.85, 0.0, 0.7), 0.4), nested, per_drive, SOURCE)

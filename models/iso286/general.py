"""General tolerances of ISO 2768, which apply where a drawing states none."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, radians

CLASSES = ("f", "m", "c", "v")
"""ISO 2768-1: fine, medium, coarse, very coarse."""
GEOMETRICAL = ("H", "K", "L")
"""ISO 2768-2."""
MIN_GENERAL_SIZE_MM = 0.5
"""Below this nominal size [mm] a drawing states each tolerance."""
_NOT_TABULATED = -1.0

_Ends = tuple[float, ...]
_Table = Mapping[str, _Ends]

_LINEAR_ENDS = (3.0, 6.0, 30.0, 120.0, 400.0, 1000.0, 2000.0, 4000.0)
_LINEAR = {
    "f": (0.05, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, _NOT_TABULATED),
    "m": (0.1, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0),
    "c": (0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 4.0),
    "v": (_NOT_TABULATED, 0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 8.0),
}
_RADIUS_ENDS = (3.0, 6.0, inf)
_RADIUS = {"f": (0.2, 0.5, 1.0), "m": (0.2, 0.5, 1.0), "c": (0.4, 1.0, 2.0), "v": (0.4, 1.0, 2.0)}
_ANGLE_ENDS = (10.0, 50.0, 120.0, 400.0, inf)
_MINUTES = {
    "f": (60.0, 30.0, 20.0, 10.0, 5.0),
    "m": (60.0, 30.0, 20.0, 10.0, 5.0),
    "c": (90.0, 60.0, 30.0, 15.0, 10.0),
    "v": (180.0, 120.0, 60.0, 30.0, 20.0),
}
_FORM_ENDS = (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
_LEG_ENDS = (100.0, 300.0, 1000.0, 3000.0)
_FORM = {
    "H": (0.02, 0.05, 0.1, 0.2, 0.3, 0.4),
    "K": (0.05, 0.1, 0.2, 0.4, 0.6, 0.8),
    "L": (0.1, 0.2, 0.4, 0.8, 1.2, 1.6),
}
_ZONES: dict[str, tuple[_Ends, _Table]] = {
    "straightness": (_FORM_ENDS, _FORM),
    "flatness": (_FORM_ENDS, _FORM),
    "perpendicularity": (_LEG_ENDS, {"H": (0.2, 0.3, 0.4, 0.5), "K": (0.4, 0.6, 0.8, 1.0), "L": (0.6, 1.0, 1.5, 2.0)}),
    "symmetry": (_LEG_ENDS, {"H": (0.5, 0.5, 0.5, 0.5), "K": (0.6, 0.6, 0.8, 1.0), "L": (0.6, 1.0, 1.5, 2.0)}),
    "circular_runout": ((inf,), {"H": (0.1,), "K": (0.2,), "L": (0.5,)}),
}


def linear_mm(kind: str, size: float, radius: bool = False) -> float:
    """Half-width [mm] of a general tolerance of a length, or of an external radius or chamfer.

    Raises ValueError for an unknown class and a nominal size [mm] that the class does not cover.

    Reference: ISO 2768-1:1989, tables 1 and 2.
    """
    _check_class(kind, CLASSES)
    return _value(_RADIUS_ENDS, _RADIUS, kind, size) if radius else _value(_LINEAR_ENDS, _LINEAR, kind, size)


def angle_rad(kind: str, leg: float) -> float:
    """Half-width [rad] of a general tolerance of an angle, by its shorter leg [mm].

    Reference: ISO 2768-1:1989, table 3.
    """
    _check_class(kind, CLASSES)
    if not leg > 0.0:
        raise ValueError(f"the shorter leg of an angle must be above 0 mm, got {leg:g} mm")
    return radians(_value(_ANGLE_ENDS, _MINUTES, kind, leg, 0.0) / 60.0)


def geometrical_mm(characteristic: str, kind: str, size: float) -> float:
    """Width [mm] of the zone of a general geometrical tolerance at a length [mm].

    Raises ValueError for a characteristic that the standard does not cover, and as `linear_mm`.

    Reference: ISO 2768-2:1989, tables 1 to 4.
    """
    _check_class(kind, GEOMETRICAL)
    covered = SYNONYMS.get(characteristic, characteristic)
    if covered not in _ZONES:
        raise ValueError(f"ISO 2768-2 has general tolerances of {', '.join(_ZONES)} only, got {characteristic}")
    return _value(*_ZONES[covered], kind, size, 0.0)


def _check_class(kind: str, classes: tuple[str, ...]) -> None:
    if kind not in classes:
        raise ValueError(f'must be one of {", ".join(classes)}, got "{kind}"')


def _value(ends: _Ends, table: _Table, kind: str, size: float, smallest: float = MIN_GENERAL_SIZE_MM) -> float:
    within = smallest <= size <= ends[-1] and size > 0.0
    at = next((at for at, end in enumerate(ends) if size <= end), 0)
    if not within or table[kind][at] == _NOT_TABULATED:
        raise ValueError(f"ISO 2768 has no tolerance of class {kind} for {size:g} mm: state a tolerance")
    return table[kind][at]


# Symbols of geometrical characteristics on drawings, ISO 1101.


SYMBOLS = {
    "straightness": "\u23e4",
    "flatness": "\u23e5",
    "roundness": "\u25cb",
    "cylindricity": "\u232d",
    "line_profile": "\u2312",
    "surface_profile": "\u2313",
    "parallelism": "\u2225",
    "perpendicularity": "\u27c2",
    "angularity": "\u2220",
    "position": "\u2316",
    "concentricity": "\u25ce",
    "symmetry": "\u232f",
    "circular_runout": "\u2197",
    "total_runout": "\u2330",
}
"""By name; ISO 1101:2017, table 2."""
SYNONYMS = {
    "circularity": "roundness",
    "coaxiality": "concentricity",
    "profile_of_a_line": "line_profile",
    "profile_of_a_surface": "surface_profile",
    "squareness": "perpendicularity",
    "true_position": "position",
    "runout": "circular_runout",
}
"""Other names of the same characteristics, in standards and on drawings."""
SYMBOLS |= {name: SYMBOLS[same] for name, same in SYNONYMS.items()}


def characteristic_of(text: str) -> str:
    """The name in `SYMBOLS` of what a drawing may write as "Total run-out"; other text as it is."""
    plain = "_".join(text.lower().replace("-", " ").split()).replace("run_out", "runout")
    return plain if plain in SYMBOLS else text

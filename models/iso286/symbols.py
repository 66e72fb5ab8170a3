"""Symbols of geometrical characteristics on drawings, ISO 1101."""

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

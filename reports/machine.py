"""The picture of a machine in its cell, its links and joints coloured by their share of R^2."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ..arrays import Array
from .document import section

WIDTH, HEIGHT, EDGE = 640.0, 420.0, 46.0
VIEW = (np.radians(-60.0), np.radians(18.0))
"""Azimuth and elevation of the eye."""
PALE, DEEP = np.array([214.0, 222.0, 232.0]), np.array([178.0, 34.0, 34.0])
"""Colours of a share of zero and of the largest share."""
JOINT, LINK, TOOL = 14.0, 7.0, 3.0
READABLE = 0.35
"""Share, over the largest, from which on a number is white on its joint."""


def machine_sections(summary: Mapping[str, Any]) -> tuple[str, ...]:
    """The section with the picture, none where the run has stored no machine."""
    stored = summary.get("machine")
    if not isinstance(stored, Mapping):
        return ()
    cost = float(stored["cost"])
    caption = (
        f"The machine in the middle of its poses (dots), at cost {cost:.4g}: links and "
        "joints by their share of the squared position error, from pale (none) to red (the "
        "largest). The shares are listed below."
    )
    body = f"<figure>{_drawing(stored, caption)}<figcaption>{escape(caption)}</figcaption></figure>"
    return (section("Where the error is made", body + _listed(stored["parts"])),)


def _drawing(stored: Mapping[str, Any], caption: str) -> str:
    parts: Sequence[Mapping[str, Any]] = stored["parts"]
    lines = [_projected(part["points"]) for part in parts]
    poses = _projected(stored["poses"])
    points = np.vstack([*lines, poses])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = float(np.min((np.array([WIDTH, HEIGHT]) - 2.0 * EDGE) / np.maximum(high - low, 1e-9)))
    shift = 0.5 * (np.array([WIDTH, HEIGHT]) - scale * (low + high))
    most = max(float(part["share"]) for part in parts) or 1.0
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.4" fill="#8a94a3"/>'
        for x, y in np.unique(np.round(scale * poses + shift, 1), axis=0)
    )
    shapes = [_shape(part, scale * line + shift, most) for part, line in zip(parts, lines, strict=True)]
    return (
        f'<svg role="img" aria-label="{escape(caption)}" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" '
        f'style="max-width:{WIDTH:g}px;width:100%">{dots}{"".join(shapes)}</svg>'
    )


def _projected(points: Sequence[Sequence[float]]) -> Array:
    """Points (n, 3) [mm] projected as the eye sees them (n, 2), y down."""
    x, y, z = np.array(points, dtype=float).reshape(-1, 3).T
    azimuth, elevation = VIEW
    across = -np.sin(azimuth) * x + np.cos(azimuth) * y
    away = np.cos(azimuth) * x + np.sin(azimuth) * y
    return np.column_stack([across, np.sin(elevation) * away - np.cos(elevation) * z])


def _shape(part: Mapping[str, Any], points: Array, most: float) -> str:
    share = float(part["share"])
    colour = _colour(share / most)
    title = f"<title>{escape(str(part['name']))}: {share:.3g} %</title>"
    if part["kind"] == "joint":
        x, y = points[0]
        label = escape(str(part["name"]).rpartition(" ")[2])
        ink = "#fff" if share > READABLE * most else "#222"
        return (
            f'<g>{title}<circle cx="{x:.1f}" cy="{y:.1f}" r="{JOINT:g}" fill="{colour}" '
            f'stroke="#222" stroke-width="1.2"/><text x="{x:.1f}" y="{y + 5.5:.1f}" '
            f'text-anchor="middle" font-size="16" fill="{ink}">{label}</text></g>'
        )
    width = TOOL if part["kind"] == "tool" else LINK
    stroke = "#222" if part["kind"] == "tool" else colour
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return (
        f'<g>{title}<polyline points="{path}" fill="none" stroke="{stroke}" stroke-width='
        f'"{width:g}" stroke-linejoin="round" stroke-linecap="round"/></g>'
    )


def _colour(share: float) -> str:
    red, green, blue = np.rint(PALE + np.sqrt(max(share, 0.0)) * (DEEP - PALE)).astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _listed(parts: Sequence[Mapping[str, Any]]) -> str:
    """The shares as text, the largest first, for readers who cannot rely on colours."""
    ranked = sorted((part for part in parts if float(part["share"]) >= 0.05), key=lambda part: -float(part["share"]))
    words = ", ".join(f"{escape(str(part['name']))} {float(part['share']):.3g} %" for part in ranked)
    return f"<p>{words}.</p>"

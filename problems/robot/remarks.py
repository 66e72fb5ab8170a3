"""Where the next unit of cost reduces the error most, in words."""

from __future__ import annotations

import pandas as pd

MOST = 3
"""Tolerances that are named."""


def remarks_of(front: pd.DataFrame) -> tuple[str, ...]:
    """The best prices and the largest fractions of R^2 at the front's middle point by cost."""
    if front.empty:
        return ()
    order = front["cost"].astype(float).argsort(kind="stable")
    row = front.iloc[int(order.iloc[len(front) // 2])]
    values = {str(name): float(value) for name, value in row.items() if str(name).startswith(("price_", "share_"))}
    where = f"at cost {float(row['cost']):.4g} (A {float(row['pose_accuracy_mm']):.3g} mm)"
    bought = ", ".join(f"{name} {value:.3g} um" for name, value in _largest(values, "price_", ""))
    largest = ", ".join(f"{name} {value:.3g} %" for name, value in _largest(values, "share_", "_percent"))
    return (
        f"{where} a further unit of cost lowers R most where it is spent on {bought}; the largest fractions of R^2 "
        f"are {largest}",
    )


def _largest(values: dict[str, float], begins: str, ends: str) -> list[tuple[str, float]]:
    ranked = [
        (name.removeprefix(begins).removesuffix(ends), value)
        for name, value in values.items()
        if name.startswith(begins)
    ]
    return sorted(ranked, key=lambda pair: -pair[1])[:MOST]

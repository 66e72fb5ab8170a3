"""A gear by the orders of its errors: waves per turn of the output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

PINS, CRANK = "pin passing", "crank"
DECLARED = "declared"
"""Kind of a gear that is given by its orders."""
SUN_OVER_CARRIER, SUN = "sun against the carrier", "sun"
NAMED = (PINS, CRANK, SUN_OVER_CARRIER, SUN)
"""Orders that named effects cover."""
TWICE = (PINS, CRANK)
"""Orders that two discs, half a turn apart, also show doubled."""


@dataclass(frozen=True)
class Gear:
    """Its `kind`, and the waves per turn of the output by their source."""

    kind: str
    orders: Mapping[str, float]

    def has(self, *names: str) -> bool:
        """Whether all these orders are known."""
        return set(names) <= set(self.orders)

    @property
    def waves(self) -> tuple[float, ...]:
        """Every order, rising, and the doubles that two discs show."""
        doubled = [2.0 * self.orders[name] for name in TWICE if name in self.orders]
        return tuple(sorted({*self.orders.values(), *doubled}))

    @property
    def unnamed(self) -> tuple[float, ...]:
        """Orders, rising, that no named effect covers."""
        return tuple(sorted({order for name, order in self.orders.items() if name not in NAMED}))

    def name_of(self, order: float) -> str:
        """The source of the waves of an order, empty where the gear has none."""
        near = (name for name, known_order in self.orders.items() if abs(known_order - order) < 1e-6 * known_order)
        return next(near, "")


def cycloidal(teeth: Mapping[str, int]) -> Gear:
    """Discs on eccentrics in a fixed ring of pins; the rotation of the discs is the output.

    Per turn of the output the eccentrics turn z_c/(z_p - z_c) times in the ring, and
    z_p/(z_p - z_c) times in the output. Reference: Blanche and Yang, J. Mech. Transm. Autom. Des.
    111, 1989.
    """
    step = teeth["pins"] - teeth["cycloid_teeth"]
    return Gear("cycloidal", {PINS: teeth["cycloid_teeth"] / step, CRANK: teeth["pins"] / step})


def rv(teeth: Mapping[str, int]) -> Gear:
    """A cycloidal stage after planets on a sun: these turn the cranks, the carrier is the output.

    Against the carrier the sun turns z_2/z_1 times as often as a crank, in the housing once more:
    the reduction ratio. Reference: Yang and Blanche, Mech. Mach. Theory 25, 1990.
    """
    orders = dict(cycloidal(teeth).orders)
    over = orders[CRANK] * teeth["planet_teeth"] / teeth["sun_teeth"]
    return Gear("rv", orders | {SUN_OVER_CARRIER: over, SUN: over + 1.0})


def harmonic(teeth: Mapping[str, int]) -> Gear:
    """A wave generator in a flexspline, which is the output; the circular spline is fixed.

    Per turn of the output the generator turns z_f/(z_c - z_f) times against the circular spline
    and once more against the flexspline. Its error waves twice per turn of the generator, since
    teeth engage at both ends. Reference: Ghorbel, Gandhi and Alpeter, J. Mech. Des. 123, 2001.
    """
    once = teeth["flex_teeth"] / (teeth["circular_teeth"] - teeth["flex_teeth"])
    return Gear(
        "harmonic",
        {
            "wave generator": once,
            "wave generator, twice a turn": 2.0 * once,
            "wave generator, four times a turn": 4.0 * once,
            "wave generator on the flexspline": once + 1.0,
            "wave generator on the flexspline, twice a turn": 2.0 * once + 2.0,
        },
    )


def planetary(teeth: Mapping[str, int]) -> Gear:
    """The sun is the input, the ring is fixed, the carrier is the output.

    Per turn of the carrier the sun turns z_r/z_s times against it, a planet z_r/z_p times, and z_r
    teeth pass in mesh. Reference: Inalpolat and Kahraman, J. Sound Vib. 323, 2009.
    """
    ring, over = teeth["ring_teeth"], teeth["ring_teeth"] / teeth["sun_teeth"]
    return Gear(
        "planetary",
        {
            SUN_OVER_CARRIER: over,
            SUN: over + 1.0,
            "planet": ring / teeth["planet_teeth"],
            "planet passing": float(teeth["planets"]),
            "planets over the sun": teeth["planets"] * over,
            "tooth mesh": float(ring),
        },
    )


TEETH: Mapping[str, tuple[str, ...]] = {
    "rv": ("pins", "cycloid_teeth", "sun_teeth", "planet_teeth"),
    "cycloidal": ("pins", "cycloid_teeth"),
    "harmonic": ("flex_teeth", "circular_teeth"),
    "planetary": ("sun_teeth", "planet_teeth", "ring_teeth", "planets"),
}
"""The counts that each kind of gear needs."""
BUILD = {"rv": rv, "cycloidal": cycloidal, "harmonic": harmonic, "planetary": planetary}
RV_40E = rv({"pins": 40, "cycloid_teeth": 39, "sun_teeth": 12, "planet_teeth": 36})
"""The RV-40E-121 of document B."""


def rv_teeth_of_ratio(pins: int, cycloid_teeth: int, ratio: float) -> Gear:
    """An RV reducer whose involute stage is given by the reduction ratio i; with a ratio of
    z_c or less there is none, and the crankshafts are the input.
    """
    gear = cycloidal({"pins": pins, "cycloid_teeth": cycloid_teeth})
    if ratio <= gear.orders[CRANK]:
        return gear
    return Gear("rv", {**gear.orders, SUN_OVER_CARRIER: ratio - 1.0, SUN: ratio})


def contradictions(kind: str, teeth: Mapping[str, int]) -> dict[str, str]:
    """Contradictions between the counts of a gear, by their name."""
    if kind == "planetary":
        ring = teeth["sun_teeth"] + 2 * teeth["planet_teeth"]
        if teeth["ring_teeth"] == ring:
            return {}
        reason = f"must be sun_teeth + 2 planet_teeth ({ring}), as sun, planet and ring have a common centre distance"
        remedy = "give the orders of a stage with shifted profiles or stepped planets"
        return {"ring_teeth": f"{reason}, got {teeth['ring_teeth']}; {remedy}"}
    less, more = ("flex_teeth", "circular_teeth") if kind == "harmonic" else ("cycloid_teeth", "pins")
    if teeth[less] < teeth[more]:
        return {}
    return {less: f"must be below {more} ({teeth[more]}), got {teeth[less]}"}

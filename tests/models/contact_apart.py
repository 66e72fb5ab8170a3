"""Least costs of the RV-40E-121 by contact, by formulas of the note on allocation alone: no code of the package.

Nearest points by Newton's method, units by scrambled Sobol numbers, contacts as one product of matrices, gradients by
the pins that touch, the least cost by SLSQP of scipy at grade 4. Errors are in um, nominal sizes in mm, angles in
arc minutes of the carrier with the sun held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize
from scipy.stats import norm, qmc

Array = NDArray[np.float64]
PIN_CIRCLE, ECCENTRICITY, TEETH, PINS, CRANK_CIRCLE = 64.0, 1.3, 39, 40, 36.0
ARCMIN = np.pi / 10800.0
PER_UM = 1e-3 / ARCMIN
"""Arc minutes of 1 um at an arm of 1 mm."""
ERRORS = ("pin_circle_radius", "pin_position", "pin_hole_radius", "pin_radius", "pitch", "runout", "eccentricity",
          "equidistance", "shift", "crank_bearing")  # fmt: skip
"""Of which the half-widths (of the bearing: the clearance) are searched."""
MIDS = {"pin_circle_radius": -1.0, "pin_hole_radius": 2.5, "pin_radius": -1.0, "pitch": -3.0, "equidistance": -1.0,
        "shift": 1.0}  # fmt: skip
COSTS = {"pin_circle_radius": (2.4, 1.0), "pin_position": (3.2, 1.0), "pin_hole_radius": (3.0, 1.0),
         "pin_radius": (0.6, 0.6), "pitch": (5.6, 1.0), "runout": (0.5, 1.0), "eccentricity": (1.2, 1.0),
         "equidistance": (0.6, 1.0), "shift": (0.6, 1.0), "crank_bearing": (0.8 * 2.0**0.6, 0.6)}  # fmt: skip
"""b and k of 0.1 + b/t^k; the grade costs 3.2."""
BETWEEN_DISCS = {"circle_offset": 3.0, "bore": 2.0, "journal": 2.0}
GRADE_4 = (0.484 * 2.0**-1.5, 0.291 * 2.0**-1.5)
"""Mid value and half-width of a planet's clearance, phi_1 = j_n/(i r_1)."""
GROWTH_PER_K = 11.5e-6 * PIN_CIRCLE * 1e3
"""By which a disc that is 1 K warmer than the housing fills the radial gap [um]."""
COVERAGE, INTERFERING, LIMIT = 0.9973, 0.05, 1.0


def nearest(phase: Array, dr_p: float) -> tuple[Array, NDArray[np.complex128], Array]:
    """Gap to the profile [mm], its normal in axes of the pin and its lever arm [mm], of pins at a phase.

    Steps of Newton's method are held as the note says: free ones leave the branch that bears.
    """
    eccentric = ECCENTRICITY * np.exp(1j * phase)
    pin, v = PIN_CIRCLE - eccentric, np.zeros_like(phase)
    for _ in range(60):
        a, b = (PIN_CIRCLE + dr_p) * np.exp(1j * v), eccentric * np.exp(1j * PINS * v)
        curve, first, second = a - b, 1j * (a - PINS * b), -(a - PINS**2 * b)
        off = pin - curve
        slope = np.real(off * first.conj())
        curvature = np.real(off * second.conj()) - np.abs(first) ** 2
        held = np.maximum(np.abs(curvature), 2e-3 * np.abs(first) ** 2) * np.where(curvature > 0.0, 1.0, -1.0)
        v = v - np.clip(slope / held, -1e-3, 1e-3)
    normal = -1j * first / np.abs(first)
    return np.real(off * normal.conj()), normal, np.imag(pin * normal.conj())


@lru_cache(maxsize=8)
def _units(count: int, seed: int) -> dict[str, Array]:
    """Standardised errors of `count` units, uniform in [-1, 1], units last."""
    shapes = {"pin_circle_radius": (), "circle_offset": (), "circle_direction": (), "equidistance": (2,), "shift": (2,),
              "eccentricity": (2, 2), "journal": (2, 2), "crank_bearing": (2, 2), "bore": (2, 2, 2), "pitch": (2,),
              "pitch_phase": (2,), "runout": (2,), "runout_phase": (2,), "pin_position": (PINS,),
              "pin_hole_radius": (PINS,), "pin_radius": (PINS,)}  # fmt: skip
    sizes = [int(np.prod(shape)) for shape in shapes.values()]
    drawn = 2.0 * qmc.Sobol(sum(sizes), seed=seed).random(count).T - 1.0
    parts = np.split(drawn, np.cumsum(sizes)[:-1])
    return {name: part.reshape(*shape, count) for (name, shape), part in zip(shapes.items(), parts, strict=True)}


def of_tighter_planet(at: Array) -> tuple[Array, Array]:
    """P(the least of two clearances <= at) and its density; uniform in [-1, 1], half of their variance in common."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(48)
    score = norm.ppf(np.clip(0.5 * (at + 1.0), 1e-15, 1.0 - 1e-15))[:, None]
    other = norm.sf(np.sqrt(2.0) * score - nodes)
    density = norm.pdf(np.sqrt(2.0) * score - nodes) * np.sqrt(2.0) * 0.5 / norm.pdf(score)
    weights = weights / weights.sum()
    inside = (at > -1.0) & (at < 1.0)
    below = np.where(inside, 1.0 - other**2 @ weights, np.where(at >= 1.0, 1.0, 0.0))
    return below, np.where(inside, (2.0 * other * density) @ weights, 0.0)


@dataclass(frozen=True)
class Turn:
    """y [arcmin] (positions, units) of one design, and its derivatives by `ERRORS`, dr_rp and dr_p [um]."""

    y: Array
    slopes: dict[str, Array]


@dataclass
class Reducer:
    """What is assumed; `design` is the half-widths of `ERRORS` [um], then dr_rp and dr_p [um]."""

    units: int = 1024
    seed: int = 1
    positions: int = 61
    between: Mapping[str, float] = field(default_factory=lambda: BETWEEN_DISCS)
    normal: bool = False
    """Whether parts are normal, t = 3 sigma, instead of uniform."""
    play_factor: float = 1.0
    mids: Mapping[str, float] = field(default_factory=lambda: MIDS)
    cosine: bool = False
    """Whether phi_1 has the cosine of the pressure angle."""

    def __post_init__(self) -> None:
        drawn = dict(_units(self.units, self.seed))
        if self.normal:
            free = {"circle_direction", "pitch_phase", "runout_phase"}
            drawn = {n: z if n in free else norm.ppf(0.5 * (z + 1.0)) / 3.0 for n, z in drawn.items()}
        self.z = drawn
        self.psi = 2.0 * np.pi * TEETH * (np.arange(self.positions) + 0.5) / self.positions
        self.disc = np.pi * np.arange(2)
        self.theta = 2.0 * np.pi * np.arange(PINS) / PINS
        self.phase = self.psi[:, None, None] + self.disc[:, None] - self.theta  # (positions, discs, pins)

    def turn(self, design: Array, wider: float = 0.0, worn: float = 0.0) -> Turn:
        """Contacts at all positions, the pin circle wider and the flanks worn by so many um."""
        t, z = dict(zip(ERRORS, design, strict=False)), self.z
        dr_rp, dr_p = design[len(ERRORS) :]
        (g, n, arm), (moved, _, _) = nearest(self.phase, 1e-3 * dr_p), nearest(self.phase, 1e-3 * (dr_p + 0.01))
        kappa = PER_UM / arm
        by_dr_p = (moved - g) / 1e-5  # um of gap per um

        def size(name: str) -> Array:
            return np.asarray(self.mids.get(name, 0.0) + t[name] * z[name])

        across, along = size("pin_hole_radius") - size("pin_radius"), t["pin_position"] * z["pin_position"]
        radial = size("pin_circle_radius") + wider - size("shift")  # (discs, units)
        bore = self.between["bore"] * (z["bore"][0] + 1j * z["bore"][1])  # (cranks, discs, units)
        ends = np.array([1.0, -1.0])[:, None, None]
        eccentric = t["eccentricity"] * z["eccentricity"] + 1j * self.between["journal"] * z["journal"]
        pitch_wave = np.exp(1j * np.pi * z["pitch_phase"]) * PER_UM / (2.0 * PIN_CIRCLE)
        runout_wave = 0.5 * np.exp(1j * np.pi * z["runout_phase"])
        offset = self.between["circle_offset"] * z["circle_offset"] * np.exp(1j * np.pi * z["circle_direction"])
        at_crank = PER_UM / CRANK_CIRCLE
        clearance = 0.5 * (1.0 + z["crank_bearing"]).mean(axis=0)  # per um of the zone
        play = 0.5 * at_crank * self.play_factor * t["crank_bearing"] * clearance
        tangent = at_crank * bore.imag.mean(axis=0)
        direction = n * np.exp(1j * self.theta)  # of the normal in axes of the housing
        count = z["pitch"].shape[-1]
        value, touched = np.empty((2, self.positions, count)), np.empty((2, 2, self.positions, count), dtype=int)
        ones = np.ones(count)
        for p, psi in enumerate(self.psi):
            sides = []
            for d in range(2):
                of_disc, of_eccentric = np.exp(1j * (self.disc[d] - psi / TEETH)), np.exp(1j * (psi + self.disc[d]))
                centre = eccentric[:, d].mean(axis=0) * of_eccentric - offset
                centre = centre + (size("runout")[d] * runout_wave[d] - (bore * ends)[:, d].mean(axis=0)) * of_disc
                tooth = size("pitch")[d] * pitch_wave[d] * of_disc
                crank = (eccentric * ends)[:, d].mean(axis=0) * np.exp(1j * (PINS * psi / TEETH + self.disc[d]))
                turned = tangent[d] - at_crank * crank.imag
                common = np.stack([ones, size("equidistance")[d] + dr_rp + worn, radial[d], centre.real,
                                   centre.imag, tooth.real, tooth.imag])  # fmt: skip
                by_flank = []
                for sign in (1.0, -1.0):
                    bears = np.flatnonzero(sign * arm[p, d] > 0.3 * np.abs(arm).max())
                    k, normal, way = kappa[p, d, bears], n[p, d, bears], direction[p, d, bears]
                    around = np.exp(1j * self.theta[bears])
                    columns = np.stack([k * 1e3 * g[p, d, bears], k, k * normal.real, -k * way.real, -k * way.imag,
                                        around.real, around.imag], axis=1)  # fmt: skip
                    h = columns @ common + k[:, None] * across[bears] + (k * normal.imag)[:, None] * along[bears]
                    pick = np.argmin(sign * h, axis=0)
                    end = np.take_along_axis(h, pick[None], axis=0)[0]
                    by_flank.append((end + sign * play[d] - turned, bears[pick]))
                sides.append(by_flank)
            for f, sign in enumerate((1.0, -1.0)):
                first, second = sides[0][f], sides[1][f]
                best = sign * second[0] < sign * first[0]
                value[f, p] = np.where(best, second[0], first[0])
                touched[f, 0, p], touched[f, 1, p] = best, np.where(best, second[1], first[1])
        ratio = (3 * TEETH) / (3 * TEETH + 4)
        return Turn(ratio * (value[0] - value[1]), self._slopes(locals()))

    def _slopes(self, at: Mapping[str, Any]) -> dict[str, Array]:
        """Derivatives of y by the pins that touch."""
        z, total = self.z, {name: np.zeros(at["value"].shape[1:]) for name in (*ERRORS, "dr_rp", "dr_p")}
        unit, p = np.arange(at["count"])[None, :], np.arange(self.positions)[:, None]
        psi = self.psi[:, None]
        for f, sign in enumerate((1.0, -1.0)):
            d, j = at["touched"][f]
            k, n, way = (at[name][p, d, j] for name in ("kappa", "n", "direction"))
            disc = np.exp(1j * (self.disc[d] - psi / TEETH))
            ahead = np.exp(1j * (psi + self.disc[d]))
            wave = at["runout_wave"][d, unit] * z["runout"][d, unit] * disc
            tooth = at["pitch_wave"][d, unit] * z["pitch"][d, unit] * disc * np.exp(-1j * self.theta[j])
            centre = z["eccentricity"].mean(axis=0)[d, unit] * ahead
            crank = (z["eccentricity"] * at["ends"]).mean(axis=0)[d, unit]
            crank = crank * np.exp(1j * (PINS * psi / TEETH + self.disc[d]))
            parts = {
                "pin_circle_radius": k * n.real * z["pin_circle_radius"][unit],
                "pin_position": k * n.imag * z["pin_position"][j, unit],
                "pin_hole_radius": k * z["pin_hole_radius"][j, unit],
                "pin_radius": -k * z["pin_radius"][j, unit],
                "pitch": tooth.real,
                "runout": -k * np.real(wave * way.conj()),
                "eccentricity": -k * np.real(centre * way.conj()) + at["at_crank"] * crank.imag,
                "equidistance": k * z["equidistance"][d, unit],
                "shift": -k * n.real * z["shift"][d, unit],
                "crank_bearing": sign * 0.5 * at["at_crank"] * self.play_factor * at["clearance"][d, unit],
                "dr_rp": k,
                "dr_p": k * at["by_dr_p"][p, d, j],
            }
            for name, part in parts.items():
                total[name] += sign * at["ratio"] * part
        return total

    def quantile(self, turn: Turn) -> tuple[float, Array]:
        """The backlash that `COVERAGE` of the units keep, phi_1 integrated, and its derivatives."""
        middle, half = (v / (np.cos(np.radians(20.0)) if self.cosine else 1.0) for v in GRADE_4)
        worst = turn.y.argmax(axis=0)
        unit = np.arange(turn.y.shape[1])
        most = turn.y[worst, unit]
        most, open_ = np.maximum(most, 0.0), most > 0.0

        def within(limit: float) -> float:
            return float(of_tighter_planet((limit - most - middle) / half)[0].mean()) - COVERAGE

        at = float(brentq(within, 0.0, 20.0, xtol=1e-9))
        weight = of_tighter_planet((at - most - middle) / half)[1]
        weight = weight / weight.sum() * open_
        return at, np.array([weight @ slope[worst, unit] for slope in turn.slopes.values()])

    def interfering(self, turn: Turn, circle: float) -> tuple[float, Array]:
        """P(turn mean < 0), integrated over the radius of the pin circle, and its derivatives."""
        steep = 2.0 * np.sqrt(1.0 - (ECCENTRICITY * PINS / PIN_CIRCLE) ** 2) * 117.0 / 121.0
        steep *= PER_UM / (ECCENTRICITY * TEETH) * circle
        meets = self.z["pin_circle_radius"] - turn.y.mean(axis=0) / steep
        if self.normal:
            below, density = norm.cdf(3.0 * meets), 3.0 * norm.pdf(3.0 * meets)
        else:
            below, density = np.clip(0.5 * (meets + 1.0), 0.0, 1.0), 0.5 * (np.abs(meets) < 1.0)
        by = np.array([slope.mean(axis=0) @ -(density / steep) for slope in turn.slopes.values()])
        by[0] += density @ turn.y.mean(axis=0) / (steep * circle)
        return float(below.mean()), by / len(below)

    def least_cost(self, warmer: float = 0.0, worn: float = 0.0, start: Array | None = None) -> tuple[float, Array]:
        """The least cost, and its design, of backlash within `LIMIT` when worn, and interference when the discs are
        warmer than the housing by so many kelvin, in new units. The radial gap is 0.03 mm at least.
        """
        count, b, k = len(ERRORS), *np.array(list(COSTS.values())).T
        wider = -GROWTH_PER_K * warmer
        known: dict[bytes, tuple[Array, Array]] = {}

        def design(x: Array) -> Array:
            return np.concatenate([np.exp(x[:count]), 10.0 * x[count:]])

        def cost(x: Array) -> tuple[float, Array]:
            by = b * np.exp(-k * x[:count])
            return float(3.2 + 0.1 * count + by.sum()), np.concatenate([-k * by, [0.0, 0.0]])

        def limits(x: Array) -> tuple[Array, Array]:
            key = x.tobytes()
            if key not in known:
                at = design(x)
                scale = np.concatenate([at[:count], [10.0, 10.0]])
                cold = self.turn(at, worn=worn)
                hot = self.turn(at, wider) if wider or worn else cold
                values = (self.quantile(cold), self.interfering(hot, float(at[0])))
                known.clear()
                room = np.array([LIMIT - values[0][0], 10.0 * (INTERFERING - values[1][0])])
                known[key] = room, -np.stack([values[0][1] * scale, 10.0 * values[1][1] * scale])
            return known[key]

        gap = np.concatenate([np.zeros(count), [1.0, -1.0]])
        rules = [
            {"type": "ineq", "fun": lambda x: limits(x)[0], "jac": lambda x: limits(x)[1]},
            {"type": "ineq", "fun": lambda x: gap @ x - 3.0, "jac": lambda x: gap},
        ]
        x = np.concatenate([np.log(start[:count]), start[count:] / 10.0]) if start is not None else START
        best = np.inf, x
        for _ in range(3):
            bounds = [(v - 0.7, v + 0.7) for v in x[:count]] + [(v - 1.0, v + 1.0) for v in x[count:]]
            solve: Any = minimize
            given: Any = {"bounds": bounds, "constraints": rules, "options": {"maxiter": 40, "ftol": 1e-6}}
            found = solve(lambda at: cost(at)[0], x, jac=lambda at: cost(at)[1], method="SLSQP", **given)
            x = found.x
            if limits(x)[0].min() > -1e-5:
                if found.fun > best[0] * (1.0 - 1e-4):
                    break
                best = float(found.fun), design(x)
        return best


START = np.concatenate([np.log([1.28, 2.42, 2.05, 0.89, 4.9, 2.4, 2.6, 0.66, 0.96, 2.1]), [-3.67, -6.67]])

"""Whether the next measurement tells what it promises: `python -m benchmarks.next_measurement`.

Ambiguous records of a bench with a poor design, made by formulas of their own. The readings that
are proposed, as many like those of the record, and as many at random points of the range are then
taken from the truth, and the whole is analysed again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tolevo.commands.gap.analysis import analysed
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.next_measurement import next_measurement
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.result import Ending, finish_analysis
from tolevo.commands.gap.scan import scan
from tolevo.commands.gap.setup import prepare_setup

Array = NDArray[np.float64]
Law = Callable[[Mapping[str, Array], float], Array]
CONFIGURATION = """
model = "table"
[settings]
simulations = 300
[gear]
kind = "rv"
pins = 40
cycloid_teeth = 39
sun_teeth = 12
planet_teeth = 36
[columns]
angle = { role = "angle", unit = "deg" }
torque = { role = "torque", unit = "N m" }
speed = { role = "speed", unit = "rpm" }
temp = { role = "temperature", unit = "degC" }
dir = { role = "direction" }
clock = { role = "time", unit = "s" }
te = { role = "measured", unit = "arcsec" }
te_predicted = { role = "predicted", unit = "arcsec" }
[next_measurement]
readings = 20
[next_measurement.range]
angle = [0, 360]
torque = [-400, 400]
speed = [5, 40]
temp = [15, 50]
dir = [-1, 1]
"""
LAWS: dict[str, Law] = {
    "torsional_compliance": lambda d, u: d["torque"] / 400.0,
    "hertz_stiffening": lambda d, u: np.sign(d["torque"]) * np.abs(d["torque"] / 400.0) ** (2 / 3),
    "lost_motion": lambda d, u: np.tanh(d["torque"] / 1.2),
    "bearing_clearance": lambda d, u: np.clip(d["torque"] / (40.0 + 100.0 * u), -1.0, 1.0),
    "friction_hysteresis": lambda d, u: d["dir"],
    "viscous_friction": lambda d, u: d["speed"] * d["dir"] / 40.0,
    "windage": lambda d, u: d["speed"] ** 2 * d["dir"] / 1600.0,
    "output_eccentricity": lambda d, u: np.sin(np.radians(d["angle"]) + 6.28 * u),
    "drift": lambda d, u: d["clock"] / 300.0,
    "creep": lambda d, u: np.log1p(d["clock"] / (10.0 + 50.0 * u)) / 3.0,
    "differential_thermal_expansion": lambda d, u: (d["temp"] - 20.0) * d["dir"] / 30.0,
    "thermal_friction": lambda d, u: d["dir"] * np.expm1(-(0.01 + 0.04 * u) * (d["temp"] - 20.0)),
    "wear": lambda d, u: d["clock"] * d["dir"] / 300.0,
}
NEW = ("planned", "alike", "random")
APART = 8.0
"""Distance from which a name is alone (`set_distance`)."""


def spread_out(rng: np.random.Generator, n: int, most: float) -> pd.DataFrame:
    """Points of the whole range, or up to `most` [N m]."""
    return pd.DataFrame({
        "angle": rng.uniform(0, 360, n), "torque": rng.uniform(-most, most, n),
        "speed": rng.uniform(5, 40, n), "temp": rng.uniform(15, 50, n),
        "dir": rng.choice([-1.0, 1.0], n),
    })  # fmt: skip


def poor(rng: np.random.Generator, n: int) -> pd.DataFrame:
    """A design in which one input follows another."""
    way, most = rng.integers(4), 400.0 * rng.choice([0.1, 0.3, 1.0])
    d = spread_out(rng, n, most).assign(clock=2.0 * np.arange(n))
    if way == 0:
        weight = np.sin(np.radians(d["angle"]) + rng.uniform(0, 6)) + 0.15 * rng.normal(size=n)
        d["torque"] = most * weight.clip(-1, 1)
    elif way == 1:
        d["temp"] = 20 + 25 * (1 - np.exp(-2 * np.arange(n) / n)) + rng.normal(0, 1, n)
    elif way == 2:
        d["speed"] = np.maximum(20 * (1 + 0.5 * d["dir"] + 0.15 * rng.normal(size=n)), 5)
    else:
        d["torque"], d["speed"] = d["torque"].abs() * d["dir"], rng.uniform(18, 22, n)
    return d


def columns(d: pd.DataFrame) -> dict[str, Array]:
    return {str(name): d[name].to_numpy(dtype=float) for name in d}


def read_off(d: pd.DataFrame, added: Array, rng: np.random.Generator) -> pd.DataFrame:
    """Measurements with a noise of 1 beside the simulation."""
    predicted = 0.2 * d["torque"]
    return d.assign(te_predicted=predicted, te=predicted + added + 2 + rng.normal(size=len(d)))


def analysis(table: pd.DataFrame) -> Ending:
    with TemporaryDirectory() as folder:
        configuration, data = Path(folder, "gap.toml"), Path(folder, "bench.csv")
        configuration.write_text(CONFIGURATION, encoding="utf-8")
        table.to_csv(data, index=False)
        plan = read_gap(configuration)
        return finish_analysis(analysed(prepare_setup(plan, read_data(plan, data))))


def score(end: Ending, name: str) -> float:
    """Of the best fit with this name alone."""
    search = end.analysis.search
    found = scan(search.fitter, search.white, search.dictionary, ())
    (member,) = (one.member for one in found if one.member.name == name)
    return search.fitter.refined([member]).score


def trial(number: int) -> list[dict[str, float]]:
    """Each pair that the truth is one of: the chances promised, and by how much the right one is
    ahead after each kind of readings; empty where the record is not ambiguous.
    """
    rng = np.random.default_rng([77, number])
    n = int(rng.integers(60, 300))
    d = poor(rng, n)
    name, u = str(rng.choice(list(LAWS))), rng.uniform()
    form = LAWS[name](columns(d), u)
    size = np.sqrt(rng.uniform(30, 120) / n) / max(float(np.std(form)), 1e-9)
    if size * np.abs(form).max() > 1e3:
        return []
    record = read_off(d, size * form, rng)
    end = analysis(record)
    if end.verdict != "ambiguous" or len(end.fit.names) != 1:
        return []
    planned = next_measurement(end)
    assert planned is not None
    pairs = [one for one in planned.record.pairs
             if len(one.names) == 1 and (name,) in (one.names, end.fit.names)
             and not one.text.startswith("no design")]  # fmt: skip
    if planned.points is None or not pairs:
        return []
    count = len(planned.points)
    later = d["clock"].max() + 2.0 * (1 + np.arange(count))
    rows = np.sort(rng.integers(0, n, count))
    others = (d.iloc[rows].reset_index(drop=True), spread_out(rng, count, 400.0))
    new = [planned.points, *(one.assign(clock=later) for one in others)]
    whole = [analysis(pd.concat([record, read_off(at, size * LAWS[name](columns(at), u), rng)],
                                ignore_index=True)) for at in new]  # fmt: skip
    found = []
    for pair in pairs:
        rival = pair.names[0] if end.fit.names == (name,) else end.fit.names[0]
        ahead = {kind: score(one, rival) - score(one, name)
                 for kind, one in zip(NEW, whole, strict=True)}  # fmt: skip
        alone = {f"{kind}_alone": float(one.verdict == "named" and one.fit.names == (name,))
                 for kind, one in zip(NEW, whole, strict=True)}  # fmt: skip
        found.append({"record": number, "chance": pair.chance, "chance_alike": pair.alike,
                      "gain": pair.expected - pair.now, **ahead, **alone})  # fmt: skip
    return found


def told(table: pd.DataFrame) -> str:
    """The rates in lines."""
    by_record = table.groupby("record").first()
    lines = [f"{len(by_record)} ambiguous records, {len(table)} pairs"]
    for name, kind in (("chance", "planned"), ("chance_alike", "alike")):
        p = table[name]
        error = np.sqrt((p * (1 - p)).sum()) / len(p)
        lines.append(f"{kind}: right one ahead: promised {p.mean():.3f} +- {error:.3f}, "
                     f"seen {(table[kind] > 0).mean():.3f}")  # fmt: skip
    gains = table[table["gain"] > 5.0]
    for kind in NEW:
        alone = int(by_record[f"{kind}_alone"].sum())
        both = [float((one[kind] > APART).mean()) for one in (table, gains)]
        lines.append(f"{kind}: named alone {alone} records; ahead by {APART:g}: {both[0]:.2f} of "
                     f"all pairs, {both[1]:.2f} of {len(gains)} that points tell")  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=150)
    parser.add_argument("--first", type=int, default=450)
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.records)
    rows = [row for number in numbers for row in trial(number)]
    sys.stdout.write(told(pd.DataFrame(rows)))


if __name__ == "__main__":
    main()

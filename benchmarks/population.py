# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Units of an RV reducer at first contact, on one thread: `python benchmarks/population.py`.

Value and derivatives of 512 units at 61 positions of the turn, against the exact nearest point of
every pin for the same units: what they cost, and how far they lie apart. Times are CPU
times of this process, medians of interleaved turns.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from statistics import median

import numpy as np

from tests.models.loaded_units import modified_geometry, part_errors
from tolevo.models.rv_reducer.contact.contact import LoadedContact, backlash, loading, lost_motion
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry
from tolevo.models.rv_reducer.population.contact import Population
from tolevo.models.rv_reducer.population.elastic import OUTPUTS, Elastic, Loading, elastic
from tolevo.models.rv_reducer.population.errors import Scaled
from tolevo.models.rv_reducer.population.measures import Conditions, Measures
from tolevo.models.rv_reducer.population.units import Involute, UnitDesign
from tolevo.models.rv_reducer.tighter_planet import TighterPlanet
from tolevo.units import ARCMIN

GEOMETRY = ContactGeometry(true_levers=True)
ZONES = {
    "pin_circle_radius": 3.0, "pin_position": 2.0, "pin_hole_radius": 1.5, "pin_radius": 1.0,
    "pitch": 4.0, "runout": 1.0, "eccentricity": 1.0, "equidistance": 1.0, "shift": 1.0,
    "crank_bearing": 2.0, "circle_offset": 3.0, "bore": 2.0, "crank_phase": 2.0 / 1.3,
}  # fmt: skip
MIDS = {
    "pin_circle_radius": -1.0, "pin_hole_radius": 2.5, "pin_radius": -1.0, "pitch": -3.0,
    "equidistance": -1.0, "shift": 1.0,
}  # fmt: skip
WIDEST = {
    "pin_circle_radius": 10.0, "pin_position": 10.0, "pin_hole_radius": 8.0, "pin_radius": 5.0,
    "pitch": 15.0, "runout": 8.0, "eccentricity": 8.0, "equidistance": 6.0, "shift": 6.0,
    "crank_bearing": 20.0,
}  # fmt: skip
"""Upper ends of the ranges searched by default."""
DOCUMENT = UnitDesign(ZONES, MIDS)
TURNS = 9


def scaled(factor: float) -> UnitDesign:
    return replace(DOCUMENT, half_width={name: factor * t for name, t in ZONES.items()})


def drawn(units: int, positions: int) -> Population:
    return Population.draw(GEOMETRY, positions, units, np.random.default_rng(0))


def evaluate(population: Population, slopes: bool) -> float:
    """What a search asks: the quantile of the greatest backlash, interference, derivatives."""
    involute = Involute(0.484, 0.291, TighterPlanet())
    turn = population.turn(DOCUMENT)
    measures = Measures(turn, involute, Conditions())
    asked = [measures["quantile max"], measures["interference"]]
    if slopes:
        for one in asked:
            one.slopes(turn)
    return asked[0].statistic.value


def nearest_point(population: Population, design: UnitDesign, exact: bool) -> np.ndarray:
    """y (units, positions) [arcmin] by the loaded contact."""
    contact = LoadedContact(modified_geometry(GEOMETRY, design), exact=exact)
    errors = part_errors(GEOMETRY, population.sample, design)
    return backlash(contact, errors, population.lattice.angles) / ARCMIN


def memory() -> float:
    """Peak memory of the process [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def cpu_ms(function: Callable[[], object]) -> float:
    start = time.process_time()
    function()
    return 1e3 * (time.process_time() - start)


def interleaved(runs: Mapping[str, Callable[[], object]]) -> dict[str, float]:
    """Median CPU [ms] of each, one after the other so that all meet the same machine."""
    times = [{name: cpu_ms(run) for name, run in runs.items()} for _ in range(TURNS)]
    return {name: median(one[name] for one in times) for name in runs}


def speed() -> None:
    population = drawn(512, 61)
    turn = population.turn(DOCUMENT)  # compiles, or loads what was compiled
    turn.slopes(np.full(turn.play.shape, 1.0 / turn.play.size))
    peaks = [memory()]
    evaluate(population, slopes=True)
    peaks.append(memory())
    few = drawn(32, 61)
    found = interleaved({
        "value": partial(evaluate, population, slopes=False),
        "value and slopes": partial(evaluate, population, slopes=True),
        "third order": partial(nearest_point, few, DOCUMENT, exact=False),
        "nearest point": partial(nearest_point, few, DOCUMENT, exact=True),
    })  # fmt: skip
    print("512 units x 61 positions, quantile of the greatest backlash and interference:")
    print(f"  {found['value']:.1f} ms, with derivatives {found['value and slopes']:.1f} ms (40 promised)")
    for name in ("third order", "nearest point"):
        time_ms = found[name] * 512 / 32
        ratio = time_ms / found["value"]
        print(f"  loaded contact, {name}: {time_ms:.0f} ms (from 32 units), {ratio:.0f} times")
    print(f"  peak memory of the process: kernel {peaks[0]:.0f} MiB (300 promised), with the")
    print(f"  distribution of the tighter planet tabulated {peaks[1]:.0f} MiB")
    for units, positions in ((256, 61), (1024, 61), (4096, 61), (4096, 1021)):
        turns = 1 if positions > 61 else 3
        sized = drawn(units, positions)
        times = [cpu_ms(partial(evaluate, sized, slopes=True)) for _ in range(turns)]
        print(f"  {units} x {positions}, with derivatives: {median(times):.0f} ms")


def accuracy() -> None:
    """The kernel is linear in the errors: what that leaves out, by the exact nearest point.

    Beyond 0.3' of overlap pins near the bottom and the top of a tooth space, which the kernel
    leaves out, meet in the exact solver: y there is a number of minutes that nothing turns by.
    """
    population = drawn(64, 61)
    designs = {
        "half document B's zones and 3, 2, 2 um": scaled(0.5),
        "document B's zones and 3, 2, 2 um (0.002 promised)": DOCUMENT,
        "twice these": scaled(2.0),
        "four times these": scaled(4.0),
        "upper ends of the ranges searched": replace(DOCUMENT, half_width=WIDEST),
    }
    print("linear kernel against the exact nearest point, 64 units x 61 positions [arcmin]:")
    for name, design in designs.items():
        exact = nearest_point(population, design, exact=True)
        play = population.turn(design).play.T
        away = (play - exact)[exact > -0.3]
        greatest = (np.maximum(0.0, one.max(axis=1)) for one in (play, exact))
        most = np.max(np.abs(np.subtract(*greatest)))
        print(
            f"  {name}: y > -0.3 (of {away.size / exact.size:.0%}) within "
            f"{np.max(np.abs(away)):.4f}, mean {np.mean(away):+.4f}; greatest backlash "
            f"within {most:.4f}"
        )


def balanced(population: Population) -> Elastic:
    """All outputs under load."""
    turn = population.turn(DOCUMENT)
    units = Scaled.of(population.lattice.geometry, population.sample, DOCUMENT)
    return elastic(population.lattice, turn.table, units, Loading())


def pulled_back(population: Population) -> None:
    """All outputs under load, and the derivatives of their means together."""
    weight = np.full(population.units, 1.0 / population.units)
    balanced(population).pull_back(population.slopes, dict.fromkeys(OUTPUTS, weight))


def under_load() -> None:
    """Lost motion, preload, pin force and transmission error of 256 units at 31 positions."""
    population, few = drawn(256, 31), drawn(32, 31)
    contact = LoadedContact(modified_geometry(GEOMETRY, DOCUMENT))
    errors, angles = part_errors(GEOMETRY, few.sample, DOCUMENT), few.lattice.angles
    pulled_back(population)  # compiles, or loads what was compiled
    lost = lost_motion(contact, errors, angles) / ARCMIN
    found = interleaved({
        "value": partial(balanced, population),
        "slopes": partial(pulled_back, population),
        "contact": partial(lost_motion, contact, errors, angles),
    })  # fmt: skip
    print("256 units x 31 positions under load, four load cases:")
    print(f"  {found['value']:.1f} ms, with derivatives {found['slopes']:.1f} ms")
    print(f"  loaded contact, lost motion alone {found['contact'] * 8:.0f} ms (from 32 units)")
    ours = balanced(few).values
    peak = loading(contact, errors, angles, Loading().rated_torque).peak
    away = np.max(np.abs(ours["lost_motion"] - lost))
    print(f"  lost motion within {away:.4f} arcmin of the loaded contact, pin force within "
          f"{np.max(np.abs(ours['peak_pin_force'] / peak - 1.0)):.2%}")  # fmt: skip


def main() -> None:
    speed()
    accuracy()
    under_load()


if __name__ == "__main__":
    main()

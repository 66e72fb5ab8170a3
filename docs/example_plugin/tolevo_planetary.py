"""A planetary stage: its twist, its tolerances, an effect, a cost curve and an algorithm."""

from dataclasses import dataclass, field

import numpy as np
from tolevo import plugins as own

LEAD, ARCMIN = 2.0 * np.tan(np.radians(20.0)), np.pi / 10800.0
"""Clearance at the flanks per shift of the profile, at a pressure angle of 20 degrees."""


@dataclass(frozen=True)
class Logarithmic(own.CostCurve):
    """C(t) = a - b ln(t)."""

    a: float
    b: float

    def cost(self, t):
        return self.a - self.b * np.log(t)

    def slope(self, t):
        return -self.b / t


class PlanetaryStage(own.MeasurableModel):
    """Twist of a planetary stage under load."""

    columns = (own.Column("torque_Nm", "Nm", "torque at the carrier", role=own.Role.TORQUE),)
    outputs = (own.Output("twist_arcmin", "arcmin", "twist of the carrier, sun held"),)
    parameters = (
        own.Parameter("stiffness", 12.0, "Nm/arcmin", "of the stage", assumed=True, low=0.1),
        own.Parameter("backlash", 2.0, "arcmin", "of the stage", assumed=True, low=0.0),
    )
    free = {"stiffness": 3.0}

    def __init__(self, parameters=None, designs=None, inputs=None):
        self.given = {one.name: one.default for one in self.parameters} | dict(parameters or {})

    def predict(self, table, rng, changes=None):
        torque = np.asarray(table["torque_Nm"], dtype=float)
        play = 0.5 * self.given["backlash"] * np.sign(torque)
        return {"twist_arcmin": play + torque / self.given["stiffness"]}


GEARS = ("sun", "planet", "ring")


class PlanetaryTolerances(own.ToleranceProblem):
    """Cost against backlash of a planetary stage, from the profile shifts of its gears."""

    declaration = own.Declaration(
        variables=tuple(
            own.Variable(f"{gear}_um", "um", own.Kind.HALF_WIDTH, 2.0, 60.0, f"shift of the {gear}") for gear in GEARS
        ),
        outputs=(
            own.Output("cost", "", "sum of the cost curves"),
            own.Output("backlash_arcmin", "arcmin", "half-width of the backlash, root sum square"),
        ),
        parameters=(own.Parameter("radius", 27.0, "mm", "of the sun's pitch circle", low=1.0),),
        costs={f"{gear}_um": Logarithmic(6.0, 1.0) for gear in GEARS},
        objectives=("cost", "backlash_arcmin"),
        model="planetary_stage",
    )

    def _outputs(self, designs, searching):
        shift = 1e-3 * np.sqrt(np.sum((designs * [1.0, 2.0, 1.0]) ** 2, axis=1))
        backlash = LEAD * shift / self.settings.parameters["radius"] / ARCMIN
        return {"cost": self.cost_of(designs), "backlash_arcmin": backlash}


class PinBending(own.OneColumn):
    """The pins of the planets bend, and the flanks share the load worse."""

    name, family, dimensions, needs = "pin_bending", "load", ("angle",), (own.Role.TORQUE,)
    cause = "Pins bend under the load of their planets."
    formula, reference = "c T |T|", "Timoshenko, Strength of Materials, 1930"
    weight = own.Weight("bending", "c, twist per torque squared", per="Nm^2", low=-np.inf)

    def column(self, measurements, values, target):
        return measurements[own.Role.TORQUE] * np.abs(measurements[own.Role.TORQUE])


@dataclass(frozen=True)
class LatinHypercube(own.AlgorithmSettings):
    """Latin hypercube samples, `population` a generation: a baseline that fills the space."""

    many_objectives = True
    population: int = field(default=100, metadata={"low": 2})

    def build(self, problem):
        from pymoo.algorithms.soo.nonconvex.random_search import RandomSearch
        from pymoo.operators.sampling.lhs import LHS

        return RandomSearch(n_points_per_iteration=self.population, sampling=LHS())

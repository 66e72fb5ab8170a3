"""Transmission error, mesh force, cost and adjustment effort, by twelve angular tolerances."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from ...errors import Fault, InputError
from ...models.assembly import model
from ...models.assembly.assemble import Departures, normals, quantile_over, radius_quantile, response, sample_quantile
from ...models.assembly.process import Process, space_process
from ...models.assembly.transmission import Influence, Transmission, Turned, influence
from ...models.effects.effect import Target
from ...models.effects.measurements import Active, measurements_of, target_from
from ...models.inputs import Distribution, Normal
from ...models.measurable import Column, Role
from ...models.rv_reducer.transmission import RvTransmission
from ...section import Array, Kind, Variable, number
from ...units import ARCSEC, MRAD
from ..declaration import Declaration, Interval
from ..forms import Form
from ..settings import Bound, VariableSetting
from ..tolerance_problem import ToleranceProblem
from . import declared
from .form import COMPOSITE_STD, STD, TE, form_of, variances

# Changes that effects make in the transmission error of adjusted units.
#
# Effects of the assembly act in it, but for the dead band of `adjustment_backlash`, which is not
# linear. Others are evaluated over one turn of the output at the problem's torque and speed, as they
# act on the model `rv_transmission`: what varies over the turn is present in every unit.
#
# - Order 40 meets that of the angles, c . x, and adds as a vector: |c . x + m|.
# - Other orders together add half of their peak to peak. That is an upper bound. It is close
#   for a single wave: a crest of order 39 falls so close to one of order 40 that at most 0.3 % of the
#   wave is missed, 1.2 % for order 78. Multiples of 40 are locked to it and may even
#   make it smaller, by as much as they have; and where several orders are added, their crests need
#   not meet in one place.
#
# Contributions that are constant over the turn change nothing, nor does the instrument.


ORDER = 40
"""Waves per turn of the output that the angles of cranks cause."""
SAMPLES = 2**14
"""Angles of the turn: over 100 per wave of the highest order (121) and per pitch of a pin."""
NEGLIGIBLE_AMPLITUDE_ARCSEC = 1e-9
"""[arcsec] A wave below this is numerical noise."""
TE_COUNTERPART = RvTransmission.outputs[0].name
ACTING = {
    "adjustment_gain_error": "adjustments achieve {:.4g} of what is commanded",
    "chain_coupling": "chain 1 moves by {:.4g} times the movement of chain 2 at its installation",
    "springback": "{:.4g} of the total adjustment returns at the end",
}
"""Linear departures of the assembly, and their descriptions."""


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """Waves that are added to every unit's transmission error over the turn of the output.

    Its order 40 is Re[`wave` exp(40 j theta)], `half_range_of_others` half the peak to
    peak of all else [rad].
    """

    wave: complex
    half_range_of_others: float


def departures_with(departures: Departures, effects: Iterable[Active]) -> Departures:
    """The departures of the assembly with those of the effects."""
    values = [effect.values for effect in effects]
    gain, coupling, springback = (sum(by_name.get(name, 0.0) for by_name in values) for name in ACTING)
    return Departures(
        gain_error=departures.gain_error + gain,
        coupling=departures.coupling + coupling,
        springback=departures.springback + springback,
    )


def waves_of(effects: Iterable[Active], torque: float, speed: float) -> Waves:
    """What effects add, at a torque [N m] that resists the motion and an output speed [rpm]."""
    over = sum((_wave_over_turn(effect, torque, speed) for effect in effects), np.zeros(SAMPLES))
    lines = np.fft.rfft(over)
    wave = complex(2.0 * lines[ORDER] / SAMPLES)
    lines[ORDER] = 0.0
    rest = float(0.5 * np.ptp(np.fft.irfft(lines, SAMPLES)))
    return Waves(
        wave * ARCSEC if abs(wave) > NEGLIGIBLE_AMPLITUDE_ARCSEC else 0j,
        rest * ARCSEC if rest > NEGLIGIBLE_AMPLITUDE_ARCSEC else 0.0,
    )


def _wave_over_turn(active: Active, torque: float, speed: float) -> Array:
    """What one effect adds over a turn (SAMPLES,) [arcsec]; zero where it adds no wave."""
    table = {
        "output_angle_deg": 360.0 * np.arange(SAMPLES) / SAMPLES,
        "torque_Nm": np.full(SAMPLES, torque),
        "output_speed_rpm": np.full(SAMPLES, speed),
        "direction": np.ones(SAMPLES),
    }
    columns = tuple(column for column in RvTransmission.columns if column.name in table)
    target = target_from("rv_transmission", RvTransmission.outputs, columns)
    target = replace(target, gear=RvTransmission.gear)
    if not _adds_waves(active, target, columns):
        return np.zeros(SAMPLES)
    action = active.effect.act(measurements_of(columns, table), active.values, target)
    return np.asarray(action.output.get(TE_COUNTERPART, np.zeros(SAMPLES)))


def _adds_waves(active: Active, target: Target, columns: tuple[Column, ...]) -> bool:
    """Whether the effect adds to the output of a unit here, and its parameters are those of it."""
    effect, angled = active.effect, Role.ANGLE in active.effect.needs
    if effect.family == "instrument" or not angled or not effect.applies(target):
        return False
    names = {parameter.name for parameter in effect.parameters(target)}
    return set(active.values) <= names


def sentence(active: Active, torque: float, speed: float) -> str:
    """What one effect does here, empty where it does nothing."""
    departures = [(name, active.values.get(name, 0.0)) for name in ACTING]
    sentences = [
        ACTING[name].format(1.0 + size if name == "adjustment_gain_error" else size)
        for name, size in departures
        if size != 0.0
    ]
    waves = waves_of([active], torque, speed)
    size, rest = abs(waves.wave) / ARCSEC, waves.half_range_of_others / ARCSEC
    if size > 0.0:
        sentences.append(f"every unit has {size:.4g} arcsec of order 40, which adds to that of the angles as a vector")
    if rest > 0.0:
        sentences.append(
            f"every unit has {rest:.4g} arcsec (half peak to peak) of other orders, which adds in full: an upper bound"
        )
    if not sentences:
        return ""
    at = f", at {torque:g} Nm and {speed:g} rpm" if max(size, rest) > 0.0 else ""
    return "; ".join(sentences) + at


# The influence coefficients against the full model, at the units that set the quantile.


SAMPLE = 2048
"""Units among which those nearest to the quantile are sought."""
UNITS = 4
"""Units at which the full model is asked, per design and output."""
ANGLES = 80
"""Crank angles of the period there: more than two for each of its 39 pin pitches."""
TOGETHER = 64
"""Designs whose units are drawn at once."""


def errors_percent(
    full: Transmission,
    coefficients: Influence,
    spread: Array,
    te: Array,
    force: Array,
    sources: Callable[[int, int], Array],
) -> tuple[Array, Array]:
    """By how much (n,) the quantiles `te` [rad] and `force` [N] of designs are overstated, in %.

    `spread` (n, 12, s) takes standardised sources, a sample of which `sources` draws by its size, to
    final angles [rad]. The full model less the
    coefficients is averaged over the `UNITS` units whose own value lies nearest to the quantile: to
    first order this is what the quantile of the full model differs by.
    """
    exact, sample = replace(full, angles=ANGLES), sources(SAMPLE, spread.shape[-1])
    return (
        _error(exact, exact.amplitude, coefficients.amplitude, spread, te, sample),
        _error(exact, exact.peak, coefficients.peak_force, spread, force, sample),
    )


def _error(
    full: Transmission,
    value: Callable[[Turned], Array],
    estimate: Callable[[Array], Array],
    spread: Array,
    quantile: Array,
    sample: Array,
) -> Array:
    parts = [slice(at, at + TOGETHER) for at in range(0, len(spread), TOGETHER)]
    units = np.concatenate(
        [_nearest_states(estimate, sample @ np.swapaxes(spread[p], 1, 2), quantile[p]) for p in parts]
    )
    exact = value(full.turn(units.reshape(-1, 4, 3))).reshape(len(spread), UNITS)
    more = np.mean(exact - estimate(units), axis=1)
    return np.asarray(-100.0 * more / (quantile + more))


def _nearest_states(estimate: Callable[[Array], Array], states: Array, quantile: Array) -> Array:
    """The `UNITS` of the states (n, units, 12) whose estimate lies nearest to the quantile."""
    distance = np.abs(estimate(states) - quantile[:, None])
    chosen = np.argpartition(distance, UNITS, axis=1)[:, :UNITS]
    return np.take_along_axis(states, chosen[..., None], axis=1)


SEARCH_SAMPLE = 2048
"""Units of the search; its force quantile is within about 1 % of the reported one."""
FORCE, EFFORT = "peak_mesh_force_N", "adjustment_effort"


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """Final angles of designs over units."""

    spread: Array
    """Final angles per standardised source, (n, 12, s) [rad]: errors of parts, then noise."""
    effort: Array
    """Mean adjustment effort (n,) [rad^2]."""

    @property
    def covariance(self) -> Array:
        """Covariance (n, 12, 12) [rad^2] of the final angles."""
        return self.spread @ np.swapaxes(self.spread, 1, 2)


class RvTransmissionError(ToleranceProblem):
    """Transmission error of an RV reducer against cost and adjustment effort (document A).

    Variables are half-widths of the angles of four parts about three axes, and the precision weight
    of the adjusted assembly. Errors of parts are independent and centred; where all are normal the
    final angles are Gaussian, else they come from a sample. Details: docs/rv_transmission_error.md.
    """

    declaration = Declaration(
        declared.VARIABLES,
        declared.OUTPUTS,
        declared.PARAMETERS,
        costs=declared.COSTS,
        objectives=("cost", EFFORT, TE),
        model="assembly",
    )

    # ---------------------------------------------------------------- set-up

    def _variable(self, variable: Variable, given: VariableSetting | None) -> VariableSetting:
        """Errors of parts are normal unless the configuration says otherwise."""
        setting = super()._variable(variable, given)
        if variable.kind is Kind.HALF_WIDTH and setting.distribution is None:
            return replace(setting, distribution=Normal())
        return setting

    @cached_property
    def process(self) -> Process:
        """The assembly process in space. Raises InputError."""
        return space_process(model.process_of(self.settings.parameters))

    @cached_property
    def influence(self) -> Influence:
        """The influence coefficients, from the full model."""
        return influence(self.full)

    @cached_property
    def full(self) -> Transmission:
        """The full model, with the waves that effects add to every unit."""
        transmission = declared.transmission(self.settings.parameters)
        waves = waves_of(self.settings.effects, *self._operating)
        mapping = replace(transmission.mapping, floor=transmission.mapping.floor + waves.half_range_of_others)
        return replace(transmission, mapping=mapping, wave=waves.wave)

    @property
    def _operating(self) -> tuple[float, float]:
        """Torque [N m] and speed of the output [rpm]."""
        given = self.settings.parameters
        return number(given["torque_Nm"]), number(given["output_speed_rpm"])

    @cached_property
    def _deviations(self) -> Array:
        """Standard deviation of each part error per half-width, (12,)."""
        moments = [law.raw_moments(2) for law in self._laws.values()]
        return np.sqrt([second - first**2 for _, first, second in moments])

    @cached_property
    def _laws(self) -> dict[str, Distribution]:
        """The distribution of each part error, by variable."""
        given = {v.name: self.settings.variables[v.name].distribution for v in self.variables}
        return {name: law for name, law in given.items() if law is not None}

    @property
    def gaussian(self) -> bool:
        """Whether all errors of parts are normal, so that the final angles are."""
        return all(isinstance(law, Normal) for law in self._laws.values())

    def sources(self, count: int, dimensions: int) -> Array:
        """A Sobol sample (count, dimensions) of standardised sources: errors of parts by their
        laws, then noise.
        """
        sample = normals(count, dimensions, self.settings.seed)
        for at, (law, deviation) in enumerate(zip(self._laws.values(), self._deviations, strict=True)):
            if not isinstance(law, Normal):
                sample[:, at] = law.quantile(ndtr(sample[:, at])) / deviation
        return sample

    # ---------------------------------------------------------------- evaluation

    def residual(self, designs: Array) -> Residual:
        """Final angles of full designs (n, all variables), by the linear assembly process."""
        given = self.settings.parameters
        noise = number(given["measurement_std_mrad"]) * MRAD
        prior = np.full(declared.SIZE, number(given["part_std_mrad"]) * MRAD)
        linear = response(
            self.process,
            self._gains(self.column(designs, declared.PRECISION)),
            str(given["insertion"]),
            model.estimator_of(self.process, given, prior),
            departures_with(declared.departures(given), self.settings.effects),
        )
        parts = designs[:, : declared.SIZE] * MRAD * self._deviations
        more = linear.state.shape[-1] - declared.SIZE
        sources = np.hstack([parts, np.full((len(designs), more), noise)])
        return Residual(linear.state * sources[:, None, :], linear.effort(self.process, sources))

    def _gains(self, precision: Array) -> Array:
        return model.gains_of(self.process, self.settings.parameters, precision)

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        residual = self.residual(designs)
        te, force = self._te(residual, searching), self._force(residual, searching)
        std = np.sqrt(variances(residual.spread).sum(axis=-1)) / MRAD
        return {
            "cost": self.cost_of(designs),
            EFFORT: residual.effort / MRAD**2,
            TE: te / ARCSEC,
            FORCE: force,
            "te_error_percent": np.zeros(len(designs)),
            "force_error_percent": np.zeros(len(designs)),
        } | dict(zip(STD, std.T, strict=True))

    def _verified(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        te, force = outputs[TE] * ARCSEC, outputs[FORCE]
        spread = self.residual(designs).spread
        errors = errors_percent(self.full, self.influence, spread, te, force, self.sources)
        return dict(zip(("te_error_percent", "force_error_percent"), errors, strict=True))

    def _te(self, residual: Residual, searching: bool) -> Array:
        """Quantile (n,) [rad] of the TE amplitude, from a sample where the angles are not Gaussian,
        or all units share a wave.
        """
        plane, coverage = self.influence.order_40, self.settings.propagation.coverage
        if self.gaussian and not self.influence.wave.any():
            within = plane @ residual.covariance @ plane.T
            return self.influence.base_amplitude + radius_quantile(within, coverage)
        count = self.settings.propagation.samples
        count = min(count, SEARCH_SAMPLE) if searching else count
        return self._quantile(residual, plane, self.influence.amplitude_of, count)

    def _force(self, residual: Residual, searching: bool) -> Array:
        """Quantile (n,) [N] of the peak mesh force."""
        count = self.settings.propagation.samples
        if searching:
            count = min(count, SEARCH_SAMPLE if FORCE in self.required_outputs else SEARCH_SAMPLE // 8)
        return self._quantile(residual, self.influence.force, self.influence.peak_of, count)

    def _quantile(self, residual: Residual, rows: Array, of: Callable[[Array], Array], count: int) -> Array:
        """Quantile (n,) over `count` units of a function of the combinations `rows` (k, 12) x."""
        coverage = self.settings.propagation.coverage
        if self.gaussian:
            sample = normals(count, len(rows), self.settings.seed)
            return sample_quantile(rows @ residual.covariance @ rows.T, sample, of, coverage)
        return quantile_over(rows @ residual.spread, self.sources(count, residual.spread.shape[-1]), of, coverage)

    # ---------------------------------------------------------------- what is known

    def interval(self, output: str) -> Interval:
        """Proven bounds: costs fall with every tolerance, and no unit is below the error-free one.

        The latter holds for the influence coefficients; a wave of order 40 that all units share may
        be cancelled in some, the other orders are there in all.
        """
        if output == "cost":
            return self._cost_interval
        if output == TE:
            return self.influence.base_amplitude / ARCSEC, np.inf
        if output in {output.name for output in self.outputs if not output.error_of}:
            return 0.0, np.inf
        return super().interval(output)

    def _corners(self) -> Array:
        """Tightest and loosest tolerances, each with the least and the largest precision weight."""
        rows = np.repeat(super()._corners(), 2, axis=0)
        rows[:, self.names.index(declared.PRECISION)] = [*super().interval(declared.PRECISION)] * 2
        return rows

    def references(self) -> dict[str, Array]:
        """Document A's twelve tolerances, at each of its precision weights."""
        printed = list(declared.DOCUMENT_MRAD.values())
        return {f"document A, Q = {weight:g}": np.array([*printed, weight]) for weight in declared.PRECISION_WEIGHTS}

    def least_cost(self) -> tuple[str, RvTransmissionError]:
        """Least cost at the transmission error of document A's allocation, without adjustment."""
        first = next(iter(self.references().values()))[None]
        printed = self._te(self.residual(first), searching=False)
        limit = Bound(high=float(printed[0]) / ARCSEC)
        given = replace(
            self.given,
            objectives=("cost",),
            limits=dict(self.given.limits) | {TE: limit},
            variables=dict(self.given.variables) | {declared.PRECISION: VariableSetting(value=0.0)},
        )
        label = f"GA, least cost at {limit.high:.4g} arcsec without adjustment"
        return label, RvTransmissionError(given)

    def counterparts(self) -> tuple[str, ...]:
        return tuple(sentence(effect, *self._operating) for effect in self.settings.effects)

    # ---------------------------------------------------------------- faults and warnings

    def form(self) -> Form | None:
        """Cost against transmission error at a fixed precision weight, from below; None where the
        angles are not Gaussian.
        """
        return form_of(self) if self.gaussian else None

    def unproven(self) -> str:
        return "" if self.gaussian else "errors of parts are not normal: the form knows Gaussian angles alone"

    def faults(self) -> list[Fault]:
        process_faults: list[Fault] = []
        try:
            model.process_of(self.settings.parameters)
        except InputError as error:
            process_faults += error.faults
        for name, law in self._laws.items():
            if abs(float(law.raw_moments(1)[1])) > 1e-12:
                text = "must be centred (mean 0): errors of angles have no preferred sign here"
                process_faults.append(Fault(f"variables.{name}.distribution", text))
        return process_faults or super().faults()

    def warnings(self) -> tuple[str, ...]:
        messages = []
        if EFFORT not in self.required_outputs and any(v.name == declared.PRECISION for v in self.free):
            messages.append(
                "adjustment_effort is neither minimised nor limited: more adjustment always improves the accuracy; add "
                "it, or fix precision_weight"
            )
        usual = not any(self.settings.parameters[name] for name in (model.FLOW, *model.TRANSITIONS))
        if usual and not {FORCE, "kc_2_z_std_mrad", "kc_4_z_std_mrad", *COMPOSITE_STD} & set(self.required_outputs):
            messages.append(
                "peak_mesh_force_N is neither minimised nor limited: the gears' angles about z load the discs "
                "unevenly, but cause no transmission error: their tolerances become as wide as their ranges allow"
            )
        most = declared.transmission({}).contact.momentary_torque
        if (torque := number(self.settings.parameters["torque_Nm"])) > most:
            messages.append(f"torque {torque:g} Nm is beyond the momentary torque {most:g} Nm")
        return tuple(messages)

"""The corrected model, with the effects inside of it, all its parameters fitted jointly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from ...journal import Arrays, recall_arrays
from ...models.effects.measurements import Active, apply_output_actions, changes_of, effect_actions
from ...models.measurable import MeasurableModel
from ...section import Array
from .data import GapData
from .fit import Fit, Member, Space
from .library import predictor
from .plan import GapPlan
from .setup import Setup, nominal, residual_of

LEAST_ROWS = 10
"""Rows of a stretch of the record, at least."""
CHOSEN, MOST_CHOSEN = 0.05, 1.25
"""By how much an interval is widened for each further effect or term that was selected on the same
data, and the most: measured on the benchmark. Berk and others, Ann. Stat. 41, 2013."""
FEWEST = 12
"""Degrees of freedom of an interval from stretches, at least."""
STRETCHES = 40
"""Stretches, at most."""
BOUND_TOLERANCE = 1e-6
"""Fraction of its neighbours' size below which a parameter is 0, or is at its bound."""
STEPS, STEP, CONVERGED = 4, 1e-4, 1e-6
"""Gauss-Newton steps on all rows, relative step of a derivative, and change that ends them."""
COARSE, MORE, AS_EXPECTED = 1e-3, 40, 1.5
"""Step and evaluations of a second fit, made where the squares of the first exceed those of the
linear fit by this factor: models with stops and clearances are smooth only on a large scale."""


@dataclass(frozen=True)
class Number:
    """A fitted number: a free parameter, the zero of an output, or a parameter of an effect."""

    kind: str
    owner: str
    name: str
    low: float
    high: float
    scale: float


@dataclass(frozen=True)
class Corrected:
    """The corrected model: its `numbers` with their `values` (k,), errors, and predictions."""

    plan: GapPlan
    members: tuple[Member, ...]
    numbers: tuple[Number, ...]
    values: Array
    errors: Array
    freedom: int
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    added_variance: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def widened(self, by: Mapping[tuple[str, str], float]) -> Corrected:
        """The same model with added variance of some numbers, by owner and name."""
        more = np.array([by.get((number.owner, number.name), 0.0) for number in self.numbers])
        return replace(self._with_covariance(self.covariance + np.diag(more)), added_variance=by)

    def _with_covariance(self, covariance: Array) -> Corrected:
        return replace(self, covariance=covariance, errors=np.sqrt(np.maximum(np.diag(covariance), 0.0)))

    def nothing(self, member: Member) -> bool:
        """Whether the joint interval of an effect's linear parameters contains 0: Wald's F test.

        Its nonlinear parameters are held: they have no meaning where the effect is 0, and their
        uncertainty says nothing of its size. Parameters are scaled by their standard errors: in
        their units they may differ by factors of millions.
        """
        linear = {parameter.name for parameter in member.candidate.linear}
        indices = [k for k, number in enumerate(self.numbers) if number.owner == member.name]
        # the size of such an effect has no derivatives
        rounded = any(member.candidate.is_nonlinear for member in self.members)
        sizes = [k for k in indices if self.numbers[k].name in linear]
        if rounded or not sizes or not np.isfinite(self.errors[sizes]).all():
            return False
        indices = [k for k in indices if k in sizes or 0.0 < self.errors[k] < np.inf]
        errors = np.maximum(self.errors[indices], 1e-300)
        correlation = self.covariance[np.ix_(indices, indices)] / errors / errors[:, None]
        here = [indices.index(k) for k in sizes]
        precision = np.linalg.pinv(correlation, rcond=1e-12, hermitian=True)[np.ix_(here, here)]
        ratio = self.values[sizes] / errors[here]
        statistic = float(ratio @ precision @ ratio) / len(sizes)
        return statistic < float(scipy.special.fdtri(len(sizes), self.freedom, self.plan.settings.interval))

    def undetermined(self, member: Member) -> bool:
        """Whether the interval of every size of an effect contains 0."""
        sizes = [
            parameter for parameter in member.candidate.parameters if parameter.linear or member.candidate.is_nonlinear
        ]
        ends = [self.interval(member.name, size.name) for size in sizes if not size.choices]
        return bool(ends) and all(low <= 0.0 <= high for low, high in ends)

    def free(self) -> dict[str, float]:
        """Recalibrated parameters of the model by name."""
        return {number.name: value for number, value in self.numbers_of("free")}

    def effect(self, name: str) -> dict[str, float]:
        """Parameters of an effect by name."""
        member = next(member for member in self.members if member.name == name)
        chosen = {p.name: float(member.shape[p.name]) for p in member.candidate.shape if p.choices}
        return chosen | {number.name: v for number, v in self.numbers_of("effect") if number.owner == name}

    @property
    def active(self) -> list[Active]:
        """The effects with their parameters."""
        return [Active(member.candidate.effect, self.effect(member.name)) for member in self.members]

    @property
    def model(self) -> MeasurableModel | None:
        """The model with its recalibrated parameters, without the effects; None for a table."""
        return self.plan.rebuild(self.free()) if self.plan.rebuild and self.free() else self.plan.model

    def interval(self, owner: str, name: str) -> tuple[float, float]:
        """The linearised interval of a number, within its bounds; nan where it was not fitted."""
        half = float(scipy.special.stdtrit(self.freedom, 0.5 + 0.5 * self.plan.settings.interval))
        half *= min(1.0 + CHOSEN * max(len(self.members) - 1, 0), MOST_CHOSEN)
        for number, value, error in zip(self.numbers, self.values, self.errors, strict=True):
            if (number.owner, number.name) == (owner, name):
                ends = np.clip([value - half * error, value + half * error], number.low, number.high)
                return float(ends[0]), float(ends[1])
        return float("nan"), float("nan")

    def numbers_of(self, kind: str) -> list[tuple[Number, float]]:
        """The numbers of a kind with their values."""
        pairs = zip(self.numbers, self.values.tolist(), strict=True)
        return [(number, value) for number, value in pairs if number.kind == kind]

    def predicted(self, data: GapData, values: Array | None = None) -> dict[str, Array]:
        """Every measured output (n,) at rows of data."""
        model = self if values is None else replace(self, values=values)
        actions = effect_actions(model.active, data.measurements, data.target)
        means = self.plan.model.means() if self.plan.model and data.target.population else {}
        whole = predictor(self.plan, data, model.model)(changes_of(actions))
        outputs = {o.name: whole[o.name] for o in data.outputs}
        for number, value in model.numbers_of("zero"):
            outputs[number.name] = outputs[number.name] + value
        return apply_output_actions(outputs, actions, means, np.random.default_rng(self.plan.seed))


def corrected(setup: Setup, space: Space, fit: Fit, plain: bool = False) -> Corrected:
    """The joint fit in the full model: nonlinear least squares that start from the linear fit.

    Where the model itself is recalibrated, or with `plain`, all measurements have the same weight:
    errors of the model are no noise, and weights derived from them would bias the fit. The standard
    errors are still those of the noise as it is.
    """
    numbers, start = _numbers(setup, fit)
    model = Corrected(setup.plan, fit.members, numbers, start, np.full(len(start), np.nan), 1)
    scale = np.array([number.scale for number in numbers])
    used = space.unweighted() if setup.free or plain else space
    low = np.array([number.low for number in numbers]) / scale
    high = np.array([number.high for number in numbers]) / scale
    x = np.clip(start / scale, low + 1e-9 * (high > low), high - 1e-9 * (high > low))
    jacobian = np.zeros((space.rows_per_output * len(space.noises) + space.prior, 0))
    if len(x):
        residual, white = _residual(setup, used, model, scale), used.whiten(residual_of(setup, fit))

        def computed() -> Arrays:
            fitted = least_squares(residual, x, (low, high), float(white @ white))
            return np.asarray(fitted.x), np.ascontiguousarray(fitted.jac.T), np.asarray(fitted.fun)

        best, by_number, residuals = recall_arrays(("corrected", x, white), computed)
        jacobian = by_number.T
        x = np.where(np.isfinite(low) & (best - low < BOUND_TOLERANCE), low, best)
        x = np.asarray(np.where(np.isfinite(high) & (high - x < BOUND_TOLERANCE), high, x))
        if (np.abs(x) < STEP).any():  # relative steps fail at 0
            jacobian = _derivatives(residual, x, residuals, high)
    else:
        residuals = np.zeros(len(jacobian))
    return _add_covariance(model, (space, used), (x, scale), jacobian, residuals)


def least_squares(
    residual: Callable[[Array], Array], x: Array, ends: tuple[Array, Array], expected: float
) -> scipy.optimize.OptimizeResult:
    """Least squares from x (k,) within bounds. Where the squares exceed by far those that are
    expected of a linear model it is repeated with larger steps, and the better fit is returned.
    """
    first = scipy.optimize.least_squares(residual, x, bounds=ends, max_nfev=12, diff_step=[STEP])
    if 2.0 * first.cost <= AS_EXPECTED * expected:
        return first
    second = scipy.optimize.least_squares(residual, x, bounds=ends, max_nfev=MORE, diff_step=[COARSE])
    return second if second.cost < first.cost else first


def _add_covariance(
    model: Corrected, spaces: tuple[Space, Space], at: tuple[Array, Array], jacobian: Array, residuals: Array
) -> Corrected:
    """A corrected model at scaled numbers, with its covariance from the derivatives and the
    residuals (N,) there; `spaces` are that of the noise, and that of the fit.
    """
    (space, used), (x, scale) = spaces, at
    empirical = _clustered_covariance(jacobian, residuals, space)
    covariance = widened(_covariance(jacobian, space, used), empirical) * np.outer(scale, scale)
    freedom = max(min(space.count - len(scale), max(_stretches(space) - 1, FEWEST)), 1)
    return replace(model, values=x * scale, freedom=freedom)._with_covariance(covariance)


def _residual(setup: Setup, space: Space, model: Corrected, scale: Array) -> Callable[[Array], Array]:
    """Function of scaled numbers (k,): whitened residual (N,) with distances from tolerances."""
    measured = setup.data.stacked(setup.data.measured)
    free = np.array([number.kind == "free" for number in model.numbers], dtype=bool)
    middle = np.array([nominal(setup.plan, number.name) if number.kind == "free" else 0.0 for number in model.numbers])

    def residual(x: Array) -> Array:
        white = space.whiten(measured - setup.data.stacked(model.predicted(setup.data, x * scale)))
        white[len(white) - space.prior :] = ((middle - x * scale) / scale)[free]
        return white

    return residual


def _covariance(jacobian: Array, space: Space, used: Space) -> Array:
    """Covariance of numbers fitted in the space `used`, in the noise of `space`: sandwich form."""
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12)
    if used is space:
        return np.asarray(inverse, dtype=np.float64)
    n = space.rows_per_output
    tolerances = jacobian[len(jacobian) - space.prior :]
    middle = tolerances.T @ tolerances
    for at, (real, plain) in enumerate(zip(space.noises, used.noises, strict=True)):
        part = real.coloured(jacobian[at * n : (at + 1) * n] / plain.sigma[:, None])
        middle = middle + part.T @ part
    return np.asarray(inverse @ middle @ inverse)


def refit_corrected_model(setup: Setup, space: Space, fit: Fit, model: Corrected) -> Corrected:
    """A corrected model fitted to the many rows of another setup: Gauss-Newton steps from its
    present numbers, with derivatives computed column by column.
    """
    numbers, _ = _numbers(setup, fit)
    scale = np.array([number.scale for number in numbers])
    low, high = np.array([n.low for n in numbers]), np.array([n.high for n in numbers])
    renumbered = replace(model, numbers=numbers)
    residual = _residual(setup, space, renumbered, scale)
    x, residuals, jacobian = model.values / scale, np.empty(0), np.empty((0, len(scale)))
    for _ in range(STEPS):
        residuals = residual(x)
        jacobian = _derivatives(residual, x, residuals, high / scale)
        step = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12) @ (jacobian.T @ residuals)
        x = np.clip((x - step) * scale, low, high) / scale
        if float(np.abs(step).max(initial=0.0)) < CONVERGED:
            break
    return _add_covariance(renumbered, (space, space), (x, scale), jacobian, residuals)


def _derivatives(residual: Callable[[Array], Array], x: Array, residuals: Array, high: Array) -> Array:
    """Derivatives (N, k) of a residual at x (k,), `residuals` (N,) there, by steps below `high`."""
    jacobian = np.empty((len(residuals), len(x)), order="F")
    for k in range(len(x)):
        moved = x.copy()
        moved[k] += STEP * max(abs(x[k]), 1.0) * (-1.0 if x[k] + STEP > high[k] else 1.0)
        jacobian[:, k] = (residual(moved) - residuals) / (moved[k] - x[k])
    return jacobian


def _clustered_covariance(jacobian: Array, residuals: Array, space: Space) -> Array:
    """Covariance from the residuals themselves, with stretches of the record as clusters.

    Reference: Liang and Zeger, Biometrika 73, 1986. Misfit that persists over rows widens it.
    """
    n = space.rows_per_output
    count = _stretches(space)
    edges = np.searchsorted(np.arange(n) * count // n, np.arange(count + 1))
    sums = np.zeros((count, jacobian.shape[1]))
    for start in range(0, n * len(space.noises), n):
        for k in range(count):
            rows = slice(start + edges[k], start + edges[k + 1])
            sums[k] += jacobian[rows].T @ residuals[rows]
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12)
    return np.asarray(inverse @ (sums.T @ sums) @ inverse * count / (count - 1))


def _stretches(space: Space) -> int:
    """Number of stretches of a record."""
    return int(np.clip(space.rows_per_output // LEAST_ROWS, 2, STRETCHES))


def widened(model: Array, empirical: Array) -> Array:
    """A covariance (k, k) of the model, each variance at least the empirical one."""
    wider = np.sqrt(np.maximum(np.diag(empirical) / np.maximum(np.diag(model), 1e-300), 1.0))
    return np.asarray(model * np.outer(wider, wider))


def _numbers(setup: Setup, fit: Fit) -> tuple[tuple[Number, ...], Array]:
    """The numbers to fit, and their values (k,) in the linear fit."""
    numbers: list[Number] = []
    start: list[float] = []
    for at, name in enumerate(setup.free):
        half, middle = setup.plan.free[name], nominal(setup.plan, name)
        here = setup.at[name] + half * float(fit.free[at])
        numbers.append(Number("free", "", name, middle - half, middle + half, half))
        start.append(float(np.clip(here, middle - 0.99 * half, middle + 0.99 * half)))
    for at, name in enumerate(setup.data.zeros):
        value = float(fit.free[len(setup.free) + at])
        numbers.append(Number("zero", "", name, -np.inf, np.inf, max(abs(value), 1e-6)))
        start.append(value)
    for member, coefficients in zip(fit.members, fit.coefficients, strict=True):
        values = member.candidate.values(member.shape, coefficients)
        for parameter in (*member.candidate.linear, *member.candidate.shape):
            if parameter.choices:
                continue
            value = values[parameter.name]
            size = max((abs(values[neighbour.name]) for neighbour in member.candidate.linear), default=0.0)
            small = parameter.linear and abs(value) <= BOUND_TOLERANCE * size
            size = (size if small else abs(value)) or size or 1.0
            numbers.append(Number("effect", member.name, parameter.name, parameter.low, parameter.high, size))
            start.append(value)
    return tuple(numbers), np.array(start, dtype=float)

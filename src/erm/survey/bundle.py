r"""Bundle adjustment: faces and the errors of a survey in one robust least-squares problem.

Position, heading and clock of each receiver are a little wrong, and all paths of a position share these errors. Paths
off faces that many positions see show both: each face is a plane, and each position has four errors. With ``e`` the
residuals in standard errors and ``z`` the errors of positions in units of their standard deviations,

.. math:: \sum_i \rho(e_i) + \sum_p |z_p|^2 \to \min,

``rho`` Huber's function. The transmitters are exact: they fix where the map is. The standard deviations of the
receivers' coordinates fix how it is turned. Positions are eliminated (`erm.survey.schur`).

Scales of standard errors that are too small are variance components. With ``r`` the redundancy of a group, its number
of observations less the parameters that they determine, each step multiplies its variance by ``sum e**2 / r``.

A standard deviation that nobody gave is uncertain, too. All other measurements show the error of one position to
``x +- s``. Over its unknown size ``t`` the variance is the mean of ``t**2``, with the likelihood
``prod N(x; 0, t**2 + s**2)``. The most likely value would often be 0 where an error is merely shown badly, and errors
that look alike, of clocks and of places along a street, would then be stated as those of one kind.

References
----------
Förstner, Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten (1979). Huber, Robust Statistics (1981),
section 6.7 (Proposal 2). Gelman, Prior distributions for variance
parameters in hierarchical models (2006). Triggs et al., Bundle adjustment, a modern synthesis (2000).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from erm.geometry.chains import NO_FACE
from erm.geometry.vertical import FloatArray
from erm.mpcs.standard_errors import MIN_SCALE
from erm.survey.residuals import (
    AZIMUTH,
    CLOCK,
    HEADING,
    LENGTH,
    BentPaths,
    BoolArray,
    Faces,
    MeasuredPaths,
    Residuals,
    bent_residuals,
    residuals,
)
from erm.survey.schur import BLOCK, NormalEquations, Pattern, Solution, normal_equations, solve, total

HUBER_THRESHOLD = 2.5
"""Standard errors beyond which a residual pulls with constant force (99.7 % efficient on Gaussian errors)."""
PSI_SQUARED = float(
    2 * ndtr(HUBER_THRESHOLD)
    - 1
    - 2 * HUBER_THRESHOLD * np.exp(-(HUBER_THRESHOLD**2) / 2) / np.sqrt(2 * np.pi)
    + 2 * HUBER_THRESHOLD**2 * ndtr(-HUBER_THRESHOLD)
)
"""Mean square of a Gaussian residual that is clipped at the threshold."""
MAX_STEPS = 60
"""Steps at most: five for the parameters alone, thirty with their variances. Chosen; not derived."""
STEP_TOLERANCE = 1e-3
"""Step in standard errors, and relative change of a variance, below which the adjustment has converged."""
FIRST_STD = (0.5, 5.0, 0.3)
"""Standard deviations of coordinates [m], heading [degree] and clock [m] of a bad survey, where none is given."""
TRIED = np.geomspace(1e-3, 10.0, 41)
"""Sizes of errors relative to a bad survey: from better than any instrument to worse than any use."""
PRIOR = TRIED / (1 + TRIED**2)
"""Their weights before any measurement: half-Cauchy, which is flat near 0 (Gelman 2006), on a grid of logarithms."""
COMMON_PRIOR = (180.0, 1e4)
"""Standard deviations of common heading [degree] and clock [m] before any measurement."""
MIN_REDUNDANCY = 6.0
"""Redundancy below which a scale of errors is not estimated. Chosen; not derived."""
EPSILON = 1e-12
"""Share of a variance that rounding leaves."""
GROUPS = ((0, 1), (HEADING,), (CLOCK,))
"""Errors of a position that have one standard deviation: coordinates, heading, clock."""


@dataclass(frozen=True)
class SurveyStd:
    """Standard deviations of the survey errors of one position; None where unknown.

    Parameters
    ----------
    rx : float, optional
        Of each horizontal coordinate of a receiver [m].
    heading : float, optional
        Of the azimuth zero of a position [degree].
    clock : float, optional
        Of the clock of a position, times the speed of light [m].
    """

    rx: float | None = None
    heading: float | None = None
    clock: float | None = None

    def known(self) -> tuple[float | None, float | None, float | None]:
        """The three in the order of `GROUPS`."""
        return self.rx, self.heading, self.clock


@dataclass(frozen=True)
class Bundle:
    """Result of a bundle adjustment.

    Parameters
    ----------
    faces : Faces
    face_covariance : array (face, 2, face, 2)
        Of (normal [degree], offset [m]); it contains the errors of the survey.
    common : array (2,)
        Errors of heading [degree] and clock [m] that all positions share; 0 where they were not free.
    common_covariance : array (2, 2)
    face_common : array (face, 2, 2)
        Covariance of (normal, offset) of each face with the common errors.
    errors : array (position, 4)
        Errors of east, north [m], heading [degree] and clock [m] of each position, the common ones included.
    covariance : array (position, 4, 4)
    own_covariance : array (position, 4, 4)
        Without the common errors, which move walls and not paths against each other.
    std : array (3,)
        Standard deviations of coordinates [m], heading [degree] and clock [m], as given or as estimated.
    scale : array (2,)
        Factors of the standard errors of lengths and azimuths.
    residual : array (path, 2)
        Length and azimuth in these standard errors; of paths off cylinders last.
    cylinders : array (cylinder, 3)
        East and north of the axes and signed radii [m].
    cylinder_covariance : array (cylinder, 3, 3)
    """

    faces: Faces
    face_covariance: FloatArray
    common: FloatArray
    common_covariance: FloatArray
    face_common: FloatArray
    errors: FloatArray
    covariance: FloatArray
    own_covariance: FloatArray
    std: FloatArray
    scale: FloatArray
    residual: FloatArray
    cylinders: FloatArray
    cylinder_covariance: FloatArray

    @property
    def clock_std(self) -> float:
        """Standard error of the common clock [m]; 0 where it was not free."""
        return float(np.sqrt(self.common_covariance[1, 1]))

    def at_clock(self, clock: float, std: float) -> "Bundle":
        """The same with a common error of the clock [m] that is known; faces and heading follow it."""
        variance = self.common_covariance[1, 1]
        of_common, of_faces = self.common_covariance[:, 1] / variance, self.face_common[:, :, 1] / variance
        away, less = clock - self.common[1], variance - std**2
        errors = self.errors.copy()
        errors[:, (HEADING, CLOCK)] += away * of_common
        shared = np.zeros(BLOCK)
        shared[[HEADING, CLOCK]] = of_common
        return replace(
            self,
            faces=self.faces._replace(
                normal=self.faces.normal + away * of_faces[:, 0], offset=self.faces.offset + away * of_faces[:, 1]
            ),
            face_covariance=self.face_covariance - less * np.multiply.outer(of_faces, of_faces),
            common=self.common + away * of_common,
            common_covariance=self.common_covariance - less * np.outer(of_common, of_common),
            face_common=self.face_common - less * of_faces[:, :, None] * of_common,
            errors=errors,
            covariance=self.covariance - less * np.outer(shared, shared),
        )


@dataclass(frozen=True)
class _State:
    faces: Faces
    cylinders: FloatArray  # (cylinder, 3)
    common: FloatArray  # (2,)
    own: FloatArray  # (position, 4)
    std: FloatArray  # (3,)
    scale: FloatArray  # (2,)

    def errors(self) -> FloatArray:
        errors = self.own.copy()
        errors[:, (HEADING, CLOCK)] += self.common
        return errors


class _Problem:
    """One adjustment: its observations and where its parameters are."""

    def __init__(
        self, observations: MeasuredPaths, faces: Faces, positions: int, bent: BentPaths | None, *, common: bool
    ) -> None:
        self.observations, self.bent = observations, bent
        self.faces, self.positions, self.common = len(faces.normal), positions, common
        self.cylinders = 0 if bent is None else len(bent.cylinders)
        self.first_common = 2 * self.faces + 3 * self.cylinders
        self.shared = self.first_common + 2 * common
        padded = np.where(observations.faces == NO_FACE, 0, observations.faces)  # their slopes are 0
        columns = [(2 * padded[:, :, None] + np.arange(2)).reshape(len(padded), -1)]
        position = [observations.position]
        if bent is not None:
            columns.append(2 * self.faces + 3 * bent.number[:, None] + np.arange(3))
            position.append(bent.paths.position)
        of_common = np.broadcast_to(self.first_common + np.arange(2 * common), (sum(map(len, position)), 2 * common))
        self.pattern = Pattern.of(
            np.column_stack([_stacked(columns), of_common]), np.concatenate(position), self.shared, positions
        )

    def equations(self, state: _State) -> tuple[list[NormalEquations], FloatArray]:
        """Normal equations of lengths and of azimuths, in standard errors as given; residuals (path, 2)."""
        errors = state.errors()[self.pattern.position]
        count = len(self.observations)
        found = [residuals(self.observations, state.faces, errors[:count])]
        if self.bent is not None:
            found.append(bent_residuals(self.bent, state.cylinders, errors[count:]))
        value, by_position = (
            np.concatenate([getattr(one, name) for one in found]) for name in ("value", "by_position")
        )
        slopes = _stacked([one.by_face.reshape(len(one.value), 2, -1) for one in found])
        if self.common:
            slopes = np.concatenate([slopes, by_position[:, :, (HEADING, CLOCK)]], axis=-1)
        size = np.abs(value) / state.scale
        weight = np.minimum(1.0, HUBER_THRESHOLD / np.maximum(size, HUBER_THRESHOLD))
        both = Residuals(value, slopes, by_position)
        return [normal_equations(both, kind, weight[:, kind], self.pattern) for kind in (LENGTH, AZIMUTH)], value

    def solve(self, parts: list[NormalEquations], state: _State) -> Solution:
        """Step of the parameters; that of positions in standard deviations of their errors."""
        std = by_error(state.std)
        sum_of_parts = total(parts, 1 / state.scale**2).scaled(std)
        own = np.divide(state.own, std, out=np.zeros_like(state.own), where=std > 0)
        prior = np.zeros(self.shared)
        gradient = sum_of_parts.shared_gradient.copy()
        if self.common:
            prior[-2:] = 1 / np.square(COMMON_PRIOR)
            gradient[-2:] -= prior[-2:] * state.common
        with_prior = sum_of_parts._replace(
            shared=sum_of_parts.shared + np.diag(prior),
            shared_gradient=gradient,
            block=sum_of_parts.block + np.eye(BLOCK),
            block_gradient=sum_of_parts.block_gradient - own,
        )
        return solve(with_prior, self.pattern)

    def stepped(self, state: _State, solution: Solution) -> _State:
        """State after a step."""
        step = solution.shared[: 2 * self.faces].reshape(-1, 2)
        faces = state.faces._replace(
            normal=(state.faces.normal + step[:, 0]) % 360, offset=state.faces.offset + step[:, 1]
        )
        cylinders = state.cylinders + solution.shared[2 * self.faces : self.first_common].reshape(-1, 3)
        common = state.common + (solution.shared[-2:] if self.common else 0.0)
        return replace(
            state, faces=faces, cylinders=cylinders, common=common, own=state.own + solution.block * by_error(state.std)
        )


def _stacked(parts: list[np.ndarray]) -> np.ndarray:
    """Arrays (path, ..., slope) one after another, with zeros where one has fewer slopes."""
    width = max(part.shape[-1] for part in parts)
    return np.concatenate([np.pad(part, [(0, 0)] * (part.ndim - 1) + [(0, width - part.shape[-1])]) for part in parts])


def by_error(std: FloatArray) -> FloatArray:
    """Standard deviations (4,) of each error of a position from those (3,) of `GROUPS`."""
    return np.array([std[0], std[0], std[1], std[2]])


def adjust(
    observations: MeasuredPaths,
    faces: Faces,
    positions: int,
    given: SurveyStd = SurveyStd(),
    *,
    common: bool = False,
    errors_known: bool = True,
    start: Bundle | None = None,
    bent: BentPaths | None = None,
) -> Bundle:
    """Most likely faces and survey errors, with their covariances.

    Parameters
    ----------
    observations : MeasuredPaths
        Direct paths, single reflections and chains.
    faces : Faces
        Start, near enough that residuals are nearly linear; each face has a path.
    positions : int
        Number of positions. A position without paths keeps its errors at 0, to its standard deviations.
    given : SurveyStd
        Standard deviations of survey errors. Those not given are estimated.
    common : bool
        Whether all positions share an unknown error of heading and of clock.
    errors_known : bool
        Whether the standard errors of the observations are known. They are then enlarged where residuals are larger,
        but never reduced.
    start : Bundle, optional
        Result for nearly the same paths, from which this one is found in fewer steps.
    bent : BentPaths, optional
        Paths off cylinders, which are adjusted, too.

    Examples
    --------
    Twelve receivers in front of a wall, the clock of each wrong by 0.3 m:

    >>> rng = np.random.default_rng(1)
    >>> rx, clock = rng.uniform(-9, 9, (12, 2)), 0.3 * rng.standard_normal(12)
    >>> rows, none = np.repeat(np.arange(12), 2), np.zeros(24)
    >>> image = np.tile([[0.0, 0.0], [0.0, 40.0]], (12, 1)) - rx[rows]
    >>> measured = np.column_stack([np.hypot(*image.T) + clock[rows], np.rad2deg(np.arctan2(*image.T[::-1]))])
    >>> paths = MeasuredPaths(np.zeros((24, 2)), rx[rows], none, measured, np.tile([0.01, 0.1], (24, 1)), rows,
    ...                      np.tile([[-1], [0]], (12, 1)))
    >>> wall = Faces(np.array([270.5]), np.array([-19.9]), np.zeros((1, 2)))
    >>> found = adjust(paths, wall, 12, SurveyStd(rx=0.0))
    >>> found.faces.offset.round(2).tolist(), bool(np.abs(found.errors[:, 3] - clock).max() < 0.02)
    ([-20.0], True)
    """
    met = observations.faces
    observations = replace(observations, faces=met[:, (met != NO_FACE).any(axis=0)])
    problem = _Problem(observations, faces, positions, bent, common=common)
    first = [start if std is None else std for std, start in zip(given.known(), FIRST_STD, strict=True)]
    cylinders = np.empty((0, 3)) if bent is None else bent.cylinders
    own, std = np.zeros((positions, BLOCK)), np.array(first, dtype=float)
    state = _State(faces, cylinders, np.zeros(2), own, std, np.ones(2))
    free = np.array([std is None for std in given.known()])
    if start is not None:
        own = start.errors - np.r_[0.0, 0.0, start.common]
        state = replace(state, common=start.common, own=own, std=start.std, scale=start.scale)
    return _result(problem, *_converged(problem, state, free, errors_known=errors_known))


def _converged(
    problem: _Problem, state: _State, free: BoolArray, *, errors_known: bool
) -> tuple[_State, Solution, FloatArray]:
    """State after the last step, its solution and residuals."""
    for _ in range(MAX_STEPS):
        parts, value = problem.equations(state)
        solution = problem.solve(parts, state)
        moved = problem.stepped(state, solution)
        std = _survey_std(moved, solution, free)
        scale = _scales(state, solution, value, parts, errors_known=errors_known)
        change = np.abs(np.log(np.r_[scale / state.scale, std[free] / state.std[free]])).max()
        size = np.abs(solution.shared) / np.sqrt(np.maximum(np.diag(solution.shared_covariance), np.finfo(float).tiny))
        step = max(size.max(initial=0.0), np.abs(solution.block).max(initial=0.0))
        state = replace(moved, std=std, scale=scale)
        if max(change, step) < STEP_TOLERANCE:
            break
    parts, value = problem.equations(state)
    return state, problem.solve(parts, state), value


def _survey_std(state: _State, solution: Solution, free: BoolArray) -> FloatArray:
    """Standard deviations (3,) of survey errors after a step.

    The posterior variance ``v`` and mean ``z`` of an error, both in units of its standard deviation ``t``, tell what
    the measurements show without the prior: ``s**2 = t**2 v / (1 - v)`` and ``x = t z / (1 - v)``.
    """
    posterior = np.diagonal(solution.block_covariance(), axis1=1, axis2=2)
    std = state.std.copy()
    for number in np.flatnonzero(free).tolist():
        group = GROUPS[number]
        shown = np.clip(1 - posterior[:, group].ravel(), EPSILON, 1.0)  # a variance may be rounded to below zero
        variance = std[number] ** 2 * (1 - shown) / shown
        error = state.own[:, group].ravel() / shown
        tried = (TRIED * FIRST_STD[number]) ** 2
        total_variance = tried[:, None] + variance
        log_likelihood = -0.5 * np.sum(np.log(total_variance) + error**2 / total_variance, axis=1)
        weight = PRIOR * np.exp(log_likelihood - log_likelihood.max())
        std[number] = np.sqrt(weight @ tried / weight.sum())
    return std


def _scales(
    state: _State, solution: Solution, value: FloatArray, parts: list[NormalEquations], *, errors_known: bool
) -> FloatArray:
    """Scales (2,) of the standard errors of lengths and azimuths after a step."""
    scale = state.scale.copy()
    for kind, part in enumerate(parts):
        redundancy = len(value) - solution.trace(part.scaled(by_error(state.std))) / state.scale[kind] ** 2
        if redundancy > MIN_REDUNDANCY:
            clipped = np.minimum(np.abs(value[:, kind]) / state.scale[kind], HUBER_THRESHOLD)
            scale[kind] *= np.sqrt(np.sum(clipped**2) / (PSI_SQUARED * redundancy))
    return np.maximum(scale, 1.0 if errors_known else MIN_SCALE)


def _result(problem: _Problem, state: _State, solution: Solution, value: FloatArray) -> Bundle:
    faces, common = 2 * problem.faces, problem.first_common
    covariance = solution.shared_covariance
    each = faces + 3 * np.arange(problem.cylinders)[:, None] + np.arange(3)
    added = np.zeros((BLOCK, problem.shared))
    if problem.common:
        added[(HEADING, CLOCK), (common, common + 1)] = 1.0
    in_units = solution.scaled(by_error(state.std))
    return Bundle(
        faces=state.faces,
        face_covariance=covariance[:faces, :faces].reshape(problem.faces, 2, problem.faces, 2),
        common=state.common,
        common_covariance=covariance[common:, common:] if problem.common else np.zeros((2, 2)),
        face_common=covariance[:faces, common:].reshape(problem.faces, 2, 2)
        if problem.common
        else np.zeros((problem.faces, 2, 2)),
        errors=state.errors(),
        covariance=in_units.block_covariance(added),
        own_covariance=in_units.block_covariance(),
        std=state.std,
        scale=state.scale,
        residual=value / state.scale,
        cylinders=state.cylinders,
        cylinder_covariance=covariance[each[:, :, None], each[:, None, :]],
    )

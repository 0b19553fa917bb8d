"""Bundle adjustment of a map: walls, cylinders and survey errors of positions from all paths that are explained.

Each reflection of a chain moves its image by twice the error of a wall, and later reflections in a street meet its
walls more steeply than the first: a few chains may determine a wall better than all single reflections off it. Images
that are not walls are faces, too: whatever reflected their paths, it shows the errors of the positions.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from erm.common.constants import c
from erm.common.odds import THOUSAND_TO_ONE
from erm.geometry.chains import NO_FACE, chain_images
from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs.ground import followed_by_ground
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import fits_vertical_wall
from erm.mpcs.standard_errors import SIGMAS
from erm.mpcs.survey_widths import survey_widths
from erm.reconstruction.clock_of_chains import ChainsAt, with_clock_of_chains
from erm.reconstruction.curved.faces import Curved
from erm.reconstruction.curved.fit import compared
from erm.reconstruction.decision.chains import Chains, ChainSearch, first_of_each_path
from erm.reconstruction.decision.decide import Decision
from erm.reconstruction.images_of_chains import chains_of_images
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import Line, Lines
from erm.reconstruction.model.paths import BoolArray, IntArray, Paths
from erm.reconstruction.model.ragged import concatenate_rows
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.search.false_alarm import evidence
from erm.survey.bundle import Bundle, adjust, by_error
from erm.survey.image_fit import FEWEST_LINKS
from erm.survey.positions import PositionErrors
from erm.survey.residuals import CLOCK, HEADING, BentPaths, Faces, MeasuredPaths
from erm.survey.restart import Sources, restart

if TYPE_CHECKING:
    import xarray as xr

MAX_ADJUSTMENTS = 3
"""Repetitions of searching chains and fitting: the lines of one find the chains of the next. Chosen; not derived."""
MAX_EXPLAINED_SHARE = 0.5
"""Share of the paths of an image from which on chains explain it."""
GROUND_STD = 0.1
"""Deviation of the ground from its plane [m]: kerbs, and crowns of roads. Chosen; not derived."""
MAX_BOUNCES = 3
"""Faces of the longest chains that are searched."""


class Adjusted(NamedTuple):
    """Result of a bundle adjustment of a map."""

    decision: Decision
    """With the walls that were fitted, and their paths without errors of the survey."""
    curved: Curved
    """With the cylinders that were fitted."""
    chains: IntArray
    """Rows of the table that were reflected off several walls."""
    positions: PositionErrors
    """Started anew where that explains their paths better."""
    evidence: float = 0.0
    """Log-likelihood ratio of chains off the walls to paths from anywhere, if they were asked for the clock; else 0."""


def bundle_walls(
    table: "xr.Dataset",
    measured: Paths,
    decision: Decision,
    curved: Curved,
    positions: PositionErrors,
    max_gap: float,
) -> Adjusted:
    """Fit walls, cylinders and errors of positions to single reflections, direct paths, and chains off the walls.

    Parameters
    ----------
    table : xarray.Dataset
        From `erm.mpcs.selection.select`, of a table without the errors of positions that are known.
    measured : Paths
        All MPCs of the table.
    decision : Decision
    curved : Curved
    positions : PositionErrors
        What was removed from the table.
    max_gap : float
        How far beyond its outermost reflection points a wall may reflect [m].
    """
    problem = _Problem(table, measured, positions, curved)
    chains = np.empty(0, dtype=np.int64)
    no_image = (Reason.FALSE_ALARM, Reason.MEAN_ELEVATION)
    images = [_of_main_transmitter(wall) for wall, why in decision.rejected if why not in no_image]
    certain = _are_certain([*decision.walls, *images])
    walls = list(compress(decision.walls, certain))
    images = problem.located(list(compress(images, certain[len(decision.walls) :])), walls)
    if not len(problem.direct) and not walls and not images:
        return Adjusted(decision, curved, chains, positions)
    no_chain = (Reason.DIRECT_PATH, Reason.GROUND_REFLECTION, Reason.TOO_SHORT, Reason.CURVED_FACE)
    free = ~np.isin(table["reason"].values, no_chain) & fits_vertical_wall(table)
    free[concatenate_rows(wall.paths.row for wall in decision.walls)] = False
    rest = measured.take(free)
    faces = Lines.from_list([wall.line for wall in [*walls, *images]])
    kept = np.ones(len(faces.normal), dtype=bool)
    found = problem.adjust([*walls, *images], [], faces) if positions.inexact else _as_fitted(walls, positions)
    if positions.common:
        found = found.at_clock(float(found.common[1]), float(np.hypot(found.clock_std, positions.clock_doubt)))

    def search_at(bundle: Bundle) -> ChainSearch:
        free_paths = problem.without_errors(rest, positions.updated(bundle))
        possible = np.isfinite(free_paths.virtual_anchors()[:, 0])  # longer than the direct path
        return ChainSearch(walls, free_paths.take(possible), max_gap)

    def chains_at(bundle: Bundle) -> ChainsAt:
        lines, joint = _lines(walls, bundle)
        return ChainsAt(search_at(bundle).find(lines, joint), lines, joint)

    told = 0.0
    searched = len(walls) > 1 and len(rest) > 0
    single = float(np.median(measured.length_std)) if len(measured) else np.inf
    if searched and found.clock_std > single:
        of_image = np.arange(-table.sizes["mpc"], 0)  # a path of no image is one of its own
        for k, image in enumerate(images):
            of_image[image.paths.row] = k
        found, told = with_clock_of_chains(found, single, chains_at, of_image, float(np.ptp(measured.length)))
    of_images: list[Chains] = []
    for _ in range(MAX_ADJUSTMENTS if searched else 0):
        before, search, (lines, joint) = chains, search_at(found), _lines(walls, found)
        if positions.inexact:
            own = list(compress(images, kept[len(walls) :]))
            of_images += chains_of_images(own, found, len(walls), search, lines)
        # chains at one value of the clock contradict those at others, but an image is adjusted with its walls
        sets = [*of_images, *(search.find(lines, joint) if found.clock_std < SIGMAS * single else [])]
        sets = [one._replace(paths=measured.take(one.paths.row)) for one in first_of_each_path(sets)]
        chains = concatenate_rows(one.paths.row for one in sets)
        if np.array_equal(chains, before):
            break
        if positions.inexact:
            faces = faces.with_replaced(
                kept, faces.take(kept)._replace(normal=found.faces.normal, offset=found.faces.offset)
            )
        # an image that chains off the walls explain is no face of its own
        explained = [np.isin(image.paths.row, chains).mean() < MAX_EXPLAINED_SHARE for image in images]
        kept = np.r_[np.ones(len(walls), dtype=bool), np.array(explained, dtype=bool)]
        found = problem.adjust([*walls, *compress(images, kept[len(walls) :])], sets, faces.take(kept), found)
    others = list(compress(images, kept[len(walls) :]))
    if not positions.inexact and not len(chains):
        return Adjusted(decision, curved, chains, positions)
    updated = positions.updated(found)
    lines, _ = _lines(walls, found)
    fitted, number = [], 0
    corrected = problem.without_errors(decision.walls[0].all_paths, updated) if decision.walls else measured
    for wall, is_certain in zip(decision.walls, certain, strict=False):
        moved = replace(wall, all_paths=corrected)
        line = lines.line(number) if is_certain else _fitted_alone(moved.paths, wall.line, found)
        number += int(is_certain)
        fitted.append(replace(moved, line=line))
    if positions.inexact:
        updated = problem.restarted([*walls, *others], len(walls), found)
    return Adjusted(decision._replace(walls=fitted), problem.fitted(found, updated), chains, updated, told)


def _are_certain(walls: Sequence[Wall]) -> BoolArray:
    """Whether (wall,) candidates show errors of positions: they are a thousand times more likely than false alarms.

    Three paths whose positions are uncertain agree on some line by chance, and nothing contradicts it.
    """
    return evidence(walls) > THOUSAND_TO_ONE


class _Problem:
    """Paths of a table as they were measured, before errors of positions were removed."""

    def __init__(self, table: "xr.Dataset", measured: Paths, positions: PositionErrors, curved: Curved) -> None:
        self.positions, self.curved, self.measured = positions, curved, measured
        survey = table["survey_delay_std"].values * c, table["survey_azimuth_std"].values
        every = table["delay_std"].values * c, table["azimuth_std"].values
        own = [np.sqrt(np.maximum(both**2 - part**2, 0.0)) for both, part in zip(every, survey, strict=True)]
        self.std = np.column_stack(own) / positions.scale
        self.direct = measured.take(_direct_paths(table))
        self.follows, self.ground = followed_by_ground(table), float(table.attrs.get("ground_height", 0.0))
        neither = (Reason.GROUND_REFLECTION, Reason.CURVED_FACE)
        self.usable = measured.take(fits_vertical_wall(table) & ~np.isin(table["reason"].values, neither))

    def bent(self) -> BentPaths | None:
        """Paths off the curved faces; none before walls have shown where receivers stood.

        Until then pillars are taken for larger concave faces, which agree with what is wrong.
        """
        faces = self.curved.faces
        if not faces or (self.positions.inexact and self.positions.adjusted is None):
            return None
        paths = self.measured.take(self.curved.rows)
        return BentPaths(
            self._as_measured(paths, np.empty((len(paths), 0), dtype=np.int64)),
            np.repeat(np.arange(len(faces)), [len(face.inliers) for face in faces]),
            np.concatenate([face.fit.normal for face in faces]),
            np.array([[*face.fit.centre, face.fit.radius] for face in faces]),
        )

    def fitted(self, found: Bundle, positions: PositionErrors) -> Curved:
        """Curved faces as they were adjusted; one that some path no longer meets stays as it was."""
        if not len(found.cylinders):
            return self.curved
        faces = []
        for face, shape, covariance in zip(self.curved.faces, found.cylinders, found.cylinder_covariance, strict=True):
            own = self.without_errors(self.measured.take(self.curved.paths.row[face.inliers]), positions)
            fit = compared(own, face.fit.normal, shape[:2], float(shape[2]), covariance)
            faces.append(face._replace(fit=fit) if np.isfinite(fit.chi_squared).all() else face)
        return self.curved._replace(faces=faces)

    def adjust(
        self, walls: Sequence[Wall], sets: Sequence[Chains], lines: Lines, start: Bundle | None = None
    ) -> Bundle:
        """Adjust walls from their lines, cylinders and positions to their paths, direct paths, and chains."""
        paths = Paths.concatenate([self.direct, *(wall.paths for wall in walls), *(one.paths for one in sets)])
        faces = np.full((len(paths), MAX_BOUNCES), NO_FACE)
        first = len(self.direct)
        for number, wall in enumerate(walls):
            faces[first : first + wall.support, 0] = number
            first += wall.support
        for one in sets:
            faces[first : first + len(one.paths), : one.walls.shape[1]] = one.walls
            first += len(one.paths)
        return adjust(
            self._with_ways_by_ground(paths, self._as_measured(paths, faces)),
            Faces(lines.normal, lines.offset, lines.pivot),
            len(self.positions.first),
            self.positions.given,
            common=self.positions.common,
            errors_known=self.positions.errors_known,
            start=start,
            bent=self.bent(),
        )

    def located(self, images: Sequence[Wall], walls: Sequence[Wall]) -> list[Wall]:
        """Images that enough positions see whose errors other paths show: others agree with errors of any size."""
        if not self.positions.inexact:
            return list(images)
        rows = np.concatenate([self.direct.row, *(wall.paths.row for wall in walls)])
        shown = np.unique(self.positions.number[rows])
        seen = [np.unique(self.positions.number[image.paths.row]) for image in images]
        return [image for image, by in zip(images, seen, strict=True) if np.isin(by, shown).sum() >= FEWEST_LINKS]

    def _with_ways_by_ground(self, paths: Paths, known: MeasuredPaths) -> MeasuredPaths:
        """Paths, and those that met the same faces and the ground besides: each is measured twice.

        Seen from above they are the same. The sum of the heights of both antennas above the ground, ``H``, takes the
        place of the difference; a ground that is off its plane by ``s`` changes the length ``L`` by ``2 H s / L``.
        """
        met = np.full(len(self.follows), -1)
        met[paths.row] = np.arange(len(paths))
        of = np.where(self.follows >= 0, met[self.follows], -1)
        rows = np.flatnonzero(of >= 0)
        later = self.measured.take(rows)
        same = self._as_measured(later, known.faces[of[rows]])
        height = later.tx[:, 2] + later.rx[:, 2] - 2 * self.ground
        std = np.hypot(same.std, np.column_stack([2 * height * GROUND_STD / later.length, np.zeros(len(rows))]))
        return known.joined(replace(same, height_difference=height, std=std))

    def restarted(self, faces: Sequence[Wall], walls: int, found: Bundle) -> PositionErrors:
        """Errors of positions, found anew from the adjusted faces, of which the first ones are walls."""
        first = np.unique(self.usable.transmitter, return_index=True)
        at = dict(zip(first[0].tolist(), self.usable.tx[first[1], :2], strict=True))
        of = [(t, k) for t in at for k in range(len(faces)) if k < walls or faces[k].paths.transmitter[0] == t]
        tx = np.array([at[t] for t, _ in of]).reshape(-1, 2)
        face = np.array([k for _, k in of], dtype=np.int64)
        places, slopes = chain_images(tx, face[:, None], *found.faces)
        own = found.face_covariance[face, :, face]
        spread = np.sqrt(np.einsum("sik,skl,sil->s", slopes[:, 0], own, slopes[:, 0]) / 2)
        sources = Sources(
            np.vstack([np.array(list(at.values())).reshape(-1, 2), places[-1]]),
            np.r_[np.zeros(len(at)), spread],
            np.array([*at, *(t for t, _ in of)], dtype=np.int64),
        )
        paths = self._as_measured(self.usable, np.empty((len(self.usable), 0), dtype=np.int64))
        paths = replace(paths, std=paths.std * found.scale)
        prior = np.r_[0.0, 0.0, found.common], by_error(found.std)
        return self.positions.updated(found).restarted(
            restart(paths, (self.usable.transmitter, self.usable.elevation_misfit), sources, prior, found.errors)
        )

    def _as_measured(self, paths: Paths, faces: IntArray) -> MeasuredPaths:
        """Paths with the errors of positions that were removed from them, and the faces (path, bounce) they met."""
        position = self.positions.number[paths.row]
        errors = self.positions.errors[position]
        return MeasuredPaths(
            tx=paths.tx[:, :2],
            rx=paths.rx[:, :2] - errors[:, :2],
            height_difference=paths.tx[:, 2] - paths.rx[:, 2],
            measured=np.column_stack([paths.length + errors[:, CLOCK], paths.azimuth + errors[:, HEADING]]),
            std=np.hypot(self.std[paths.row], paths.scatter),
            position=position,
            faces=faces,
        )

    def without_errors(self, paths: Paths, found: PositionErrors) -> Paths:
        """Paths that had other errors of positions removed, now without those that were found."""
        number = self.positions.number[paths.row]
        change = (found.errors - self.positions.errors)[number]
        rx = paths.rx.copy()
        rx[:, :2] += change[:, :2]
        length, azimuth = paths.length - change[:, CLOCK], (paths.azimuth - change[:, HEADING]) % 360
        own = self.std[paths.row] * found.scale
        survey = survey_widths(length, paths.tx[:, 2] - rx[:, 2], azimuth, found.own_covariance[number])
        length_std, azimuth_std = np.hypot(np.hypot(own.T, survey), paths.scatter.T)
        moved = replace(paths, rx=rx, length=length, azimuth=azimuth)
        return moved.with_errors(length_std, azimuth_std)


def _fitted_alone(paths: Paths, start: Line, found: Bundle) -> Line:
    """Line of a wall that the adjustment did not hold; all its paths share the errors of common heading and clock."""
    line = fit_line(paths, start)
    std = np.sqrt(np.diag(found.common_covariance))
    if not std.any():
        return line
    moved = replace(paths, azimuth=paths.azimuth + std[0]), replace(paths, length=paths.length + std[1])
    others = [fit_line(one, line).with_pivot(line.pivot) for one in moved]
    slopes = (
        np.array([(angle_difference(one.normal, line.normal), one.offset - line.offset) for one in others])
        / std[:, None]
    )
    return line._replace(covariance=line.covariance + slopes.T @ found.common_covariance @ slopes)


def _as_fitted(walls: Sequence[Wall], positions: PositionErrors) -> Bundle:
    """Walls that were fitted one by one, of a survey without errors."""
    lines = Lines.from_list([wall.line for wall in walls])
    count, nothing = len(walls), np.zeros(2)
    covariance = np.zeros((count, 2, count, 2))
    covariance[np.arange(count), :, np.arange(count)] = lines.covariance
    return Bundle(
        faces=Faces(lines.normal, lines.offset, lines.pivot),
        face_covariance=covariance,
        common=nothing,
        common_covariance=np.diag(nothing),
        face_common=np.zeros((count, 2, 2)),
        errors=positions.errors,
        covariance=positions.covariance,
        own_covariance=positions.own_covariance,
        std=np.zeros(3),
        scale=positions.scale,
        residual=np.empty((0, 2)),
        cylinders=np.empty((0, 3)),
        cylinder_covariance=np.empty((0, 3, 3)),
    )


def _lines(walls: Sequence[Wall], found: Bundle) -> tuple[Lines, FloatArray]:
    """Lines of walls, the first faces of an adjustment, and their covariance (wall, 2, wall, 2)."""
    count = len(walls)
    joint = found.face_covariance[:count, :, :count]
    own = joint[np.arange(count), :, np.arange(count)]
    return Lines(found.faces.normal[:count], found.faces.offset[:count], own, found.faces.pivot[:count]), joint


def _of_main_transmitter(wall: Wall) -> Wall:
    """The paths of a candidate that have its most frequent transmitter: a line is no image of a chain for several."""
    main = np.bincount(wall.paths.transmitter).argmax()
    return replace(wall, inliers=wall.inliers[wall.paths.transmitter == main])


def _direct_paths(table: "xr.Dataset") -> IntArray:
    """Rows (n,) of direct paths, the strongest one of each pair of antennas."""
    rows = np.flatnonzero(table["reason"].values == Reason.DIRECT_PATH)
    rows = rows[np.argsort(-table["path_gain"].values[rows], kind="stable")]
    return rows[np.unique(table["link"].values[rows], return_index=True)[1]]

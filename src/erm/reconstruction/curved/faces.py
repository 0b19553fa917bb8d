"""Curved faces of a table: which paths may be off cylinders, which cylinders hold beside walls, and where they end."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from erm.geometry.vertical import FloatArray, unit
from erm.maps.arcs import arc_points
from erm.mpcs.ground import is_ground_companion
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import fits_vertical_wall
from erm.reconstruction.curved.choose import curved_faces
from erm.reconstruction.curved.ghosts import Cylinder, explained_by_chains, without_ghosts
from erm.reconstruction.curved.search import CurvedFace, CylinderSearch
from erm.reconstruction.decision.pieces import hidden_legs, span
from erm.reconstruction.model.extent import MAX_FRESNEL_MARGIN, Legs, solid_footprint
from erm.reconstruction.model.line import Lines
from erm.reconstruction.model.paths import IntArray, Paths
from erm.reconstruction.model.wall import Wall
from erm.reconstruction.poles.point_scatterers import MAX_RADIUS
from erm.reconstruction.poles.poles import Pole
from erm.reconstruction.search.greedy import Group

if TYPE_CHECKING:
    import xarray as xr


class Curved(NamedTuple):
    """Curved faces and the paths that their inliers are indices of."""

    faces: list[CurvedFace]
    search: CylinderSearch
    thin: list[CurvedFace]
    """Poles too thin to tell their radii."""

    @property
    def paths(self) -> Paths:
        """All paths that may be off curved faces."""
        return self.search.paths

    @property
    def rows(self) -> IntArray:
        """Rows of the table that are off curved faces."""
        return self._rows_of(self.faces)

    @property
    def thin_rows(self) -> IntArray:
        """Rows of the table that are off thin poles."""
        return self._rows_of(self.thin)

    def _rows_of(self, faces: list[CurvedFace]) -> IntArray:
        rows = [self.paths.row[face.inliers] for face in faces]
        return np.concatenate([np.empty(0, dtype=np.int64), *rows])


def find_curved_faces(
    table: "xr.Dataset", measured: Paths, paths: Paths, groups: Sequence[Group], min_support: int
) -> tuple[Curved, list[Group]]:
    """Curved faces among the MPCs that may be single reflections, and the groups of the others.

    What is off a thin pole is neither, and what met the ground as well is off no face of its own. The standard errors
    are widened as those of the grouped paths were.
    """
    possible = np.isin(table["reason"].values, (Reason.ACCEPTED, Reason.LOSS)) & fits_vertical_wall(table)
    possible &= ~is_ground_companion(table)
    pool = measured.take(np.flatnonzero(possible))
    if len(paths):
        wider = [
            float(np.median(getattr(paths, name) / getattr(measured, name)[paths.row]))
            for name in ("length_std", "azimuth_std")
        ]
        pool = pool.with_errors(pool.length_std * wider[0], pool.azimuth_std * wider[1])
    faces, search, left = curved_faces(paths, groups, pool, min_support)
    thin = [face for face in faces if face.is_thin]
    return Curved([face for face in faces if not face.is_thin], search, thin), left


def standing(curved: Curved, max_gap: float) -> np.ndarray:
    """Where (face,) curved faces stand, seen from above: disks of pillars, lines of arcs."""
    round_ = [face for face in (*curved.faces, *curved.thin) if is_pole(face)]
    centres = shapely.points(np.array([face.fit.centre for face in round_]).reshape(-1, 2))
    arcs = []
    for face in curved.faces:
        for low, high, _ in [] if is_pole(face) else arc_azimuths(face, curved.paths, max_gap):
            ends = face.fit.centre + abs(face.fit.radius) * unit(np.array([low, high]))
            arcs.append(shapely.linestrings(arc_points(ends, face.fit.centre, face.fit.radius)))
    disks = shapely.buffer(centres, [face.fit.radius for face in round_])
    return np.array([*disks, *arcs], dtype=object)


def beside_walls(curved: Curved, walls: Sequence[Wall]) -> Curved:
    """Curved faces of which most paths do not pass through walls, and that are no ghosts."""
    explained = np.concatenate([np.empty(0, dtype=np.int64), *(wall.paths.row for wall in walls)])
    free = ~np.isin(curved.paths.row, explained)
    if not walls:
        return curved._replace(faces=without_ghosts(curved.faces, curved.search, [], free))
    footprints = [solid_footprint(wall) for wall in walls]
    tree = shapely.STRtree(shapely.linestrings(np.array([span(one) for one in footprints])))
    kept = []
    for face in curved.faces:
        own, point = curved.paths.take(face.inliers), face.fit.point
        legs = Legs(np.vstack([own.tx, own.rx]), np.vstack([point, point]))
        hidden = hidden_legs(legs, tree, footprints).reshape(2, -1).any(axis=0)
        if np.mean(hidden) < 0.5:
            kept.append(face)
    return curved._replace(faces=without_ghosts(kept, curved.search, [wall.line for wall in walls], free))


def chains_off(curved: Curved, paths: Paths, lines: Lines) -> tuple[IntArray, IntArray]:
    """Pairs of paths and walls, of which chains off the wall and a curved face, or a thin pole, explain the path."""
    return explained_by_chains(paths, [Cylinder.of(face) for face in (*curved.faces, *curved.thin)], lines)


def without_ghosts_of_poles(curved: Curved, poles: Sequence[Pole], walls: Sequence[Wall]) -> Curved:
    """Curved faces of which chains off poles and walls do not explain most paths.

    The radius of a pole, that of a perfectly reflecting one, is known to its own size.
    """
    cylinders = [
        Cylinder(pole.centre, pole.radius, np.pad(pole.covariance, (0, 1)) + np.diag([0.0, 0.0, pole.radius**2]))
        for pole in poles
    ]
    lines = Lines.from_list([wall.line for wall in walls])
    paths = [curved.paths.take(face.inliers) for face in curved.faces]
    explained = [len(np.unique(explained_by_chains(own, cylinders, lines)[0])) for own in paths]
    return curved._replace(
        faces=[face for face, count in zip(curved.faces, explained, strict=True) if count < len(face.inliers) / 2]
    )


def is_pole(face: CurvedFace) -> bool:
    """Whether a face is a pillar, all of whose circle stands."""
    return 0 < face.fit.radius <= MAX_RADIUS


def arc_azimuths(face: CurvedFace, paths: Paths, max_gap: float) -> list[tuple[float, float, IntArray]]:
    """Pieces of an arc: azimuths of both ends seen from the centre [degree], and the inliers between.

    An arc reaches a Fresnel zone beyond its outermost reflection points, as walls do. The widest gap of the circle is
    open, and so are gaps longer than ``max_gap`` along it [m].
    """
    fit = face.fit
    azimuth = (fit.normal + (180 if fit.radius < 0 else 0)) % 360
    order = np.argsort(azimuth, kind="stable")
    ahead = np.diff(azimuth[order], append=azimuth[order[0]] + 360)
    open_ = np.deg2rad(ahead) * abs(fit.radius) > max_gap
    open_[np.argmax(ahead)] = True
    order = np.roll(order, -1 - int(np.argmax(ahead)))
    cuts = np.flatnonzero(np.roll(open_, -1 - int(np.argmax(ahead))))[:-1] + 1
    margin = np.rad2deg(_fresnel_margin(face, paths) / abs(fit.radius))
    pieces = []
    for run in np.split(order, cuts):
        sweep = (azimuth[run[-1]] - azimuth[run[0]]) % 360
        low, high = azimuth[run[0]] - margin[run[0]], azimuth[run[0]] + sweep + margin[run[-1]]
        pieces.append((float(low), float(min(high, low + 359.9)), run))
    return pieces


def _fresnel_margin(face: CurvedFace, paths: Paths) -> FloatArray:
    """Half length (inlier,) along the face of the first Fresnel zone of each path, as of a plane [m]."""
    own = paths.take(face.inliers)
    first, second = (np.linalg.norm(face.fit.point - end, axis=-1) for end in (own.tx, own.rx))
    ahead = np.sum((own.tx - face.fit.point) * (own.rx - face.fit.point), axis=-1) / (first * second)
    cosine = np.sqrt(np.maximum((1 + ahead) / 2, 1e-6))
    return np.minimum(np.sqrt(own.wavelength * first * second / (first + second)) / cosine, MAX_FRESNEL_MARGIN)

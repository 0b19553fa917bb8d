"""What a survey with small errors predicts of measured paths, and how the predictions move with the errors."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from erm.geometry.chains import chain_images
from erm.geometry.cylinders import bounce
from erm.geometry.vertical import FloatArray, angle_difference

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

EAST, NORTH, HEADING, CLOCK = range(4)
"""Errors of one position: of its coordinates [m], of its azimuths [degree], of its lengths [m]."""
LENGTH, AZIMUTH = range(2)
"""The two quantities that are measured of each path."""


@dataclass(frozen=True)
class MeasuredPaths:
    """Measured paths whose faces are known; a path without a face is direct.

    Parameters
    ----------
    tx, rx : array (path, 2)
        Antenna positions as surveyed [m].
    height_difference : array (path,)
        Of the ends of the unfolded path [m]; for a ground reflection, the sum of both heights above the ground.
    measured, std : array (path, 2)
        Length [m] and azimuth [degree], and their standard errors.
    position : array (path,) of int
        Number of the position, which has one set of survey errors.
    faces : array (path, bounce) of int
        Faces that the path met, transmitter first, filled up with `erm.geometry.chains.NO_FACE`.
    """

    tx: FloatArray
    rx: FloatArray
    height_difference: FloatArray
    measured: FloatArray
    std: FloatArray
    position: IntArray
    faces: IntArray

    def __len__(self) -> int:
        return len(self.measured)

    def take(self, rows: IntArray | BoolArray) -> "MeasuredPaths":
        """Return the paths of an index or mask."""
        return MeasuredPaths(*(getattr(self, one.name)[rows] for one in fields(self)))

    def joined(self, others: "MeasuredPaths") -> "MeasuredPaths":
        """Return these paths and others."""
        return MeasuredPaths(
            *(np.concatenate([getattr(self, one.name), getattr(others, one.name)]) for one in fields(self))
        )


class Faces(NamedTuple):
    """Vertical faces ``n.(p - pivot) = offset``."""

    normal: FloatArray  # (face,) degree
    offset: FloatArray  # (face,) m
    pivot: FloatArray  # (face, 2) m


class BentPaths(NamedTuple):
    """Measured paths off vertical cylinders."""

    paths: MeasuredPaths
    number: IntArray  # (path,) of the cylinder
    normal: FloatArray  # (path,) degree, from which the reflection point is searched
    cylinders: FloatArray  # (cylinder, 3) east, north and signed radius [m]; the start of an adjustment


class Residuals(NamedTuple):
    """Measured minus predicted, and the slopes of the predictions; all in standard errors of the measurement."""

    value: FloatArray  # (path, 2)
    by_face: FloatArray  # (path, 2, bounce, 2), of (normal, offset); (path, 2, 3) of a cylinder
    by_position: FloatArray  # (path, 2, 4)


def residuals(observations: MeasuredPaths, faces: Faces, errors: FloatArray) -> Residuals:
    r"""Compare paths with the prediction from faces and survey errors.

    With ``I`` the image of the transmitter in all faces of the path, ``r = rx + (e, n)`` the true receiver and ``h``
    and ``b`` the errors of heading and clock, the prediction is

    .. math:: L = \sqrt{|I - r|^2 + \Delta z^2} + b, \qquad \alpha = \angle (I - r) + h.

    Parameters
    ----------
    observations : MeasuredPaths
    faces : Faces
    errors : array (path, 4)
        East, north [m], heading [degree] and clock [m].

    Examples
    --------
    A receiver that is 0.1 m further from the transmitter than surveyed, with a clock that is 0.2 m late:

    >>> zero = np.zeros(1)
    >>> path = MeasuredPaths(np.zeros((1, 2)), np.array([[3.0, 0.0]]), zero, np.array([[3.3, 180.0]]), np.ones((1, 2)),
    ...                     np.zeros(1, dtype=int), np.empty((1, 0), dtype=int))
    >>> none = Faces(np.empty(0), np.empty(0), np.empty((0, 2)))
    >>> residuals(path, none, np.array([[0.1, 0.0, 0.0, 0.2]])).value.round(9).tolist() == [[0.0, 0.0]]
    True
    """
    places, of_image = chain_images(observations.tx, observations.faces, *faces)
    apart = places[-1] - observations.rx - errors[:, :2]
    horizontal = np.hypot(apart[:, 0], apart[:, 1])
    slant = np.hypot(horizontal, observations.height_difference)
    toward = apart / horizontal[:, None]
    left = np.stack([-toward[:, 1], toward[:, 0]], axis=-1)
    # slopes (path, 2, xy) of length and azimuth by the last image; those by the receiver are their negatives
    by_image = np.stack([(horizontal / slant)[:, None] * toward, np.rad2deg(left / horizontal[:, None])], axis=1)
    by_image /= observations.std[:, :, None]
    by_position = np.zeros((len(observations), 2, 4))
    by_position[:, :, :2] = -by_image
    by_position[:, LENGTH, CLOCK] = 1 / observations.std[:, LENGTH]
    by_position[:, AZIMUTH, HEADING] = 1 / observations.std[:, AZIMUTH]
    azimuth = np.rad2deg(np.arctan2(apart[:, 1], apart[:, 0])) + errors[:, HEADING]
    length = slant + errors[:, CLOCK]
    value = np.stack(
        [observations.measured[:, LENGTH] - length, angle_difference(observations.measured[:, AZIMUTH], azimuth)],
        axis=-1,
    )
    by_face = np.einsum("pqi,pbik->pqbk", by_image, of_image)
    return Residuals(value / observations.std, by_face, by_position)


def bent_residuals(bent: BentPaths, cylinders: FloatArray, errors: FloatArray) -> Residuals:
    """Compare paths with single bounces off cylinders (cylinder, 3); what is not reflected shows nothing.

    Parameters and result are those of `residuals`.
    """
    own, shape = bent.paths, cylinders[bent.number]
    found = bounce(own.tx, own.rx + errors[:, :2], shape[:, :2], shape[:, 2], bent.normal)
    slant = np.hypot(found.length, own.height_difference)
    flat = (found.length / slant)[:, None]
    leg = own.rx + errors[:, :2] - found.point
    by_position = np.zeros((len(own), 2, 4))
    by_position[:, LENGTH, :2] = flat * leg / np.linalg.norm(leg, axis=-1, keepdims=True)
    by_position[:, AZIMUTH, :2] = found.azimuth_slopes_by_rx
    by_position[:, LENGTH, CLOCK] = by_position[:, AZIMUTH, HEADING] = 1.0
    by_face = np.stack([flat * found.length_slopes, found.azimuth_slopes], axis=1)
    azimuth = angle_difference(own.measured[:, AZIMUTH], found.azimuth + errors[:, HEADING])
    value = np.stack([own.measured[:, LENGTH] - slant - errors[:, CLOCK], azimuth], axis=-1)
    parts = (value / own.std, by_face / own.std[:, :, None], by_position / own.std[:, :, None])
    usable = np.isfinite(parts[0]).all(axis=1) & np.isfinite(parts[1]).all(axis=(1, 2))
    return Residuals(*(np.where(usable.reshape(-1, *[1] * (part.ndim - 1)), part, 0.0) for part in parts))

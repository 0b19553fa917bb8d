"""Random worlds for bundle adjustment: faces around the antennas, positions with survey errors, noisy paths."""

from typing import NamedTuple

import numpy as np

from erm.geometry.chains import NO_FACE
from erm.geometry.vertical import FloatArray
from erm.survey.residuals import Faces, MeasuredPaths, residuals

NOISE = (0.03, 0.5)  # m, degree


class World(NamedTuple):
    observations: MeasuredPaths
    faces: Faces
    errors: FloatArray  # (position, 4)


def random_world(
    rng: np.random.Generator,
    std: tuple[float, float, float] = (0.2, 3.0, 0.15),
    common: tuple[float, float] = (0.0, 0.0),
    positions: int = 40,
    faces: int = 5,
) -> World:
    """Receivers among faces. Each sees most of them, three chains of two, and in six of ten cases the transmitter."""
    true = Faces(rng.uniform(0, 360, faces), -rng.uniform(9, 18, faces), np.zeros((faces, 2)))
    rx = rng.uniform(-7, 7, (positions, 2))
    errors = rng.standard_normal((positions, 4)) * np.array([std[0], std[0], std[1], std[2]]) + [0, 0, *common]
    seen = [np.argwhere(rng.random((positions, faces)) < 0.7), np.argwhere(rng.random((positions, 1)) < 0.6)]
    seen[1][:, 1] = NO_FACE
    pairs = np.array([rng.choice(faces, 2, replace=False) for _ in range(3 * positions)])
    position = np.concatenate([seen[0][:, 0], seen[1][:, 0], np.repeat(np.arange(positions), 3)])
    met = np.vstack([*(np.column_stack([one[:, 1], np.full(len(one), NO_FACE)]) for one in seen), pairs])
    count = len(position)
    std_of_paths = np.tile(NOISE, (count, 1))
    tx = np.tile([1.0, 2.0], (count, 1))
    paths = MeasuredPaths(tx, rx[position], np.full(count, 3.0), np.zeros((count, 2)), std_of_paths, position, met)
    exact = -residuals(paths, true, errors[position]).value * std_of_paths
    measured = exact + std_of_paths * rng.standard_normal((count, 2))
    return World(
        MeasuredPaths(tx, rx[position], np.full(count, 3.0), measured, std_of_paths, position, met), true, errors
    )


def nearby(rng: np.random.Generator, faces: Faces) -> Faces:
    """Faces that are 0.3 degrees and 5 cm off."""
    count = len(faces.normal)
    return faces._replace(
        normal=faces.normal + 0.3 * rng.standard_normal(count), offset=faces.offset + 0.05 * rng.standard_normal(count)
    )

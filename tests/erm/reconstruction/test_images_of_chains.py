"""Images of chains off known walls."""

import numpy as np
import pytest
from scipy.constants import c

from erm.geometry.chains import NO_FACE
from erm.reconstruction.decision.chains import ChainSearch
from erm.reconstruction.images_of_chains import chains_of_images
from erm.reconstruction.model.fit import fit_line
from erm.reconstruction.model.line import Lines, seed_line
from erm.reconstruction.model.loss import reflection_loss
from erm.reconstruction.model.wall import Wall
from erm.survey.bundle import SurveyStd, adjust
from erm.survey.residuals import Faces, MeasuredPaths

from .bounces import bounces, paths_of

TX = np.array([-40.0, 2.0, 12.0])
LENGTH_STD, AZIMUTH_STD, RX_STD = 0.03, 0.5, 0.2


SOUTH, NORTH, BEHIND = (90.0, -9.0), (270.0, -10.0), (270.0, -11.5)


def chains_of(chain, seed):
    """Chains off the two sides of a street that an image is, shared by twelve receivers that are 0.2 m off."""
    rng = np.random.default_rng(seed)
    rx = np.column_stack([np.linspace(-15, 45, 12), rng.uniform(-6, 7, 12), np.full(12, 1.5)])
    moved = rx - np.column_stack([RX_STD * rng.standard_normal((12, 2)), np.zeros(12)])
    walls = []
    for met in ([SOUTH], [NORTH], chain):
        columns = bounces(np.tile(TX, (12, 1)), rx, *met) | {"rx_position": moved}
        across = np.sin(np.deg2rad(columns["azimuth"])) * np.cos(np.arcsin(10.5 / (c * columns["delay"])))
        loss = len(met) * reflection_loss(4.0, np.abs(across))  # both sides are met at one angle
        columns["azimuth"] = columns["azimuth"] + AZIMUTH_STD * rng.standard_normal(12)
        columns["delay"] = columns["delay"] + LENGTH_STD / c * rng.standard_normal(12)
        paths = paths_of(columns, LENGTH_STD, AZIMUTH_STD, loss)
        walls.append(Wall(paths, fit_line(paths, seed_line(paths.take(np.arange(1)))), np.arange(12)))
    lines = Lines.from_list([wall.line for wall in walls])
    every = [wall.paths for wall in walls]
    observations = MeasuredPaths(
        np.vstack([paths.tx[:, :2] for paths in every]),
        np.vstack([paths.rx[:, :2] for paths in every]),
        np.full(36, 10.5),
        np.vstack([np.column_stack([paths.length, paths.azimuth]) for paths in every]),
        np.tile([LENGTH_STD, AZIMUTH_STD], (36, 1)),
        np.tile(np.arange(12), 3),
        np.column_stack([np.repeat(np.arange(3), 12), np.full(36, NO_FACE)]),
    )
    found = adjust(observations, Faces(lines.normal, lines.offset, lines.pivot), 12, SurveyStd(RX_STD, 0.0, 0.0))
    return chains_of_images(walls[2:], found, 2, ChainSearch(walls[:2], walls[2].paths, 15.0), lines.take(np.arange(2)))


@pytest.mark.parametrize("seed", range(5))
def test_a_threefold_reflection_in_a_street_is_one_of_its_two_walls(seed):
    (chain,) = chains_of([NORTH, SOUTH, NORTH], seed)
    assert np.unique(chain.walls, axis=0).tolist() == [[1, 0, 1]]


@pytest.mark.parametrize("seed", range(5))
def test_a_face_behind_the_wall_makes_another_image(seed):
    # 1.5 m behind, it moves the image by 3 m, and twelve receivers that are 0.2 m off show this to a few decimetres
    assert chains_of([SOUTH, BEHIND], seed) == []

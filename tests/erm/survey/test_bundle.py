"""Bundle adjustment finds the survey errors that were put in, to the errors that it states."""

from dataclasses import replace

import numpy as np
import pytest

from erm.geometry.chains import NO_FACE
from erm.geometry.vertical import FloatArray, angle_difference, unit
from erm.survey.bundle import Bundle, SurveyStd, adjust
from erm.survey.residuals import Faces

from .worlds import NOISE, World, nearby, random_world

pytestmark = pytest.mark.slow


def solved(world: World, rng: np.random.Generator, given: SurveyStd, *, common: bool = False) -> Bundle:
    return adjust(world.observations, nearby(rng, world.faces), len(world.errors), given, common=common)


def in_standard_errors(world: World, found: Bundle) -> tuple[FloatArray, FloatArray]:
    """Errors of faces and of positions over what the adjustment states."""
    apart = np.stack(
        [angle_difference(found.faces.normal, world.faces.normal), found.faces.offset - world.faces.offset]
    )
    faces = apart.T / np.sqrt(np.einsum("fifi->fi", found.face_covariance))
    stated = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    return faces, (found.errors - world.errors) / stated


@pytest.mark.parametrize("given", [SurveyStd(0.2, 3.0, 0.15), SurveyStd()])
def test_errors_are_as_large_as_stated(given: SurveyStd) -> None:
    # 1600 errors of positions, 100 of faces; the faces of one world share its rotation
    worlds, faces, positions = 10, [], []
    for seed in range(worlds):
        rng = np.random.default_rng(seed)
        world = random_world(rng, common=(4.0, 0.8))
        one, other = in_standard_errors(world, solved(world, rng, given, common=True))
        faces.append(one.ravel())
        positions.append(other)
    of_faces, of_positions = np.concatenate(faces), np.concatenate(positions)
    for quantity in of_positions.T:
        assert np.mean(np.abs(quantity) < 1) == pytest.approx(0.683, abs=0.08)
        assert np.mean(np.abs(quantity) < 2) == pytest.approx(0.954, abs=0.04)
    effective = worlds * 3  # three independent numbers a world are a cautious guess
    assert np.mean(np.abs(of_faces) < 1) == pytest.approx(0.683, abs=3 * np.sqrt(0.683 * 0.317 / effective))
    assert np.mean(np.abs(of_faces) < 2) == pytest.approx(0.954, abs=3 * np.sqrt(0.954 * 0.046 / effective))


def test_standard_deviations_are_estimated() -> None:
    rng = np.random.default_rng(1)
    found = solved(random_world(rng, positions=80), rng, SurveyStd())
    # 160 coordinates, 80 headings, 80 clocks: standard deviations to 1 / sqrt(2 n), and a little less well each
    np.testing.assert_allclose(found.std, [0.2, 3.0, 0.15], rtol=0.3)


def test_errors_of_an_exact_survey_are_less_than_those_of_a_path() -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        world = random_world(rng, std=(0.0, 0.0, 0.0))
        found = solved(world, rng, SurveyStd())
        assert (found.std < [NOISE[0], NOISE[1], NOISE[0]]).all()
        assert np.mean(np.abs(found.errors) < np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))) > 0.9


def test_only_what_is_wrong_is_corrected() -> None:
    rng = np.random.default_rng(4)
    found = solved(random_world(rng, std=(0.0, 3.0, 0.0)), rng, SurveyStd())
    assert (found.std[[0, 2]] < NOISE[0]).all()
    assert found.std[1] == pytest.approx(3.0, rel=0.4)


def test_errors_that_look_alike_are_not_stated_as_those_of_one_kind() -> None:
    # direct paths show the sum of the clock and of the place along the path, whichever is wrong
    rng = np.random.default_rng(10)
    world = random_world(rng, std=(0.2, 0.0, 0.15))
    direct = world.observations.take((world.observations.faces == NO_FACE).all(axis=1))
    none = Faces(np.empty(0), np.empty(0), np.empty((0, 2)))
    found = adjust(direct, none, len(world.errors), SurveyStd(heading=0.0))
    stated = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    assert np.mean(np.abs(found.errors - world.errors)[:, 3] < 2 * stated[:, 3]) > 0.9


def test_too_small_standard_errors_of_paths_are_scaled() -> None:
    rng = np.random.default_rng(5)
    world = random_world(rng)
    stated = replace(world.observations, std=world.observations.std / [3.0, 2.0])
    found = solved(world._replace(observations=stated), rng, SurveyStd())
    np.testing.assert_allclose(found.scale, [3.0, 2.0], rtol=0.15)


def test_a_wrong_path_bends_nothing() -> None:
    rng = np.random.default_rng(6)
    world = random_world(rng)
    measured = world.observations.measured.copy()
    measured[::20, 0] += 2.0
    found = solved(world._replace(observations=replace(world.observations, measured=measured)), rng, SurveyStd())
    faces, positions = in_standard_errors(world, found)
    assert np.sqrt(np.mean(positions**2)) < 1.5
    assert np.sqrt(np.mean(faces**2)) < 2


def test_turning_the_scene_turns_the_result() -> None:
    rng = np.random.default_rng(7)
    world = random_world(rng)
    start, turn, shift = nearby(rng, world.faces), 37.0, np.array([300.0, -200.0])
    rotation = np.column_stack([unit(turn), unit(turn + 90)])
    paths = world.observations
    turned = replace(
        paths,
        tx=paths.tx @ rotation.T + shift,
        rx=paths.rx @ rotation.T + shift,
        measured=paths.measured + np.array([0.0, turn]),
    )
    moved = start._replace(normal=start.normal + turn, pivot=start.pivot @ rotation.T + shift)
    given = SurveyStd(0.2, 3.0, 0.15)
    one = adjust(paths, start, len(world.errors), given)
    other = adjust(turned, moved, len(world.errors), given)
    np.testing.assert_allclose(other.faces.offset, one.faces.offset, atol=1e-6)
    np.testing.assert_allclose(other.errors[:, :2], one.errors[:, :2] @ rotation.T, atol=1e-6)
    np.testing.assert_allclose(other.errors[:, 2:], one.errors[:, 2:], atol=1e-6)


def test_position_without_paths_keeps_its_standard_deviations() -> None:
    rng = np.random.default_rng(8)
    world = random_world(rng)
    found = adjust(world.observations, nearby(rng, world.faces), len(world.errors) + 1, SurveyStd(0.2, 3.0, 0.15))
    assert not found.errors[-1].any()
    np.testing.assert_allclose(found.covariance[-1], np.diag([0.2, 0.2, 3.0, 0.15]) ** 2, atol=1e-9)


@pytest.mark.parametrize("common", [False, True])
def test_direct_paths_alone_show_headings(common: bool) -> None:
    rng = np.random.default_rng(9)
    world = random_world(rng, std=(0.0, 3.0, 0.0))
    direct = world.observations.take((world.observations.faces == NO_FACE).all(axis=1))
    none = Faces(np.empty(0), np.empty(0), np.empty((0, 2)))
    found = adjust(direct, none, len(world.errors), SurveyStd(0.0, 3.0, 0.0), common=common)
    assert found.face_common.shape == (0, 2, 2)
    seen = np.unique(direct.position)
    # one azimuth of half a degree each; the largest of 24 is below four standard errors
    np.testing.assert_allclose(found.errors[seen, 2], world.errors[seen, 2], atol=2.0)
    assert common or not found.errors[np.setdiff1d(np.arange(len(world.errors)), seen)].any()


def test_faces_and_headings_follow_a_clock_that_becomes_known() -> None:
    rng = np.random.default_rng(4)
    world = random_world(rng, (0.0, 0.0, 0.0), common=(4.0, 0.8))
    once = (world.observations.faces != NO_FACE).sum(axis=1) == 1
    given = SurveyStd(0.0, 0.0, 0.0)
    found = adjust(world.observations.take(once), world.faces, len(world.errors), given, common=True)
    same, known = found.at_clock(found.common[1], found.clock_std), found.at_clock(0.8, 0.0)
    np.testing.assert_allclose(same.face_covariance, found.face_covariance, atol=1e-12)
    std, before = (np.sqrt(np.einsum("fifi->fi", one.face_covariance))[:, 1] for one in (known, found))
    assert (std < 0.7 * before).all()
    assert (np.abs(known.faces.offset - world.faces.offset) < 3 * std).all()
    assert known.errors[0, 2:] == pytest.approx([4.0, 0.8], abs=4 * np.sqrt(known.common_covariance[0, 0]))
    np.testing.assert_allclose(known.covariance[:, 3, 3], 0.0, atol=1e-9)

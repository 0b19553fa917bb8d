"""The direct path is where geometry says, or the user is told what is not."""

from dataclasses import replace

import numpy as np
import pytest

from sounder.instrument.stated import Survey
from sounder.quality.line_of_sight import DirectPath
from sounder.remark import Code

from .links import RX, SOUNDER, TX, direct, judged, metres, recording

pytestmark = pytest.mark.slow


def codes(remarks) -> set[Code]:
    return {remark.code for remark in remarks}


def test_direct_path_of_known_triangle() -> None:
    path = DirectPath.between(np.array([0.0, 30.0, 41.5]), np.array([40.0, 30.0, 1.5]), 132e9)
    assert path.azimuth == 180.0
    assert path.elevation == pytest.approx(45.0)
    assert path.delay == pytest.approx(metres(40 * np.sqrt(2)))
    assert path.path_gain == pytest.approx(-109.9, abs=0.05)  # 20 log10(2.271 mm / (4 pi 56.57 m))


@pytest.mark.parametrize("seed", range(3))
def test_a_clean_position_is_not_remarked(seed: int) -> None:
    reflection = direct(delay=14e-9, azimuth=-15.0, path_gain=-9.0)
    assert judged(recording(direct(), reflection, seed=seed), seed=seed) == []


@pytest.mark.parametrize(
    ("off", "code", "figure"),
    [
        ({"delay": 10e-9}, Code.LOS_DELAY, 10e-9),
        ({"delay": -5e-9}, Code.LOS_DELAY, -5e-9),  # comes out a period later
        ({"azimuth": 10.0}, Code.LOS_DIRECTION, 10.0),
        ({"path_gain": -12.0}, Code.LOS_LEVEL, -12.0),
        ({"delay": 10e-9, "path_gain": -12.0}, Code.LOS_ABSENT, np.nan),
    ],
)
def test_what_is_wrong_is_told_with_its_figure(off, code, figure) -> None:
    [found] = [remark for remark in judged(recording(direct(**off))) if remark.code is code]
    if np.isfinite(figure):
        assert found.figure == pytest.approx(figure, abs=max(abs(figure) * 0.1, 0.05e-9))


def test_without_line_of_sight_nothing_is_expected() -> None:
    assert judged(recording(direct(azimuth=12.0, path_gain=-15.0, delay=3e-9), los=0)) == []


def test_a_survey_that_is_stated_better_shows_smaller_errors() -> None:
    """15 cm are usual with antennas known to 3 cm each, four deviations; not with 1 cm each."""
    late = direct(delay=metres(0.15))
    assert judged(recording(late)) == []
    surveyed = SOUNDER.model_copy(update={"survey": Survey(position_std=0.01)})
    assert codes(judged(recording(late, sounder=surveyed))) == {Code.LOS_DELAY}


def test_gains_of_the_wrong_scale_are_told_without_line_of_sight() -> None:
    made = recording(direct(azimuth=5.0), los=-1)
    assert judged(made) == []
    assert Code.NOISE_LEVEL in codes(judged(replace(made, scale_factor=made.scale_factor / 10)))
    stated = made.sounder.receiver
    assert stated.noise_figure == 8.0
    assert np.linalg.norm(TX - RX) > 50  # nobody would see the level of a path of unknown length


def test_a_direct_path_is_not_asked_for_where_a_beam_of_its_main_lobe_is_missing() -> None:
    """The path is found 10 degree off, and absent for who does not see that nobody listened where it comes from."""
    made = recording(direct(azimuth=15.0, path_gain=-12.0))
    beam = int(np.argmin(np.abs(made.azimuth - direct()["azimuth"])))
    assert Code.LOS_ABSENT in codes(judged(made))
    valid = np.ones((made.azimuth.size, made.elevation.size), bool)
    valid[beam] = False
    assert not {Code.LOS_ABSENT, Code.LOS_DIRECTION, Code.LOS_LEVEL} & codes(judged(replace(made, valid=valid)))

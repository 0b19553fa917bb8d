"""I and Q of a recording and of its back-to-back belong together."""

from dataclasses import replace

import numpy as np
import pytest

from sounder import calibrate, impulse_responses
from sounder.quality.quadrature import quadrature_evidence, remarks_on_quadrature
from sounder.remark import Code

from .links import connected, direct, judged, recording, reread

pytestmark = pytest.mark.slow

PATHS = direct(), direct(delay=14e-9, azimuth=-15.0, path_gain=-9.0)


def evidence_of(made, seed: int) -> list[float]:
    filter_ = calibrate(connected(seed), made)
    cir, _ = impulse_responses(made, filter_, threads=1)
    return quadrature_evidence(cir["cir"].values, filter_)


def conjugated(captures):
    return np.stack([captures[..., 0], -np.maximum(captures[..., 1], -32767)], axis=-1)


def swapped(captures):
    return captures[..., ::-1].copy()


def q_late(captures):
    return np.stack([captures[..., 0], np.roll(captures[..., 1], 1, axis=1)], axis=-1)


@pytest.mark.parametrize("change", [conjugated, swapped])
def test_an_exchange_is_told_in_a_position_whose_paths_are_resolved(change) -> None:
    made = reread(recording(*PATHS), change)
    assert {remark.code for remark in judged(made)} == {Code.QUADRATURE_EXCHANGED}


def test_a_delay_of_q_is_told_by_positions_together() -> None:
    """Its effect depends on the phase of the carrier: one position tells too little."""
    evidence = [evidence_of(reread(recording(*PATHS, seed=seed), q_late), seed) for seed in range(8)]
    assert not any(remarks_on_quadrature([one]) for one in evidence)
    [remark] = remarks_on_quadrature(evidence)
    assert remark.code is Code.QUADRATURE_DELAYED


def test_the_scale_of_the_captures_tells_nothing() -> None:
    """Squares of the powers of such responses are beyond single precision."""
    made = recording(*PATHS)
    filter_ = calibrate(connected(), made)
    cir = impulse_responses(made, filter_, threads=1)[0]["cir"].values
    assert np.allclose(quadrature_evidence(cir * 1e-11, filter_), quadrature_evidence(cir, filter_), rtol=1e-3)


def test_positions_that_disagree_tell_nothing() -> None:
    assert remarks_on_quadrature([[5.0, 0.0, 0.0], [5.0, 0.0, 0.0], [-9.0, 0.0, 0.0]]) == []


def test_a_changed_back_to_back_is_told_but_not_if_both_are() -> None:
    made, b2b = recording(*PATHS), connected()
    other = replace(b2b, captures=swapped(b2b.captures))
    assert Code.QUADRATURE_EXCHANGED in {remark.code for remark in judged(made, other)}
    assert judged(reread(made, swapped), other) == []

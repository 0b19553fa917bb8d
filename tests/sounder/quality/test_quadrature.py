"""I and Q of a recording and of its back-to-back belong together."""

from dataclasses import replace

import numpy as np
import pytest

from sounder.remark import Code

from .links import connected, direct, judged, recording, reread

pytestmark = pytest.mark.slow

PATHS = direct(), direct(delay=14e-9, azimuth=-15.0, path_gain=-9.0)


def conjugated(captures):
    return np.stack([captures[..., 0], -np.maximum(captures[..., 1], -32767)], axis=-1)


def swapped(captures):
    return captures[..., ::-1].copy()


def q_late(captures):
    return np.stack([captures[..., 0], np.roll(captures[..., 1], 1, axis=1)], axis=-1)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("change", "code"),
    [
        (conjugated, Code.QUADRATURE_EXCHANGED),
        (swapped, Code.QUADRATURE_EXCHANGED),
        (q_late, Code.QUADRATURE_DELAYED),
    ],
)
def test_a_changed_recording_is_told(change, code: Code, seed: int) -> None:
    made = reread(recording(*PATHS, seed=seed), change)
    assert code in {remark.code for remark in judged(made, seed=seed)}


def test_a_changed_back_to_back_is_told_but_not_if_both_are() -> None:
    made, b2b = recording(*PATHS), connected()
    other = replace(b2b, captures=swapped(b2b.captures))
    assert Code.QUADRATURE_EXCHANGED in {remark.code for remark in judged(made, other)}
    assert judged(reread(made, swapped), other) == []

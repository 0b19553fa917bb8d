"""Snapshots of a direction against each other."""

import numpy as np

from sounder.quality.snapshots import compare_snapshots


def test_noise_alone_has_no_shift_however_loud():
    rng = np.random.default_rng(3)
    for level in (1.0, 1e4):
        responses = np.sqrt(level / 2) * rng.normal(size=(4, 1022, 2)) @ [1, 1j]
        found = compare_snapshots(responses, 1.0)
        assert not found.shift.any()
        assert found.good.all()

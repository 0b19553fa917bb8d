"""A map without reflectors says how many MPCs there were, and what became of those that agreed best."""

import numpy as np
import xarray as xr

from erm.mpcs.reasons import Reason
from erm.reconstruction.summary import explain_unused


def test_the_largest_common_image_and_what_speaks_against_it_are_told():
    reason = [Reason.DIRECT_PATH] + 4 * [Reason.FALSE_ALARM] + [Reason.MEAN_ELEVATION] + 2 * [Reason.NOT_SHARED]
    located = xr.Dataset(
        {
            "reason": ("mpc", np.array(reason, dtype=np.str_)),
            "accepted": ("mpc", np.zeros(8, dtype=bool)),
            "image": ("mpc", np.array([-1, 0, 0, 1, 1, 1, -1, -1])),
            "link": ("mpc", np.array([0, 0, 1, 0, 1, 2, 2, 3])),
        }
    )
    assert explain_unused(located)[1] == (
        "no reflector: 7 of 8 MPCs of 4 antenna pairs may be single reflections; of 2 common images the largest has "
        "3 of them: no more paths agree on its wall than by chance (2), mean elevation inconsistent with a vertical "
        "wall (1)"
    )
    assert len(explain_unused(located.assign(accepted=located["accepted"] | (located["image"] == 1)))) == 1

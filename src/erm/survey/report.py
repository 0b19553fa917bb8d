"""What a calibration found, and what contradicts it, for people and for the attributes of a map."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from erm.common.console import counted
from erm.common.constants import SAME_DELAY, c
from erm.mpcs.reasons import Reason
from erm.mpcs.standard_errors import SIGMAS
from erm.survey.calibration import NAMES, Calibration
from erm.survey.conventions import Cause

if TYPE_CHECKING:
    import xarray as xr

    from erm.maps.environment import Environment

LOUD_SHARE = 0.1
"""Share of MPCs above free space that is told: two paths in one cell are rarely more; chosen."""
SHOWN = {"heading": (1.0, "degrees"), "clock": (1e9, "ns"), "gain": (1.0, "dB")}
"""Factor and unit of each common error, for people."""


def attributes(
    calibration: Calibration, causes: Sequence[Cause], located: "xr.Dataset", *, as_given: bool
) -> dict[str, str | float]:
    """Attributes of a map about its survey.

    Parameters
    ----------
    calibration : Calibration
        From `erm.survey.calibration.calibrate`.
    causes : sequence of Cause
        From `erm.survey.conventions.contradictions`.
    located : xarray.Dataset
        Table of `erm.mpcs.selection.select`.
    as_given : bool
        Whether the table was used without calibration.

    Returns
    -------
    dict
        ``calibration``: one line. ``survey_warnings``: a JSON list of lines. ``heading``, ``clock``, ``gain`` with
        ``_std``: the estimates, measured minus true [degree], [s], [dB]. ``ambiguous``: names of those that the data do
        not show.
    """
    lines = _large(calibration, as_given=as_given) + [_cause(one) for one in causes] + remarks(located, calibration)
    values: dict[str, str | float] = {
        "calibration": calibration_line(calibration, as_given=as_given),
        "survey_warnings": json.dumps(lines),
        "ambiguous": " ".join(calibration.ambiguous),
    }
    for name in NAMES:
        values[name] = float(getattr(calibration, name))
        values[f"{name}_std"] = calibration.std(name)
    return values


def warnings(environment: "Environment") -> list[str]:
    """Lines about what contradicts, from the attributes of a map."""
    return list(json.loads(environment.reflectors.attrs.get("survey_warnings", "[]")))


def remarks(located: "xr.Dataset", calibration: Calibration) -> list[str]:
    """Lines about MPCs that contradict the places of the antennas or the frequency, even after calibration.

    Parameters
    ----------
    located : xarray.Dataset
        Table of `erm.mpcs.selection.select`.
    calibration : Calibration
        Of the table.
    """
    lines = _not_shown(located, calibration)
    distance = np.linalg.norm(located["tx_position"].values - located["rx_position"].values, axis=-1)
    std = np.hypot(located["delay_std"].values, calibration.spreads["clock"])
    std = np.hypot(std, calibration.remaining["clock"])
    short = located["delay"].values < distance / c - np.maximum(SAME_DELAY, SIGMAS * std)
    if short.any():
        at = int(np.argmax(short))
        early = distance[at] / c - located["delay"].values[at]
        lines.append(
            f"warning: {short.sum()} of {len(short)} MPCs arrive before the direct path could, by more than their "
            f"errors, the first at {located['position'].values[at]} by {early * 1e9:.2g} ns: not used"
        )
    carriers, rows = np.unique([f"{value / 1e9:.4g} GHz" for value in located["frequency"].values], return_inverse=True)
    if len(carriers) > 1:
        counts = [np.unique(located["position"].values[rows == k]).size for k in range(len(carriers))]
        each = ", ".join(f"{carrier} ({counted(n, 'position')})" for carrier, n in zip(carriers, counts, strict=True))
        lines.append(
            f"warning: MPCs of {len(carriers)} carriers are on one map: {each}; its losses, its materials and the "
            "calibration of the gain are those of a mixture; make a map of each carrier"
        )
    loud = located["reason"].values == Reason.ABOVE_FREE_SPACE
    if loud.sum() > LOUD_SHARE * len(loud):
        lines.append(
            f"warning: {loud.sum()} of {len(loud)} MPCs are stronger than free space and not used; an offset of all "
            f"gains of {calibration.gain:.0f} dB would explain it"
        )
    return lines


def _not_shown(located: "xr.Dataset", calibration: Calibration) -> list[str]:
    """A line about a clock that nothing shows, and what it does to the map."""
    # one image shows neither heading nor clock, whoever measured it: the calibration says so
    if "clock" not in calibration.ambiguous or "adjusted_clock" not in located.attrs or calibration.images < 2:
        return []
    return [
        f"warning: neither direct paths nor chains of reflections show the common error of the clock, "
        f"{_shown(calibration, 'clock')}: all paths may be too long or too short by "
        f"{calibration.std('clock') * c:.2f} m, and walls move with them, as their standard errors tell"
    ]


def calibration_line(calibration: Calibration, *, as_given: bool = False) -> str:
    """One line about the common errors.

    Examples
    --------
    >>> import numpy as np
    >>> from erm.survey.calibration import Calibration
    >>> covariance = np.diag([0.1, 2e-11, 0.2]) ** 2
    >>> found = Calibration(5.1, 1e-11, -0.1, covariance, ambiguous=(), direct_paths=12, images=3)
    >>> calibration_line(found).split("; ")[::3]
    ['calibration: heading 5.10 ± 0.10 degrees removed', 'from 12 direct paths and 3 mirror images']
    """
    parts = []
    for name in NAMES:
        removed = " removed" if calibration.applied[name] and not as_given else ""
        unknown = " (not observable)" if name in calibration.ambiguous else ""
        parts.append(f"{name} {_shown(calibration, name)}{unknown}{removed}")
    paths, images = (counted(calibration.direct_paths, "direct path"), counted(calibration.images, "mirror image"))
    parts.append(f"from {paths} and {images}")
    return "calibration: " + "; ".join(parts)


def _large(calibration: Calibration, *, as_given: bool) -> list[str]:
    """A line for each error beyond three standard errors."""
    done = "kept, as asked" if as_given else "removed; --as-given keeps it"
    return [
        f"warning: the common error of {name} is {_shown(calibration, name)}, beyond {SIGMAS:g} standard errors: {done}"
        for name in calibration.significant
    ]


def _cause(cause: Cause) -> str:
    return f"warning: the table may hold {cause.text}"


def _shown(calibration: Calibration, name: str) -> str:
    factor, unit = SHOWN[name]
    return f"{getattr(calibration, name) * factor:z.2f} ± {calibration.std(name) * factor:.2f} {unit}"

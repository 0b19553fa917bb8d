"""DAPS and PDP of a position, reduced to what a screen shows."""

import base64
from io import BytesIO
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.image import imsave

from sounder.figures.products import (
    DYNAMIC_RANGE,
    POWER_MAP,
    VISIBLE_SNR,
    elevations_shown,
    last_visible_delay,
    strongest_elevation,
)
from sounder.parameters.selection import extraction_margin
from sounder.report.numbers import rounded

MAX_CELLS = 12_288
"""Most cells of a DAPS on the page: 10 kB of text each, 7 MB for 700 positions. Chosen."""
MAX_BINS = 512
"""Most delay bins of a PDP on the page: more than a chart has pixels on a phone. Chosen."""


def reduce_daps(daps: xr.Dataset) -> dict[str, Any]:
    """DAPS over azimuth and delay as a picture; the strongest elevation and delay of a cell.

    Returns
    -------
    dict
        ``azimuth`` [degree]; ``first`` and ``step`` of the delay [ns]; ``bins``; ``low`` and ``high`` [dB], the power
        of the darkest and the brightest colour; ``picture``, a PNG in base64 with a pixel for each delay and azimuth,
        the first azimuth lowest, transparent where there is no power; ``elevations``, in words.
    """
    shown = daps.isel(delay=np.flatnonzero(daps["delay"].values <= last_visible_delay(daps))).sortby("azimuth")
    most = max(MAX_CELLS // max(shown.sizes["azimuth"], 1), 1)
    power = _strongest(strongest_elevation(shown).transpose("azimuth", "delay").values, most)
    known = power[np.isfinite(power)]
    high = float(known.max()) if known.size else 0.0
    floor = float(daps["noise_floor"].median())
    low = np.fmax(high - DYNAMIC_RANGE, min(floor + VISIBLE_SNR, high))
    picture = BytesIO()
    seen = np.ma.masked_less(power, low)
    imsave(picture, seen, vmin=low, vmax=max(high, low + 1e-9), cmap=POWER_MAP, origin="lower", format="png")
    return {
        "azimuth": rounded(shown["azimuth"].values, 2),
        **_delays(shown, power.shape[1]),
        "low": round(low, 1),
        "high": round(high, 1),
        "picture": base64.b64encode(picture.getvalue()).decode("ascii"),
        "elevations": elevations_shown(daps),
    }


def reduce_pdp(daps: xr.Dataset, mpcs: xr.Dataset) -> dict[str, Any]:
    """Omnidirectional PDP, the noise floor of the beams without the boresight gain, and the least power of an MPC.

    Returns
    -------
    dict
        ``first`` and ``step`` of the delay [ns]; ``bins``; ``power`` [dB] of each; ``made``, how, in words; ``floor``
        and ``threshold`` [dB], None if not known.
    """
    shown = daps.isel(delay=np.flatnonzero(daps["delay"].values <= last_visible_delay(daps)))
    power = _strongest(shown["pdp"].values[None].astype(float), MAX_BINS)[0]
    floor = float(daps["noise_floor"].median()) - float(daps.attrs.get("rx_antenna_gain", 0.0))
    return {
        **_delays(shown, power.size),
        "power": rounded(power, 1),
        "made": str(daps["pdp"].attrs.get("long_name", "")).rpartition(": ")[2],
        "floor": rounded(floor, 1),
        "threshold": rounded(floor + extraction_margin(mpcs), 1),
    }


def _strongest(power: Any, most: int) -> Any:
    """Power (row, delay) of groups of neighbouring delays: the strongest of each; missing cells are -inf."""
    group = -(-power.shape[1] // most)
    padded = np.full((power.shape[0], -(-power.shape[1] // group) * group), -np.inf)
    padded[:, : power.shape[1]] = np.where(np.isnan(power), -np.inf, power)
    return padded.reshape(power.shape[0], -1, group).max(axis=-1)


def _delays(shown: xr.Dataset, bins: int) -> dict[str, Any]:
    """First delay and step [ns] of groups of delays, and their number."""
    delay = shown["delay"].values * 1e9
    step = float(delay[1] - delay[0]) if delay.size > 1 else 1.0
    group = -(-delay.size // bins)
    return {"first": round(float(delay[0] + (group - 1) * step / 2), 4), "step": round(group * step, 6), "bins": bins}

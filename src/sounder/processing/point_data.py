"""Point data: the table of a campaign with the columns by which groups merge theirs, one row a TX-RX pair.

Source: D. Shakya et al., Standardized machine-readable point-data format for consolidating wireless propagation across
environments, frequencies, and institutions, IEEE MILCOM 2025, 232-237; columns as in its table of NYU's campaign.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.storage import open_group
from sounder.cir.false_alarm import noise_margin
from sounder.options import Threshold
from sounder.parameters.delay import rms_delay_spread
from sounder.parameters.lobes import mean_lobe_spreads
from sounder.parameters.statistics import LINES_OF_SIGHT
from sounder.processing.parameter_tables import write_csv

OMNIDIRECTIONAL = {
    "PL": ("path_loss", 1.0),
    "Omni DS": ("rms_delay_spread", 1e9),
    "Omni ASA": ("azimuth_spread_arrival", 1.0),
    "Omni ASD": ("azimuth_spread_departure", 1.0),
    "Omni ZSA": ("zenith_spread_arrival", 1.0),
    "Omni ZSD": ("zenith_spread_departure", 1.0),
}
"""Columns of the format, the parameter of each, and the factor to its unit (dB, ns, degree)."""
COLUMNS = (
    "Freq.", "TX", "RX", "Loc Type", "TR Sep", "PL", "Mean Dir DS", "Omni DS", "Mean Lobe ASA", "Omni ASA",
    "Mean Lobe ASD", "Omni ASD", "Mean Lobe ZSA", "Omni ZSA", "Mean Lobe ZSD", "Omni ZSD",
)  # fmt: skip
"""Columns of the format, in its order [GHz, m, dB, ns, degree]; blank where not known."""
LOCATION_TYPES = {"LoS": "LOS", "NLoS": "NLOS", "unknown": ""}
DIRECTIONAL_THRESHOLD = Threshold(12.0)
"""Threshold of the PDP of a direction, for its delay spread, where none is given."""

Real = NDArray[np.float64]


def write_point_data(
    parameters: xr.Dataset, path: Path, *, products: Sequence[Path] = (), threshold: str | Threshold | None = None
) -> None:
    """Write the point data of a campaign.

    After the columns of the format come ours: names and places of the antennas, standard deviations of the
    omnidirectional values, how paths were selected, and file, checksum and software.

    Parameters
    ----------
    parameters : xarray.Dataset
        From :func:`sounder.channel_parameters`.
    path : Path
    products : sequence of Path
        Products of which some parameters are, for the mean delay spread of directions.
    threshold : str or Threshold, optional
        Of the PDPs of directions.
    """
    chosen = DIRECTIONAL_THRESHOLD if threshold is None else Threshold.of(threshold)
    directional = _directional(products, chosen)
    rows = [_row(parameters.isel(position=i), directional) for i in range(parameters.sizes["position"])]
    transmitters = list(dict.fromkeys(tuple(place) for place in parameters["tx_position"].values.round(3).tolist()))
    for row, place in zip(rows, parameters["tx_position"].values.round(3).tolist(), strict=True):
        row["TX"] = f"TX{transmitters.index(tuple(place)) + 1}"
    header = [*COLUMNS, *(name for name in rows[0] if name not in COLUMNS)]
    write_csv(path, header, ([row.get(name, "") for name in header] for row in rows))


def mean_directional_delay_spread(daps: xr.Dataset, threshold: Threshold) -> float:
    """Mean over directions of the RMS delay spread of their PDPs; of those with a sample over the threshold.

    Parameters
    ----------
    daps : xarray.Dataset
        Group ``/daps`` of a product.
    threshold : Threshold
        Noise margin over the noise floor of the direction; dynamic range under its own strongest sample.

    Returns
    -------
    float
        [s]; NaN if no direction has a sample over the threshold.

    Examples
    --------
    >>> beam = np.array([[[-100.0, -150.0, -100.0]]])
    >>> floor = (("azimuth", "elevation"), [[-150.0]])
    >>> daps = xr.Dataset({"daps": (("azimuth", "elevation", "delay"), beam), "noise_floor": floor})
    >>> print(mean_directional_delay_spread(daps.assign_coords(delay=[0.0, 1e-9, 2e-9]), Threshold(12.0)))
    1e-09
    """
    beams = daps["daps"].values.astype(float)
    margin = noise_margin(threshold, beams.size, beams.shape[-1])
    least = daps["noise_floor"].values[..., None] + margin
    least = np.maximum(least, np.max(beams, axis=-1, keepdims=True) - threshold.dynamic_range)
    delay = daps["delay"].values
    counts = (beams >= least) & (delay <= threshold.delay_gate) & np.isfinite(beams)
    spreads = rms_delay_spread(delay, np.where(counts, 10 ** (beams / 10), 0))
    return float(np.nanmean(spreads)) if np.isfinite(spreads).any() else float("nan")


def _directional(products: Sequence[Path], threshold: Threshold) -> Mapping[str, Mapping[str, float]]:
    """Columns of each product that are made from its directions, by its file."""
    columns = {}
    for product in products:
        try:
            daps = open_group(product, "/daps")
        except DataError:  # a table of MPCs has no directions
            continue
        arrival = mean_lobe_spreads(daps["azimuth"].values, daps["elevation"].values, daps["pas"].values)
        columns[product.name] = {
            "Mean Dir DS": 1e9 * mean_directional_delay_spread(daps, threshold),
            "Mean Lobe ASA": arrival[0],
            "Mean Lobe ZSA": arrival[1],
        }
    return columns


def _row(one: xr.Dataset, directional: Mapping[str, Mapping[str, float]]) -> dict[str, object]:
    name = str(one["position"].item())
    row: dict[str, object] = dict.fromkeys(COLUMNS, "")
    row |= {
        "Freq.": f"{float(one['frequency']) / 1e9:.12g}",
        "RX": name,
        "Loc Type": LOCATION_TYPES[LINES_OF_SIGHT[int(one["los"])]],
        "TR Sep": float(one["distance"]),
    }
    row |= directional.get(str(one["file"].item()), {})
    for column, (parameter, scale) in OMNIDIRECTIONAL.items():
        row[column] = scale * float(one[parameter])
    for column, (parameter, scale) in OMNIDIRECTIONAL.items():
        if f"{parameter}_std" in one:
            row[f"{column} std"] = scale * float(one[f"{parameter}_std"])
    for end in ("tx", "rx"):
        row |= {f"{end}_{axis}": float(value) for axis, value in zip("xyz", one[f"{end}_position"].values, strict=True)}
    texts = ("source", "threshold", "noise", "antennas", "file", "sha256", "software")
    return row | {"Angular spread": "TR 38.901 A-1"} | {text: str(one[text].item()) for text in texts}

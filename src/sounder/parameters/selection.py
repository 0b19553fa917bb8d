"""Which paths count: MPCs of a product or samples of a PDP, over a threshold. Every parameter is of these."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from sounder.cir.false_alarm import noise_margin
from sounder.options import Source, Threshold

PDP_QUANTILE = 0.25
"""Quantile of a PDP over delay that is taken as its noise: at most delays there are no paths. Chosen, not derived."""
PDP_THRESHOLD = Threshold(12.0)
"""Threshold of a PDP unless another is given."""


@dataclass(frozen=True)
class Selection:
    """Paths that count, and in words how they were chosen.

    Attributes
    ----------
    paths : xarray.Dataset
        Along ``mpc``: ``delay``, ``azimuth``, ``elevation``, ``path_gain``, and what is known of their errors.
    source : {"mpcs", "pdp"}
    threshold : str
        In words.
    noise : str
        What was done about noise, in words.
    antennas : str
        Whether antennas are removed, in words.
    """

    paths: xr.Dataset
    source: Source
    threshold: str
    noise: str
    antennas: str

    @property
    def definition(self) -> str:
        """All in one line."""
        origin = {"mpcs": "MPCs", "pdp": "samples of the PDP"}[self.source]
        return f"from {origin}; threshold: {self.threshold}; noise: {self.noise}; antennas: {self.antennas}"


def select_mpcs(mpcs: xr.Dataset, threshold: Threshold | None = None) -> Selection:
    """MPCs over a threshold; without one, all.

    The noise margin is compared with ``snr``, the dynamic range with the strongest path gain, and the gate with the
    delay. MPCs under the threshold of their extraction cannot come back.

    Parameters
    ----------
    mpcs : xarray.Dataset
        From :func:`sounder.extract_mpcs`, or a table of MPCs without ``snr``, which is then not compared.
    threshold : Threshold, optional

    Examples
    --------
    >>> mpcs = xr.Dataset({"delay": ("mpc", [1e-7, 2e-7]), "path_gain": ("mpc", [-100.0, -126.0])})
    >>> selection = select_mpcs(mpcs, Threshold(0.0, dynamic_range=25.0))
    >>> selection.paths.sizes["mpc"], selection.threshold
    (1, '25 dB under the strongest; of MPCs extracted with a threshold that the table does not say')
    """
    gain = mpcs["path_gain"].values
    known = np.isfinite(gain)
    extraction = f"MPCs extracted with {describe(mpcs.attrs.get('threshold'))}"
    if threshold is None:
        text = extraction
    else:
        known &= gain >= np.max(gain, where=np.isfinite(gain), initial=-np.inf) - threshold.dynamic_range
        known &= mpcs["delay"].values <= threshold.delay_gate
        if threshold.noise_margin is None and "independent_samples" in mpcs.attrs:
            margin = noise_margin(threshold, mpcs.attrs["samples"], mpcs.attrs["independent_samples"])
        else:
            margin = threshold.noise_margin or 0.0
        if "snr" in mpcs:
            known &= mpcs["snr"].values >= margin
        margin = margin if "snr" in mpcs else 0.0
        text = f"{describe(Threshold(margin, threshold.dynamic_range, threshold.delay_gate))}; of {extraction}"
    return Selection(mpcs.isel(mpc=np.flatnonzero(known)), "mpcs", text, "no noise in MPCs", "removed")


def extraction_margin(mpcs: xr.Dataset) -> float:
    """Least power over the noise floor of a beam by which MPCs of a product were found [dB]; NaN if not known."""
    attributes = mpcs.attrs
    if "threshold" not in attributes:
        return float("nan")
    threshold = Threshold.of(attributes["threshold"])
    if threshold.noise_margin is not None:
        return threshold.noise_margin
    if "independent_samples" not in attributes:
        return float("nan")
    return noise_margin(threshold, attributes["samples"], attributes["independent_samples"])


def select_pdp(daps: xr.Dataset, threshold: Threshold | None = None) -> Selection:
    """Samples of an omnidirectional PDP over a threshold, as paths without directions.

    A sample of power ``P`` in noise ``N`` has the standard deviation ``sqrt(2 P N)``, of one receiver; a sum of beams
    varies less. The width of the pulse is part of all spreads.

    Parameters
    ----------
    daps : xarray.Dataset
        Group ``/daps`` of a product.
    threshold : Threshold, optional
        Default: :data:`PDP_THRESHOLD`. Noise is the lower quartile of the PDP over delay.

    Examples
    --------
    >>> power = np.array([-150.0, -150.0, -100.0, -110.0, -150.0])
    >>> daps = xr.Dataset({"pdp": ("delay", power)}, {"delay": 1e-9 * np.arange(5)})
    >>> daps = daps.assign_attrs(omnidirectional="sum", pulse_energy=1.0)
    >>> select_pdp(daps).paths["path_gain"].values.tolist()
    [-100.0, -110.0]
    """
    threshold = threshold or PDP_THRESHOLD
    made = str(daps.attrs.get("omnidirectional", "unknown"))
    pdp, delay = daps["pdp"].values.astype(float), daps["delay"].values
    noise = float(np.quantile(pdp[~np.isnan(pdp)], PDP_QUANTILE, method="lower")) if np.isfinite(pdp).any() else -np.inf
    noise = -np.inf if made == "synthesis" else noise
    margin = noise_margin(threshold, pdp.size, pdp.size)
    over = (pdp >= max(noise + margin, np.max(pdp, initial=-np.inf) - threshold.dynamic_range)) & (
        np.isfinite(pdp) & (delay <= threshold.delay_gate)
    )
    gain = pdp[over] - 10 * np.log10(daps.attrs["pulse_energy"])
    std = 10 / np.log(10) * np.sqrt(2 * 10 ** ((noise - pdp[over]) / 10))
    unknown = np.full(gain.shape, np.nan)
    paths = xr.Dataset(
        {
            "delay": ("mpc", delay[over]),
            "azimuth": ("mpc", unknown),
            "elevation": ("mpc", unknown),
            "path_gain": ("mpc", gain),
            "path_gain_std": ("mpc", std),
        }
    )
    removed = {
        "synthesis": "removed",
        "sum": "overlap of the beams removed, in the mean over the scan",
        "maximum": "boresight gain removed",
    }
    zeroed = "samples under the threshold count as zero" if np.isfinite(noise) else "none in a synthesis"
    return Selection(paths, "pdp", describe(threshold), zeroed, f"{removed.get(made, 'unknown')} (PDP: {made})")


def describe(threshold: "str | Threshold | None") -> str:
    """Threshold in words."""
    if threshold is None:
        return "a threshold that the table does not say"
    threshold = Threshold.of(threshold)
    parts = [f"{threshold.noise_margin:.3g} dB over noise"] if threshold.noise_margin else []
    if threshold.noise_margin is None:
        parts = [f"at most {threshold.false_alarms:g} false MPCs a position by noise"]
    if np.isfinite(threshold.dynamic_range):
        parts.append(f"{threshold.dynamic_range:g} dB under the strongest")
    if np.isfinite(threshold.delay_gate):
        parts.append(f"delays up to {threshold.delay_gate * 1e9:g} ns")
    return ", ".join(parts) or "none"

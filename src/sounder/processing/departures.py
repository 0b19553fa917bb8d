"""Checked responses of a position: one scan of the receive antenna for each beam of the transmit antenna."""

import numpy as np
import xarray as xr

from sounder.cir.deembedding import Deembedding
from sounder.cir.impulse_response import impulse_responses
from sounder.options import Options
from sounder.quality.check import check_responses
from sounder.quality.quadrature import quadrature_evidence, remarks_on_quadrature
from sounder.recordings.recording import Recording
from sounder.remark import Remark

TX_AXES = {
    "tx_azimuth": {"units": "degree", "long_name": "azimuth of the transmit antenna, counter-clockwise from east"},
    "tx_elevation": {"units": "degree", "long_name": "elevation of the transmit antenna above the horizon"},
}


def checked_responses(
    recording: Recording, filter_: Deembedding, options: Options, *, threads: int | None = None
) -> tuple[xr.Dataset, list[Remark]]:
    """Impulse responses of a position, and what is wrong with them.

    With several beams of the transmit antenna, directions that are zero, not finite or clipped are left out. Beams are
    not compared with their neighbours and with the receiver's noise: most are seen by the sidelobes of the transmit
    antenna only, of which a pattern holds no more than a level.

    Parameters
    ----------
    recording : Recording
    filter_ : Deembedding
    options : Options
    threads : int, optional
        As for :func:`sounder.impulse_responses`.

    Returns
    -------
    cir : xarray.Dataset
        From :func:`sounder.quality.check.check_responses`. Where the transmit antenna has several beams, its variables
        have the axes ``tx_azimuth`` and ``tx_elevation`` before those of the receive antenna. Attribute ``evidence``:
        that of :func:`sounder.quality.quadrature.quadrature_evidence`, the mean over the scans, which see the same
        paths; empty where captures are responses.
    remarks : list of Remark
        Each once, whichever beam it is of.

    Raises
    ------
    DataError
        No direction of the scan with one of the beams can be used.
    """
    scans: list[xr.Dataset] = []
    remarks: dict[Remark, None] = {}
    for scan in recording.departures:
        cir, found = impulse_responses(scan, filter_, averaging=options.averaging, threads=threads)
        if recording.of_departure is None:
            cir, found = check_responses(cir, scan, filter_, found, trust_all=options.trust_all)
        scans.append(cir)
        remarks |= dict.fromkeys(found)
    evidence: list[float] = []
    if recording.kind == "iq":  # others have no converters
        evidence = np.mean([quadrature_evidence(cir["cir"].values, filter_) for cir in scans], axis=0).tolist()
        remarks |= dict.fromkeys(remarks_on_quadrature([evidence]))
    if recording.of_departure is None:
        return scans[0].assign_attrs(evidence=evidence), list(remarks)
    angles = {axis: (axis, getattr(recording, axis), attrs) for axis, attrs in TX_AXES.items()}
    shape = {axis: values[1].size for axis, values in angles.items()}
    joined = {
        name: (
            (*shape, *variable.dims),
            np.stack([cir[name].values for cir in scans]).reshape(*shape.values(), *variable.shape),
            variable.attrs,
        )
        for name, variable in scans[0].data_vars.items()
    }
    attrs = scans[0].attrs | {"drift_std": 0.0, "evidence": evidence}
    return xr.Dataset(joined, {**angles, **scans[0].coords}, attrs), list(remarks)

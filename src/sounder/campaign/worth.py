"""What a recording is worth, in one line: whether it must be measured again while the sounder stands there."""

from pathlib import Path

import numpy as np
import xarray as xr

from erm.common.console import counted
from erm.common.constants import c
from erm.common.storage import open_groups
from erm.geometry.vertical import azimuth_of
from sounder.parameters.path_loss import free_space_path_loss
from sounder.quality.table import read_remarks
from sounder.remark import lines


def worth(product: Path) -> str:
    """One line about a product: MPCs, SNR, direct path against geometry, remarks.

    Examples
    --------
    >>> from pathlib import Path
    >>> import sounder, tempfile
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> jobs, failures = sounder.gather(recordings, calibration=b2b)
    >>> print(worth(sounder.process(jobs, tempfile.mkdtemp()).products[0]).partition(";")[0])
    synthetic-two-paths: 2 MPCs, SNR 61 dB
    """
    root, mpc, quality = open_groups(product, "/", "/mpc", "/quality")
    name, count = str(root["position"].item()), mpc.sizes["mpc"]
    snr = f", SNR {mpc['snr'].values.max():.0f} dB" if count else ""
    parts = [f"{name}: {counted(count, 'MPC')}{snr}", _direct_path(root, mpc)]
    remarks, recorded = read_remarks(quality), int(root.attrs["recorded_directions"])
    found = [line for failures in (True, False) for line in lines(remarks, recorded, failures=failures)]
    return "; ".join([*filter(None, parts), *(found or ["no remarks"])])


def _direct_path(root: xr.Dataset, mpc: xr.Dataset) -> str:
    """MPC nearest to the direct path in delay: its delay, azimuth and gain less those of geometry and free space."""
    if int(root.attrs["los"]) == 0:
        return "direct path obstructed"
    if not mpc.sizes["mpc"]:
        return "no direct path"
    vector = root["tx_position"].values[0] - root["rx_position"].values[0]
    distance = float(np.linalg.norm(vector))
    nearest = mpc.isel(mpc=int(np.argmin(np.abs(mpc["delay"].values - distance / c))))
    gain = float(nearest["path_gain"] + free_space_path_loss(distance, float(root.attrs["frequency"])))
    azimuth = (float(nearest["azimuth"] - azimuth_of(vector[:2])) + 180) % 360 - 180
    late = (float(nearest["delay"]) - distance / c) * 1e9
    return f"direct path {late:+.2f} ns, {azimuth:+.1f} degrees, {gain:+.1f} dB against geometry"

"""A small link of the twin: one path, a few directions."""

from dataclasses import replace

import numpy as np
import xarray as xr

from erm.common.constants import c
from sounder import Options, Recording, calibrate, load_sounder, shipped
from sounder.processing.position import process_recording
from sounder.quality.calibration import check_back_to_back
from sounder.quality.line_of_sight import DirectPath
from sounder.remark import Remark
from sounder.twin.faults import Faults
from sounder.twin.receiver import back_to_back, record

_FULL = load_sounder(shipped.calibration("sounder-132ghz.toml"))
SOUNDER = _FULL.model_copy(update={"scan": _FULL.scan.model_copy(update={"azimuth": (0.0, 10.0, 20.0, 30.0, 40.0)})})
TX, RX = np.array([50.0, 20.0, 4.0]), np.array([0.0, 0.0, 1.5])


def direct(**off) -> dict[str, float]:
    """The direct path from TX to RX; keyword arguments are added to it."""
    path = DirectPath.between(TX, RX, SOUNDER.carrier.frequency)
    return {name: getattr(path, name) + off.get(name, 0.0) for name in ("delay", "azimuth", "elevation", "path_gain")}


def recording(*paths: dict[str, float], seed: int = 0, los: int = 1, sounder=SOUNDER) -> Recording:
    """Record paths with the faults of an ordinary instrument."""
    rng = np.random.default_rng(seed)
    table = {name: ("path", [path[name] for path in paths]) for name in ("delay", "azimuth", "elevation")}
    amplitude = 10 ** (np.array([path["path_gain"] for path in paths]) / 20)
    table["coefficient"] = ("path", amplitude * np.exp(2j * np.pi * rng.random(len(paths))))
    return record(
        xr.Dataset(table),
        sounder,
        name=f"RX{seed}",
        tx_position=TX,
        rx_position=RX,
        snapshots=4,
        los=los,
        faults=faults(seed),
        seed=seed,
    )


def faults(seed: int) -> Faults:
    """Faults of one of many instruments."""
    return Faults(system_response={"seed": seed})


def connected(seed: int = 0, attenuation: float = 60.0):
    """Back-to-back recording of the same instrument."""
    return back_to_back(SOUNDER, attenuation, faults=faults(seed), seed=seed)


def judged(made: Recording, b2b=None, seed: int = 0) -> list[Remark]:
    """Remarks on a recording, with a clean back-to-back unless another is given."""
    checked = check_back_to_back(connected(seed) if b2b is None else b2b, made.sounder)
    filter_ = calibrate(checked.usable, made)
    return process_recording(made, filter_, Options(), threads=1, of_calibration=checked.remarks)[1]


def reread(made: Recording, change) -> Recording:
    """A recording whose captures are changed when they are read."""
    return replace(made, read=lambda a, e, which: change(made.read(a, e, which)))


def metres(length: float) -> float:
    """Delay of a length."""
    return length / c

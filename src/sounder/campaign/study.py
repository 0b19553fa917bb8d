"""Simulated captures for the study of the letter, processed in memory; see `erm.letter.captures.Captures`."""

from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr
from matplotlib.projections.polar import PolarAxes
from numpy.typing import ArrayLike

from erm.letter.captures import UNCHANGED, Campaign, Change, Link, Measured
from erm.mpcs.table import columns_of_product, empty_table, make_table
from erm.tracing.trace import trace
from sounder import shipped
from sounder.cir.impulse_response import calibrate
from sounder.figures.products import daps_polar
from sounder.instrument.description import Sounder
from sounder.instrument.waveform import PRIMITIVE_POLYNOMIALS
from sounder.options import Options
from sounder.processing.position import process_recording
from sounder.twin.receiver import record
from sounder.twin.scene import Scene, load_scene
from sounder.twin.simulate import back_to_back_of, environment_of

NOMINAL_ATTENUATION = 60.0
"""Loss of the attenuator in the back-to-back [dB]: the nominal value of the shipped one, outside its measured band."""


def campaign(scene: str) -> Campaign:
    """Campaign of a shipped scene, given the name of its file without suffix."""
    loaded = load_scene(shipped.scene(f"{scene}.toml"))
    return Campaign(
        name=loaded.name,
        environment=environment_of(loaded),
        links=tuple(Link(one.name, loaded.transmitters[one.tx], one.position) for one in loaded.receivers),
        frequency=loaded.sounder.carrier.frequency,
        max_order=loaded.max_order,
        parameters=_parameters(loaded),
        instrument=loaded,
    )


def measure(campaign: Campaign, change: Change = UNCHANGED, *, progress: Callable[[], None] | None = None) -> Measured:
    """Make the captures of each link and process them to MPCs.

    Raises
    ------
    DataError
        The changed instrument is not valid, or no direction of a position can be used.
    """
    scene = apply_change(campaign.instrument, change)
    filter_, mpcs, daps, snr = None, [empty_table()], {}, [np.empty(0)]
    b2b = back_to_back_of(scene)
    for link in campaign.links:
        paths = trace(campaign.environment, link.tx, link.rx, campaign.frequency, max_order=campaign.max_order)
        recording = record(
            paths,
            scene.sounder,
            name=link.name,
            tx_position=link.tx,
            rx_position=link.rx,
            snapshots=scene.snapshots,
            los=int(paths["los"].any()),
            faults=scene.faults,
            seed=scene.seed,
        )
        filter_ = filter_ or calibrate(b2b, recording)
        groups, _ = process_recording(recording, filter_, Options())
        found = groups["/mpc"]
        columns: dict[str, ArrayLike] = {**columns_of_product(found)}
        where: dict[str, ArrayLike] = {"position": link.name, "los": recording.los, "frequency": campaign.frequency}
        mpcs.append(make_table({**where, "tx_position": link.tx, "rx_position": link.rx, **columns}))
        daps[link.name] = groups["/daps"]
        floor = float(np.nanmedian(groups["/daps"]["noise_floor"].values))
        snr.append(found["path_gain"].values + scene.sounder.rx_antenna.gain - floor)
        if progress is not None:
            progress()
    return Measured(xr.concat(mpcs, dim="mpc"), np.concatenate(snr), daps)


def draw_daps(products: Sequence[tuple[str, xr.Dataset]], axes: PolarAxes) -> PolarAxes:
    """Draw the DAPS of one or two positions in one polar diagram."""
    return daps_polar(products, axes)


def apply_change(scene: Scene, change: Change) -> Scene:
    """Scene with a changed instrument.

    A sequence of order ``m`` at ``2**(m - 9)`` times the rate has nearly the same period, and so the same longest
    unambiguous path. The gain of a beam changes by ``-10 lg(ratio of beamwidths)``.

    Raises
    ------
    DataError
        The changed description is not valid. The message names the key.
    """
    sounder = scene.sounder
    tables = sounder.model_dump()
    update: dict[str, object] = {}
    if change.bandwidth is not None:
        _set_bandwidth(tables, sounder, change.bandwidth)
        update["attenuator"] = NOMINAL_ATTENUATION
    if change.azimuth_step is not None:
        tables["scan"]["azimuth"] = np.arange(0, 360 - 1e-9, change.azimuth_step).tolist()
    if change.beamwidth is not None:
        antenna = tables["rx_antenna"]
        spread = change.beamwidth / (sounder.rx_antenna.hpbw_azimuth or 360.0)
        antenna |= {"pattern": "gaussian", "cut": None, "hpbw_azimuth": change.beamwidth}
        antenna["gain"] -= 10 * float(np.log10(spread))
    tables["transmitter"]["power"] += change.power
    if change.power > 0:  # otherwise the back-to-back would clip
        update["attenuator"] = NOMINAL_ATTENUATION + change.power
    if not change.noise:
        update["faults"] = scene.faults.model_copy(update={"thermal_noise": None})
    if change.snapshots is not None:
        update["snapshots"] = change.snapshots
    return scene.model_copy(update={"sounder": Sounder.from_tables(tables, f"{sounder.name}, changed"), **update})


def _set_bandwidth(tables: dict, sounder: Sounder, bandwidth: float) -> None:
    """Change the sample rate, and the order of the sequence with it."""
    waveform = tables["waveform"]
    ratio = bandwidth / sounder.waveform.sample_rate
    waveform["order"] = sounder.sequence.order + round(float(np.log2(ratio)))
    waveform["polynomial"] = PRIMITIVE_POLYNOMIALS.get(waveform["order"], ())
    waveform["sample_rate"], waveform["chip_rate"] = bandwidth, sounder.sequence.chip_rate * ratio
    tables["processing"]["bandwidth"] = sounder.bandwidth * ratio


def _parameters(scene: Scene) -> dict[str, str]:
    """Texts that describe the set-up, under the names of Table 1 of the letter."""
    sounder = scene.sounder
    placed = [scene.transmitters.values(), [one.position for one in scene.receivers]]
    heights = [sorted({place[2] for place in places}) for places in placed]
    azimuth, elevation = np.asarray(sounder.scan.azimuth), np.asarray(sounder.scan.elevation)
    tx, rx = sounder.tx_antenna, sounder.rx_antenna
    return {
        "TX/RX height": "/".join(", ".join(f"{value:g}" for value in values) for values in heights) + " m",
        "Centre frequency": f"{sounder.carrier.frequency / 1e9:g} GHz",
        "Bandwidth": f"{sounder.waveform.sample_rate / 1e9:g} GHz",
        "TX/RX antenna gain": f"{tx.gain:g}/{rx.gain:g} dBi",
        "Horizontal/vertical HPBW": f"{rx.hpbw_azimuth:g}/{rx.hpbw_elevation:g}°",
        "RX azimuth rotation": f"{azimuth[0]:g}:{np.diff(azimuth)[0]:g}:{azimuth[-1]:g}°",
        "RX elevation rotation": f"{elevation[0]:g}:{np.diff(elevation)[0]:g}:{elevation[-1]:g}°",
    }

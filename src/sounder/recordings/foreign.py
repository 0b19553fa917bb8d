"""Reader of foreign HDF5 and MATLAB files, by a layout."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError
from sounder.instrument.description import Sounder
from sounder.recordings.axes import PLACES, Grid, each_direction, grid, lengths, node_of, require_lengths
from sounder.recordings.described import described, is_descending, require_same_frequencies
from sounder.recordings.foreign_file import ForeignFile, foreign_file, opener
from sounder.recordings.layout import Layout, Samples
from sounder.recordings.places import Place, places
from sounder.recordings.pulses import correlated, cut_around_peak, ideal_pulse
from sounder.recordings.recording import BackToBack, Captures, PositionError, Recording, check


def recordings(
    path: Path, layout: Layout, sounder: Sounder, *, positions: Path | None = None
) -> list[Recording | PositionError]:
    """Open every position of a foreign file. Samples of HDF5 files are not read.

    Parameters
    ----------
    path : Path
        HDF5 file (MATLAB 7.3 included) or older MATLAB file.
    layout : Layout
        Where the file stores what a recording needs.
    sounder : Sounder
        Description of the sounder. Keys of the layout override it.
    positions : Path, optional
        Text table of positions, if the layout has them in one.

    Returns
    -------
    list of Recording or PositionError
        One for each position; the error in place of a position that cannot be used.

    Raises
    ------
    DataError
        The file does not have this layout.
    """
    block = layout.captures
    with foreign_file(path, block.files) as file:
        instrument, _ = described(file, layout, sounder)
        descending = is_descending(file, layout.captures.frequency)
        scan = grid(file, layout)
        shape = lengths(file, block, {"sample": instrument.waveform.samples, **scan.lengths})
        require_lengths(path, layout.captures, shape, scan.lengths, instrument.waveform.samples)
        lengths_of_places = tuple(shape.get(axis, 1) for axis in PLACES)
        names = [_name(layout, path, p) for p in range(prod(lengths_of_places))]
        placed = places(file, layout, names, positions, ends=(lengths_of_places[1], lengths_of_places[2]))
        scale = file.scale(layout.scale_factor, "scale_factor")
        agc = each_direction(file, layout.agc_gain, block, shape, "agc_gain")
        times = None if layout.time is None else each_direction(file, layout.time, block, shape, "time")
        inputs = tuple(getattr(file.root, "files", ()))
    file_of_all = opener(path, block.files)
    found: list[Recording | PositionError] = []
    for p, place in enumerate(placed):
        if isinstance(place, DataError):
            found.append(PositionError(str(place), names[p]))
            continue

        def of_departure(a: int, e: int, p: int = p, place: Place = place) -> Recording:
            beam = (p, scan.order["tx_azimuth"][a], scan.order["tx_elevation"][e])
            where = (*np.unravel_index(p, lengths_of_places), *beam[1:])
            order = np.ix_(scan.order["azimuth"], scan.order["elevation"])
            azimuth, elevation = scan.angles["azimuth"], scan.angles["elevation"]
            return Recording(
                name=names[p],
                source=path,
                sounder=place.described(instrument),
                azimuth=azimuth,
                elevation=elevation,
                snapshots=shape.get("snapshot", 1),
                tx_position=place.tx,
                rx_position=place.rx,
                scale_factor=scale,
                agc_gain=agc[beam][order],
                valid=np.ones((azimuth.size, elevation.size), bool),
                los=place.los,
                time=None if times is None else times[beam][order],
                read=_reader(file_of_all, block, shape, where, scan, descending),
                kind=block.kind,
                inputs=inputs,
            )

        recording = of_departure(0, 0)
        if scan.lengths["tx_azimuth"] * scan.lengths["tx_elevation"] > 1:
            recording = replace(
                recording,
                of_departure=of_departure,
                tx_azimuth=scan.angles["tx_azimuth"],
                tx_elevation=scan.angles["tx_elevation"],
            )
        try:
            check(recording, shape["sample"])
        except DataError as error:
            found.append(PositionError(str(error), names[p]))
        else:
            found.append(recording)
    return found


def back_to_back(path: Path, layout: Layout, sounder: Sounder, *, calibration: Path | None = None) -> BackToBack | None:
    """Read the back-to-back captures of a foreign file, or of a foreign file of their own, ``calibration``.

    If the layout names none: that of an ideal instrument for responses, which may be calibrated already; else None.
    """
    block, kind = layout.back_to_back, layout.captures.kind
    with foreign_file(path, layout.captures.files) as file:
        instrument, sequence = described(file, layout, sounder)
        if block is None and calibration is None:
            return ideal_pulse(path, instrument, kind, layout.captures.window)
    source = path if calibration is None else calibration
    if block is None:
        raise DataError(f"{source}: not a native back-to-back recording, and the layout has no section [back_to_back]")
    with foreign_file(source) as file:
        frequency = layout.captures.frequency if block.frequency is None else block.frequency
        require_same_frequencies(file, frequency, instrument, carrier="carrier" not in layout.sounder)
        samples = instrument.waveform.samples if sequence is None or block.kind != "iq" else sequence.samples
        shape = lengths(file, block, {"sample": samples})
        captures = _captures(file, block, shape, {}, descending=is_descending(file, frequency))
        if kind == "cir":
            if sequence is not None and block.kind == "iq":
                captures = np.roll(correlated(captures, sequence, source), block.shift, axis=-1)
            captures = cut_around_peak(captures, instrument.waveform.samples)
        scale = layout.scale_factor if block.scale_factor is None else block.scale_factor
        return BackToBack(
            source=source,
            sounder=instrument,
            captures=captures,
            scale_factor=file.scale(scale, "scale_factor"),
            attenuation=file.number(block.attenuation, "back_to_back.attenuation"),
            s21=None,
            includes_tx_antenna=block.includes_tx_antenna,
            kind=kind,
            sequence=sequence,
        )


def _name(layout: Layout, path: Path, position: int) -> str:
    """Name of a position. Default: the name of the file, with a number if the layout has the axis position."""
    pattern = layout.positions.name
    if pattern is None:
        pattern = "{file}-{:02d}" if {*PLACES} & {*layout.captures.axes} else "{file}"
    before, after = layout.positions.file.split("{}")
    stem = path.stem
    if len(stem) > len(before + after) and stem.startswith(before) and stem.endswith(after):
        stem = stem[len(before) : len(stem) - len(after)]
    return pattern.format(position + layout.positions.first, file=stem)


def _complex_fields(path: Path, dataset: str, names: Sequence[str]) -> tuple[str, str]:
    """Names of the real and of the imaginary part of a record."""
    parts = {name.lower()[:1]: name for name in names}
    if len(names) == 2 and set(parts) in ({"r", "i"}, {"i", "q"}):
        return (parts["r"], parts["i"]) if "r" in parts else (parts["i"], parts["q"])
    raise DataError(
        f"{path}: {dataset} is a record of {', '.join(names)}; expected real and imaginary part, r and i, or i and q"
    )


def _reader(
    opened: Callable[[], ForeignFile],
    block: Samples,
    shape: Mapping[str, int],
    place: Sequence[np.intp],
    scan: Grid,
    descending: bool,
) -> Callable[[int, int, slice], Captures]:
    """Reader of the captures of one direction, by its index in the ascending grid.

    ``place`` holds the indices in the file of the position and of the beam of the transmit antenna.
    """
    fixed = dict(zip((*PLACES, "tx_azimuth", "tx_elevation"), map(int, place), strict=True))

    def read(azimuth: int, elevation: int, snapshots: slice) -> Captures:
        a, e = int(scan.order["azimuth"][azimuth]), int(scan.order["elevation"][elevation])
        where = {**fixed, "azimuth": a, "elevation": e, "snapshot": snapshots}
        return _captures(opened(), block, shape, where, descending=descending)

    return read


def _captures(
    file: ForeignFile, block: Samples, shape: Mapping[str, int], where: Mapping[str, Any], *, descending: bool = False
) -> Captures:
    """Captures at ``where`` as (snapshot, sample, iq) if they are int16, otherwise complex64 (snapshot, sample).

    ``descending`` reverses the samples.
    """
    index = tuple(where.get(axis, slice(None)) for axis in block.axes)
    axes = [axis for axis in block.axes if axis in ("snapshot", "sample", "iq")]
    data = np.asarray(node_of(file, block, block.dataset, shape)[index])
    if block.imaginary is not None:
        imaginary = np.asarray(node_of(file, block, block.imaginary, shape)[index])
        data, axes = np.stack([data, imaginary], axis=-1), [*axes, "iq"]
    if data.dtype.names is not None:  # MATLAB 7.3 stores complex numbers as records (real, imag)
        fields = _complex_fields(file.path, block.dataset, data.dtype.names)
        data = data[fields[0]] + 1j * data[fields[1]]
    if "snapshot" not in axes:
        data, axes = data[None], ["snapshot", *axes]
    wanted = [axis for axis in ("snapshot", "sample", "iq") if axis in axes]
    data = np.transpose(data, [axes.index(axis) for axis in wanted])
    if descending:
        data = np.flip(data, axis=1)
    if data.dtype == np.int16 and "iq" in axes:
        return np.ascontiguousarray(data)
    if "iq" in axes:
        data = data[..., 0] + 1j * data[..., 1]
    return np.ascontiguousarray(data, dtype=np.complex64)

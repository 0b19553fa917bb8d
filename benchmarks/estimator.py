"""MPCs of random channels through random instruments, against the paths that made the captures.

Every world has its own instrument (order 7 to 15, 1 to 4 samples a chip, 0.2 to 4 GHz, beams of 3 to 30 degrees, a
Gaussian horn or one with sidelobes, one to five elevations, a circle or a sector) and its own channel (1 to 200 paths
of 10 to 40 dB SNR in a part of the period, one phase a path, or one a beam as well, and in half of the worlds a diffuse
part: many weak paths about the strong ones, whose power falls with delay). Captures are made by the equations of the
twin in double precision: nothing of the estimator is in them.

    python benchmarks/estimator.py [worlds] [first seed] [--threshold usc] [--method sage] [--quiet 1] [--each 1]

``--quiet 1`` leaves out all paths, for false MPCs of noise alone. Separated paths are those with no other within 4
cells of ``1 / bandwidth`` and half a beamwidth; their errors are compared with the Cramer-Rao bound of a path alone.
"""

import pools  # isort: skip  # noqa: F401

import argparse
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from harness import TAPS

from sounder import shipped
from sounder.cir.deembedding import Deembedding, make_deembedding
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder, load_sounder
from sounder.instrument.waveform import band_limited_template, held_template
from sounder.mpc.cramer_rao import Band, cramer_rao
from sounder.mpc.extract import extract_mpcs
from sounder.mpc.score import Gates, score
from sounder.recordings.recording import BackToBack

Real = npt.NDArray[np.float64]
LARGEST = 1 << 21
"""Samples of a scan, at most: the azimuths of longer sequences are a sector."""
SEPARATED, STRONG = 4.0, 15.0
NAMES = ("delay", "azimuth", "elevation", "path_gain")
ORDERS = {7: (0, 1), 8: (0, 2, 3, 4)} | TAPS


class World(NamedTuple):
    """An instrument, a channel, and the impulse responses that the one makes of the other."""

    sounder: Sounder
    filter_: Deembedding
    paths: xr.Dataset
    diffuse: xr.Dataset
    cir: xr.Dataset


def instrument(rng: np.random.Generator) -> Sounder:
    """A random sounder, described without errors of its antenna."""
    described = load_sounder(shipped.calibration("sounder-132ghz.toml")).model_dump()
    order, per_chip = int(rng.integers(7, 16)), int(rng.integers(1, 5))
    bandwidth = float(np.exp(rng.uniform(np.log(0.2e9), np.log(4e9))))
    chip_rate = bandwidth / (0.9 * min(per_chip, 2))
    waveform = {"order": order, "polynomial": sorted((order, *ORDERS[order]), reverse=True), "chip_rate": chip_rate}
    waveform |= {"samples_per_chip": per_chip, "sample_rate": chip_rate * per_chip}
    described["waveform"] |= waveform
    described["processing"]["bandwidth"] = None
    width = float(np.exp(rng.uniform(np.log(3), np.log(30))))
    tall = width * rng.uniform(0.8, 1.2)
    antenna = {"hpbw_azimuth": width, "hpbw_elevation": tall, "sidelobe_floor": -rng.uniform(30, 45)}
    antenna |= {name: 0.0 for name in described["rx_antenna"] if name.endswith("_error")}
    described["rx_antenna"] |= (
        antenna | ({"pattern": "gaussian", "cut": None}, {"cut": cut(width, tall)})[rng.integers(2)]
    )
    rows = int(rng.integers(1, 6))
    turns = int(np.ceil(360 / (width * rng.uniform(0.8, 1.0))))
    azimuth = np.arange(turns)[: max(5, LARGEST // (rows * per_chip << order))] * 360 / turns
    described["scan"] = {"azimuth": tuple(azimuth), "elevation": tuple(tall * (np.arange(rows) - (rows - 1) / 2))}
    return Sounder.from_tables(described, "random")


def cut(width: float, tall: float) -> dict[str, list[float]]:
    """Cuts of an aperture with a cosine taper, of half-power widths [degree]: sidelobes at -23 dB (Balanis, 12.5)."""
    angle = np.linspace(-180, 180, 1441)

    def level(hpbw: float) -> list[float]:
        u = 0.594 * np.sin(np.radians(np.clip(angle, -90, 90))) / np.sin(np.radians(hpbw / 2))
        field = np.abs(
            np.pi / 4 * np.where(np.abs(u - 0.5) < 1e-6, 1, np.cos(np.pi * u) / (np.pi / 4 * (1 - 4 * u**2)))
        )
        return (20 * np.log10(np.maximum(np.where(np.abs(angle) > 90, 0, field), 1e-4))).tolist()

    return {"angle": angle.tolist(), "azimuth": level(width), "elevation": level(tall)}


def filter_of(sounder: Sounder) -> Deembedding:
    """De-embedding of an ideal receiver through an ideal attenuator."""
    sent, template = (np.fft.fft(f(sounder.waveform)) for f in (band_limited_template, held_template))
    captures = np.fft.ifft(sent)[None].astype(np.complex64)
    b2b = BackToBack(Path("b2b"), sounder, captures, 1.0, attenuation=0.0, s21=None, includes_tx_antenna=False)
    return make_deembedding(b2b, np.fft.ifft(sent * np.conj(template)), sounder, 1.0)


def channel(sounder: Sounder, rng: np.random.Generator, quiet: bool) -> tuple[xr.Dataset, xr.Dataset]:
    """Specular and diffuse paths; ``snr`` is that of a path at boresight [dB]."""
    azimuth, elevation = (np.asarray(axis) for axis in (sounder.scan.azimuth, sounder.scan.elevation))
    width, tall = sounder.rx_antenna.hpbw_azimuth, sounder.rx_antenna.hpbw_elevation
    count = 0 if quiet else int(np.exp(rng.uniform(0, np.log(200))))
    first, window = np.array([0.05, np.exp(rng.uniform(np.log(0.05), np.log(0.85)))]) * sounder.waveform.period
    sector = azimuth[-1] - azimuth[0]
    full = sector + 1.5 * (azimuth[1] - azimuth[0]) > 360
    rise = rng.uniform(elevation[0], elevation[-1], count) + (elevation.size > 1) * tall * rng.uniform(-0.4, 0.4, count)
    drawn = {
        "delay": first + window * rng.random(count),
        "azimuth": azimuth[0] + (360 if full else sector) * rng.random(count),
        "elevation": rise,
        "snr": rng.uniform(10, 40, count),
    }
    paths = xr.Dataset({name: ("path", value) for name, value in drawn.items()})
    many, share = (500, rng.uniform(0, 0.5)) if count and rng.random() < 0.5 else (0, 0.0)
    late, about = rng.exponential(window / 3, many), rng.integers(0, max(count, 1), many)
    power = np.exp(-late / (window / 3)) * rng.exponential(1, many)
    total = np.sum(10 ** (paths["snr"].values / 10)) * share / (1 - share)
    values = {
        "delay": first + late,
        "azimuth": drawn["azimuth"][about] + rng.laplace(0, width, many) if many else np.zeros(0),
        "elevation": np.clip(rng.laplace(0, tall / 2, many), elevation[0], elevation[-1]),
        "snr": 10 * np.log10(power * total / max(power.sum(), 1e-300)) if many else np.zeros(0),
    }
    return paths, xr.Dataset({name: ("path", value) for name, value in values.items()})


def gains(paths: xr.Dataset, sounder: Sounder) -> Real:
    """Relative gain (azimuth, elevation, path) of the beams [dB]."""
    azimuth, elevation = (np.asarray(axis) for axis in (sounder.scan.azimuth, sounder.scan.elevation))
    toward = paths["azimuth"].values, paths["elevation"].values
    return Pattern.of(sounder.rx_antenna).beam_gain(*toward, azimuth[:, None, None], elevation[:, None])


def world(seed: int, quiet: bool = False) -> World:
    """Draw a world; noise has power 1 in every impulse response."""
    rng = np.random.default_rng(seed)
    sounder = instrument(rng)
    filter_ = filter_of(sounder)
    frequency = np.fft.fftfreq(filter_.weight.size, 1 / sounder.waveform.sample_rate)
    paths, diffuse = channel(sounder, rng, quiet)
    both = xr.concat([paths, diffuse], "path")
    g = 10 ** ((gains(both, sounder) + both["snr"].values) / 20) * np.exp(2j * np.pi * rng.random(both.sizes["path"]))
    g *= np.exp(2j * np.pi * rng.random((*g.shape[:2], g.shape[2] if rng.random() < 0.5 else 1)))
    spectra = g @ np.exp(-2j * np.pi * np.multiply.outer(both["delay"].values, frequency))
    sent, template = (np.fft.fft(f(sounder.waveform)) for f in (band_limited_template, held_template))
    tx = 10 ** (sounder.tx_antenna.gain / 20)
    white = rng.standard_normal((*spectra.shape, 2)) @ [1, 1j] / np.sqrt(2)
    level = np.sqrt(np.sum(np.abs(template * filter_.transfer) ** 2)) / frequency.size
    spectra = spectra * sent * tx + white / level
    cir = filter_.apply(np.fft.ifft(spectra * np.conj(template))).astype(np.complex64)
    coords = {"azimuth": list(sounder.scan.azimuth), "elevation": list(sounder.scan.elevation)}
    delay = np.arange(frequency.size) / sounder.waveform.sample_rate
    data = xr.Dataset({"cir": (("azimuth", "elevation", "delay"), cir)}, coords=coords | {"delay": delay})
    return World(sounder, filter_, paths, diffuse, data)


def bounds(world: World) -> Real:
    """Cramer-Rao bounds (path, 4) of the paths, each alone."""
    band, scan = Band.of(world.filter_), (world.sounder.scan.azimuth, world.sounder.scan.elevation)
    pattern = Pattern.of(world.sounder.rx_antenna)
    best = world.paths["snr"] + gains(world.paths, world.sounder).max(axis=(0, 1))
    alone = [world.paths.assign(snr=best).isel(path=[p]) for p in range(best.size)]
    found = [cramer_rao(path, *scan, pattern, band) for path in alone]
    return np.array([[one[f"{name}_std"].item() for name in NAMES] for one in found]).reshape(-1, 4)


def compare(world: World, table: xr.Dataset) -> dict[str, npt.NDArray[np.generic]]:
    """Rows of paths (snr, separation, error over bound, error over deviation), and false MPCs."""
    sounder, period = world.sounder, world.sounder.waveform.period
    cell, width = 1 / sounder.bandwidth, sounder.rx_antenna.hpbw_azimuth
    snr = world.paths["snr"].values + gains(world.paths, sounder).max(axis=(0, 1), initial=-np.inf)
    gain = world.paths["snr"].values - Pattern.of(sounder.rx_antenna).gain
    truth = world.paths.assign(path_gain=("path", gain), snr=("path", snr))
    gates = Gates(delay=cell, azimuth=max(width / 2, 1.0))
    matched = score(table, truth, gates=gates, dynamic_range=np.inf, least_snr=0.0, period=period).paths
    everything = xr.concat([world.paths, world.diffuse], "path")
    late = (table["delay"].values[:, None] - everything["delay"].values + period / 2) % period - period / 2
    aside = (table["azimuth"].values[:, None] - everything["azimuth"].values + 180) % 360 - 180
    near = (np.abs(late) < 2.5 * cell) & (np.abs(aside) < 1.5 * width)
    specular = near[:, : snr.size]
    mates = replace(gates, delay=SEPARATED * cell, path_gain=40.0)
    separation = score(table.isel(mpc=slice(0, 0)), truth, gates=mates, dynamic_range=np.inf, period=period).paths
    error, normalised = (
        np.stack([matched[f"{name}_{kind}"].values for name in NAMES], axis=-1) for kind in ("error", "normalised")
    )
    return {
        "snr": snr,
        "separated": separation["separation"].values > 1,
        "found": matched["match"].values >= 0,
        "ratio": error / bounds(world),
        "normalised": normalised,
        "false": ~near.any(axis=1),
        "not_specular": ~specular.any(axis=1),
    }


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("worlds", type=int, nargs="?", default=40)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--threshold", default="usc")
    parser.add_argument("--method", default="sage")
    parser.add_argument("--quiet", type=int, default=0)
    parser.add_argument("--each", type=int, default=0)
    options = parser.parse_args()
    rows, spent = [], 0.0
    for seed in range(options.seed, options.seed + options.worlds):
        drawn = world(seed, bool(options.quiet))
        start = time.process_time()
        table = extract_mpcs(
            drawn.cir, drawn.filter_, drawn.sounder, threshold=options.threshold, method=options.method
        )
        used = time.process_time() - start
        spent += used
        rows.append(compare(drawn, table))
        if options.each:
            one, wave = rows[-1], drawn.sounder.waveform
            print(
                f"{seed:4d} order {wave.order:2d} x{wave.samples_per_chip} {drawn.sounder.bandwidth / 1e9:4.1f} GHz "
                f"{drawn.sounder.rx_antenna.hpbw_azimuth:4.1f} deg, {drawn.cir['azimuth'].size:3d} x "
                f"{drawn.cir['elevation'].size}, {one['snr'].size:3d} paths, {drawn.diffuse.sizes['path']} diffuse: "
                f"{one['found'].sum():3d} found, {one['false'].sum():2d} false, {used:5.1f} s",
                flush=True,
            )
    report(rows, spent)


def report(rows: list[dict[str, npt.NDArray[np.generic]]], spent: float) -> None:
    """Print the table of all worlds."""
    joined = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    snr, found, apart = joined["snr"], joined["found"], joined["separated"]
    print(f"{len(rows)} worlds, {found.size} paths, {spent:.1f} s; false MPCs {joined['false'].sum()} of", end=" ")
    print(f"{joined['false'].size}, {joined['false'].sum() / len(rows):.2f} a world; at no specular path", end=" ")
    print(f"{joined['not_specular'].sum()}")
    print(f"{'':24s} {'paths':>6s} {'found':>6s}" + "".join(f"  {name:>21s}" for name in NAMES))
    print(f"{'':38s}" + "  ratio  1 std  2 std  " * len(NAMES))
    strong = snr >= STRONG
    groups = {"separated, 15 dB": apart & strong, "separated, weaker": apart & ~strong, "others": ~apart & strong}
    edges = np.percentile(snr, np.linspace(0, 100, 6)) if snr.size else []
    for low, high in pairwise(edges):
        groups[f"SNR {low:.0f} to {high:.0f} dB"] = (snr >= low) & (snr <= high)
    for name, which in groups.items():
        hit = which & found
        print(f"{name:24s} {which.sum():6d} {100 * hit.sum() / max(which.sum(), 1):5.1f}%", end=" ")
        for column in range(len(NAMES)):
            ratio, size = joined["ratio"][hit, column], np.abs(joined["normalised"][hit, column])
            ratio, size = ratio[np.isfinite(ratio)], size[np.isfinite(size)]
            if not size.size:
                print(f"{'':23s}", end="")
                continue
            rms = np.sqrt(np.mean(ratio**2)) if ratio.size else np.nan
            print(f" {min(rms, 999):6.2f} {100 * np.mean(size < 1):5.1f}% {100 * np.mean(size < 2):5.1f}% ", end="")
        print()


if __name__ == "__main__":
    main()

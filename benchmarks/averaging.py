"""Claim: phase-aligned averaging takes at most twice as long as coherent averaging.

Every averaging, from a recording of 108 directions of 200 snapshots to CIRs, interleaved with plainly reading the same
bytes, with two transforms of every capture by the fastest library (the bound of power averaging), and with the numpy
script that a user would write. Last, the position as `sounder process` makes it, and the hash of its file.
"""

from harness import conclude, interleaved  # isort: skip

import hashlib
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import get_args

import campaign
import numpy as np
import scipy.fft
from routes import Blocks, fft_routes

from sounder.cir.impulse_response import calibrate, impulse_responses
from sounder.instrument.waveform import held_template
from sounder.options import Averaging, Options
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process
from sounder.recordings.recording import Recording

SNAPSHOTS = 200
READ, HASH, TRANSFORMS = "np.fromfile of the same bytes", "SHA-256 of the file", "two transforms of every capture"


def script(recording: Recording, averaging: Averaging) -> None:
    """Correlate and average as one would write it, without the de-embedding."""
    template = np.conj(scipy.fft.fft(held_template(recording.sounder.waveform)))
    for a in range(recording.azimuth.size):
        for e in range(recording.elevation.size):
            captures = recording.captures(a, e).astype(np.float32) @ np.array([1, 1j], np.complex64)
            if averaging == "coherent":
                scipy.fft.ifft(scipy.fft.fft(captures.mean(axis=0)) * template)
                continue
            each = scipy.fft.ifft(scipy.fft.fft(captures, axis=1) * template, axis=1)
            if averaging == "power":
                np.mean(np.abs(each) ** 2, axis=0)
                continue
            mean = each[0]
            for _ in range(2):
                mean = np.exp(-1j * np.angle(each @ np.conj(mean))) @ each


def transforms(recording: Recording) -> tuple[str, Callable[[], None]]:
    """Transform every capture forward and backward by the fastest library and length that is installed."""

    def both(route: Blocks, captures: int = SNAPSHOTS * 108) -> None:
        for _ in range(captures // len(route.block)):
            route.inverse(route.forward(route.block))

    routes = fft_routes(held_template(recording.sounder.waveform))
    for route in routes.values():
        route.block[:] = np.random.default_rng(1).standard_normal(route.block.shape)
    times = interleaved({name: partial(both, route, 1000) for name, route in routes.items()}, at_least=0.0)
    name = min(times, key=lambda name: times[name].processor)
    return f"{TRANSFORMS}, {name}", partial(both, routes[name])


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    with tempfile.TemporaryDirectory() as folder:
        path = campaign.write_recording(Path(folder), "RX", SNAPSHOTS, distinct=SNAPSHOTS)
        jobs, _ = gather([path], calibration=campaign.write_calibration(Path(folder)))
        recording = jobs[0].recording
        filter_ = calibrate(jobs[0].b2b, recording)
        name, both = transforms(recording)
        runs: dict[str, Callable[[], object]] = {
            READ: lambda: np.fromfile(path, np.int16),
            HASH: lambda: hashlib.sha256(path.read_bytes()).hexdigest(),
            name: both,
        }
        for averaging in get_args(Averaging):
            for threads in (1, 2):
                run = partial(impulse_responses, recording, filter_, averaging=averaging, threads=threads)
                runs[f"{averaging}, CIR, {threads} thread{'s' * (threads > 1)}"] = run
            options = Options(averaging=averaging)
            runs[f"{averaging}, whole position"] = partial(process, jobs, Path(folder) / "out", options=options)
            runs[f"{averaging}, script of numpy"] = partial(script, recording, averaging)
        times = interleaved(runs, rounds=rounds, at_least=0.0)
    captures = SNAPSHOTS * 108
    print(f"{'':48s} {'wall us':>9s} {'CPU us':>9s} {'over reading':>13s}   a capture; medians")
    for each, spent in times.items():
        wall, processor = (1e6 * seconds / captures for seconds in spent)
        print(f"{each:48s} {wall:9.2f} {processor:9.2f} {spent.processor / times[READ].processor:13.1f}")
    own = {averaging: times[f"{averaging}, CIR, 1 thread"].processor for averaging in get_args(Averaging)}
    print(f"power over two transforms: {own['power'] / times[name].processor:.2f} (at most 1.3 is claimed)")
    for averaging in get_args(Averaging):
        one, two = (times[f"{averaging}, CIR, {count}"] for count in ("1 thread", "2 threads"))
        script_ = times[f"{averaging}, script of numpy"].processor
        print(
            f"{averaging}: two threads {one.wall / two.wall:.2f} times one; script {script_ / own[averaging]:.1f} times"
        )
    conclude(
        "phase-aligned averaging at most 2 times as long as coherent (ratio: coherent over phase-aligned)",
        own["coherent"] / own["phase-aligned"],
        own["coherent"] / times[READ].processor,
    )


if __name__ == "__main__":
    main()

"""Claim: a page-cached recording becomes CIRs, DAPS and noise floors at 40 % of the speed of plainly reading it."""

from harness import conclude, interleaved  # isort: skip

import tempfile
from pathlib import Path

import campaign
import h5py
import numpy as np

from sounder.cir.impulse_response import calibrate, impulse_responses
from sounder.cir.power_spectrum import daps
from sounder.instrument.waveform import held_template
from sounder.mpc.extract import extract_mpcs
from sounder.processing.jobs import gather

SNAPSHOTS = 2432  # 1.0 GiB
OURS, READ, SCRIPT, SHORT, MPC = (
    "recording to CIR, DAPS, noise floor",
    "np.fromfile of the same bytes",
    "numpy/scipy script, every capture transformed",
    "numpy/scipy script, captures averaged first",
    "MPC extraction from the CIRs",
)


def script(path: Path, b2b: Path, average_first: bool) -> np.ndarray:
    """Do the same job as a clean script does it; returns the DAPS [dB]."""
    import scipy.fft

    sounder = campaign.described()
    template = np.conj(scipy.fft.fft(held_template(sounder.waveform))).astype(np.complex64)
    frequency = np.abs(np.fft.fftfreq(1022, 1 / 1.2e9))
    window = np.where(frequency < 540e6, 0.5 + 0.5 * np.cos(np.pi * frequency / 540e6), 0)
    window[0] = 0  # the receiver's offset
    kept = window > 0
    with h5py.File(b2b) as file:
        captures = file["iq"][:].astype(np.float32)
        reference = scipy.fft.fft((captures[..., 0] + 1j * captures[..., 1]).mean(axis=0))
    response = window * np.conj(reference) / (np.abs(reference) ** 2 + 1e-4 * np.mean(np.abs(reference) ** 2))
    inverse = np.where(kept, response / np.where(kept, template, 1), 0)
    with h5py.File(path) as file:
        iq, gain = file["iq"], file["agc_gain"][:]
        powers = np.empty((*iq.shape[:2], 1022))
        for a in range(iq.shape[0]):
            for e in range(iq.shape[1]):
                block = iq[a, e].astype(np.float32)
                captures = block[..., 0] + 1j * block[..., 1]
                if average_first:
                    mean = scipy.fft.ifft(scipy.fft.fft(captures.mean(axis=0)) * template)
                else:
                    each = scipy.fft.ifft(scipy.fft.fft(captures, axis=1) * template, axis=1)
                    mean = each.mean(axis=0)
                    _power = np.mean(np.abs(each) ** 2, axis=0)
                mean = mean * 10 ** (-gain[a, e] / 20)
                powers[a, e] = np.abs(scipy.fft.ifft(scipy.fft.fft(mean) * inverse)) ** 2
    _floor = np.median(powers, axis=-1)
    return 10 * np.log10(powers)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = campaign.write_recording(Path(folder), "RX", SNAPSHOTS)
        b2b = campaign.write_calibration(Path(folder))
        job = gather([path], calibration=b2b)[0][0]
        filter_ = calibrate(job.b2b, job.recording)

        def ours() -> object:
            cir, _ = impulse_responses(job.recording, filter_)
            return daps(cir, job.recording.sounder)

        cir, _ = impulse_responses(job.recording, filter_)
        runs = {
            OURS: ours,
            READ: lambda: np.fromfile(path, np.int16),
            MPC: lambda: extract_mpcs(cir, filter_, job.recording.sounder),
            SCRIPT: lambda: script(path, b2b, average_first=False),
            SHORT: lambda: script(path, b2b, average_first=True),
        }
        theirs, own = script(path, b2b, average_first=False), ours()["daps"].values
        strong = own > own.max() - 30
        shift = np.median(own[strong] - theirs[strong])
        if np.abs(own[strong] - theirs[strong] - shift).max() > 0.5:
            raise SystemExit("the script and the project do not agree")
        times = interleaved(runs, rounds=3, at_least=0.0)
    size = SNAPSHOTS * 108 * 4088
    print(f"{'':52s} {'wall s':>8s} {'GB/s':>7s}")
    for name, spent in times.items():
        print(f"{name:52s} {spent.wall:8.3f} {size / spent.wall / 1e9:7.2f}")
    print(f"over the script that averages first: {times[SHORT].wall / times[OURS].wall:.1f}")
    conclude(
        "1 GiB recording to CIR, DAPS and noise floor: at least 20 times a script; at most 2.5 times np.fromfile",
        times[SCRIPT].wall / times[OURS].wall,
        times[OURS].wall / times[READ].wall,
    )


if __name__ == "__main__":
    main()

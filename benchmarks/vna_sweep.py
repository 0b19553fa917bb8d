"""Sweeps of a network analyser of a ray-traced scene: S21 over frequency in every direction of a horn.

A direct sum over the paths of the ray tracer, ``S21(f) = sum_p g(w_p) a_p exp(-2 pi j f tau_p)``, with a Gaussian lobe
in the frame of the horn. Nothing of the package is in it, so that captures and sweeps of a scene are two measurements.

    python benchmarks/vna_sweep.py PATHS.h5 OUT.h5 [--every 5] [--points 801] [--span 4e9] [--noise -104]
    sounder process OUT.h5 --layout examples/layouts/vna.toml --out DIR
    erm reconstruct DIR/*.h5 --out map.geojson

``PATHS.h5`` holds along ``path`` what a ray tracer knows (``a_passband``, ``delay_geom_s``, ``aoa_az``, ``aoa_el``
[rad]), rows ``rx_ptr[i]:rx_ptr[i + 1]`` of receiver i, and the positions. ``--noise`` is that of a point of a sweep
[dB].
"""

import argparse

import h5py
import numpy as np
import numpy.typing as npt

Real = npt.NDArray[np.float64]
GAIN, WIDTH, FLOOR = 24.5, (10.0, 9.0), -30.0
"""Of the horn [dBi, degree, dB], as `examples/layouts/vna.toml` describes it."""
AZIMUTH, ELEVATION = np.arange(0.0, 360.0, 10.0), np.array([-9.0, 0.0, 9.0])


def horn(azimuth: Real, elevation: Real, pan: float, tilt: float) -> Real:
    """Amplitude (path,) of the horn, panned and tilted [degree], toward directions [rad]."""
    ahead, aside = (
        np.cos(elevation) * np.cos(azimuth - np.radians(pan)),
        np.cos(elevation) * np.sin(azimuth - np.radians(pan)),
    )
    up, turn = np.sin(elevation), np.radians(tilt)
    ahead, up = np.cos(turn) * ahead + np.sin(turn) * up, np.cos(turn) * up - np.sin(turn) * ahead
    off = np.degrees([np.arctan2(aside, ahead), np.arcsin(np.clip(up, -1, 1))])
    lobe = -10 * np.log10(2) * np.sum((2 * off / np.array(WIDTH)[:, None]) ** 2, axis=0)
    return np.asarray(10 ** ((GAIN + np.maximum(lobe, FLOOR)) / 20))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("paths")
    parser.add_argument("out")
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--points", type=int, default=801)
    parser.add_argument("--span", type=float, default=4e9)
    parser.add_argument("--noise", type=float, default=-104.0)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    with h5py.File(options.paths) as scene, h5py.File(options.out, "w") as file:
        receivers = np.arange(0, len(scene["rx_position"]), options.every)
        carrier = float(scene.attrs["frequency_hz"])
        frequency = carrier + options.span * np.linspace(-0.5, 0.5, options.points)
        shape = receivers.size, AZIMUTH.size, ELEVATION.size, options.points
        sweeps = rng.normal(size=(*shape, 2)) @ [1, 1j] * 10 ** (options.noise / 20) / np.sqrt(2)
        for p, receiver in enumerate(receivers):
            rows = slice(*scene["rx_ptr"][receiver : receiver + 2])
            amplitude, delay, azimuth, elevation = (
                scene["path"][name][rows].astype(complex if name == "a_passband" else float)
                for name in ("a_passband", "delay_geom_s", "aoa_az", "aoa_el")
            )
            waves = amplitude[:, None] * np.exp(-2j * np.pi * np.outer(delay, frequency))
            gains = np.array([[horn(azimuth, elevation, pan, tilt) for tilt in ELEVATION] for pan in AZIMUTH])
            sweeps[p] += gains @ waves
        file["S21"], file["frequency"] = sweeps.astype(np.complex64), frequency
        file["azimuth"], file["elevation"] = AZIMUTH, ELEVATION
        file["tx"], file["rx"] = scene["tx_position"][()], scene["rx_position"][()][receivers]


if __name__ == "__main__":
    main()

# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
# ---

# %% [markdown]
# # Your own sounder
#
# A network analyser at 28 GHz, a horn that turns in steps of 10 degrees, one file. A layout says where the file keeps
# what. More kinds of files: docs/your-sounder.md.

# %%
from pathlib import Path
from tempfile import mkdtemp

import h5py
import numpy as np
from scipy.constants import c

import erm
import sounder

folder = Path(mkdtemp())
tx, rx = np.array([0.0, 0.0, 3.0]), np.array([[8.0, 2.0, 3.0], [12.0, 4.0, 3.0], [16.0, 1.0, 3.0], [20.0, 5.0, 3.0]])
azimuth, frequency = np.arange(0.0, 360.0, 10.0), 28e9 + 10e6 * np.arange(-50, 51)

# %% [markdown]
# The measurement: here the direct path and a wall at y = 12 m, whose mirror image of the transmitter is at y = 24 m.

# %%
rng = np.random.default_rng(1)
noise = rng.normal(size=(2, len(rx), azimuth.size, frequency.size))
s21 = 1e-6 * (noise[0] + 1j * noise[1]) / np.sqrt(2)
for source, loss in ((tx, 0.0), (np.array([0.0, 24.0, 3.0]), 6.0)):
    for position, place in enumerate(rx):
        length, (east, north, _) = np.linalg.norm(source - place), source - place
        off = (azimuth - np.degrees(np.arctan2(north, east)) + 180) % 360 - 180
        horn = np.maximum(-3.0103 * (2 * off / 12) ** 2, -30)
        gain = 20 + horn - loss + 20 * np.log10(c / 28e9 / (4 * np.pi * length))
        s21[position] += 10 ** (gain[:, None] / 20) * np.exp(-2j * np.pi * frequency * length / c)
with h5py.File(folder / "vna.h5", "w") as file:
    file["S21"], file["freq"], file["bearing"], file["rx"] = s21, frequency, (90 - azimuth) % 360, rx

# %%
layout = """
[captures]
kind = "ctf"
dataset = "S21"
axes = ["position", "azimuth", "frequency"]
frequency = { dataset = "freq" }
[grid]
azimuth = { dataset = "bearing" }
azimuth_convention = "compass"
elevation = [0]
[positions]
tx = [0.0, 0.0, 3.0]
rx = { dataset = "rx" }
los = 1
name = "P{}"
[sounder]
name = "VNA at 28 GHz"
[sounder.tx_antenna]
gain = 0.0
pattern = "flat"
[sounder.rx_antenna]
gain = 20.0
pattern = "gaussian"
hpbw_azimuth = 12.0
hpbw_elevation = 12.0
"""
(folder / "layout.toml").write_text(layout)
jobs, failures = sounder.gather([folder / "vna.h5"], layout=folder / "layout.toml")
outcome = sounder.process(jobs, folder / "products")
table, complaints = erm.read_mpcs(outcome.products)
print(table[["position", "delay", "azimuth", "path_gain"]].to_dataframe())

# %%
environment, located = erm.reconstruct(erm.select(table))
wall = environment.reflectors.isel(reflector=0)
print(f"a wall {float(wall['offset']):.3f} m away, toward {float(wall['normal']):.1f} degrees")

# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
# ---

# %% [markdown]
# # From raw captures to a map
#
# Run `sounder demo --out demo-output` first, and this notebook in the folder above `demo-output`.
# `jupytext --to notebook raw_to_map.py` makes a notebook of this file.

# %%
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import erm
import sounder

raw = Path("demo-output/raw")
recordings = sorted(raw.glob("*.h5"))
jobs, failures = sounder.gather(recordings, calibration="demo-output/back-to-back.h5")
print(f"{len(jobs)} positions; {failures or 'no failures'}")

# %% [markdown]
# One position, stage by stage: captures to impulse responses (CIR), power over delay and angle (DAPS), paths (MPCs).

# %%
recording, b2b = jobs[0].recording, jobs[0].b2b
distance = float(np.linalg.norm(recording.tx_position - recording.rx_position))
filter_ = sounder.calibrate(b2b, recording)
cir, remarks = sounder.impulse_responses(recording, filter_)
spectrum = sounder.daps(cir, recording.sounder)
mpcs = sounder.extract_mpcs(cir, filter_, recording.sounder, distance=distance)
print(mpcs[["delay", "azimuth", "path_gain"]].to_dataframe().head())

# %%
from sounder.figures.products import daps_cartesian

axes = daps_cartesian(spectrum, Figure(figsize=(6, 4)).add_subplot(), mpc=mpcs)
axes.figure

# %% [markdown]
# All positions: products on disk (those that are there are kept), one table of MPCs, single bounces, walls.

# %%
outcome = sounder.process(jobs, "demo-output/products", resume=True)
table, complaints = erm.read_mpcs(outcome.products)
environment, located = erm.reconstruct(erm.select(table))
print(environment.reflectors[["normal", "offset", "support"]].to_dataframe())
print(located["reason"].to_series().value_counts())

# %%
axes = erm.plot_map(environment, table=located, annotated=True, ax=Figure(figsize=(7, 6)).add_subplot())
axes.figure

# %%
erm.write_map(environment, "demo-output/notebook.geojson")

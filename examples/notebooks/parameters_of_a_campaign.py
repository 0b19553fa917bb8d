# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
# ---

# %% [markdown]
# # Channel parameters of a campaign
#
# Run `sounder demo --out demo-output` first, and this notebook in the folder above `demo-output`.

# %%
from pathlib import Path

import xarray as xr

import sounder
from sounder.figures.parameters import cdf_page
from sounder.products.engine import ProductEngine  # the same as engine="sounder"

products = sorted(Path("demo-output/products").glob("*.h5"))
parameters, problems = sounder.channel_parameters(products)
print(parameters[["los", "path_loss", "rms_delay_spread", "rms_delay_spread_std"]].to_dataframe())

# %% [markdown]
# Every value says what it is, and which paths it is of.

# %%
print(parameters["rms_delay_spread"].attrs)
print(parameters["definition"].values[0])

# %%
for one in sounder.campaign_statistics(parameters):
    if one.parameter == "rms_delay_spread" and one.statistic == "median":
        print(f"{one.group}: {one.value * 1e9:.1f} ns ({one.positions} positions)")

# %%
cdf_page(parameters)

# %% [markdown]
# Only paths within 20 dB of the strongest, and 12 dB over the noise.

# %%
strong, _ = sounder.channel_parameters(products, threshold="12,20")
print((strong["rms_delay_spread"] / parameters["rms_delay_spread"]).values)

# %% [markdown]
# One position in xarray.

# %%
mpcs = xr.open_dataset(products[0], engine=ProductEngine)
print(mpcs.sounder.excess_delay.values * 1e9)
print(xr.open_datatree(products[0], engine=ProductEngine).groups)

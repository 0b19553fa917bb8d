"""Commands run whatever numba is told, and whatever state its cache is in."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from sounder import shipped
from sounder.kernels.compiler.cache import cache_directory

pytestmark = pytest.mark.slow


def process(folder, **environment):
    """Process the shipped recording in a process of its own; return the MPCs."""
    b2b = shipped.calibration("back-to-back-132ghz.h5")
    command = ("process", shipped.calibration("recording-132ghz.h5"), "--calibration", b2b, "--out", folder)
    run(*command, **environment)
    (product,) = folder.glob("*.h5")
    assert "MPCs" in run("info", product, **environment)
    with xr.open_dataset(product, group="mpc") as mpcs:
        return mpcs.load()


def run(*command, **environment):
    command = [sys.executable, "-W", "error", "-m", "sounder", *map(str, command)]
    done = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """MPCs, as they are."""
    return process(tmp_path_factory.mktemp("compiled"))


def test_without_compiling_the_mpcs_are_the_same(compiled, tmp_path):
    interpreted = process(tmp_path, NUMBA_DISABLE_JIT="1")
    for name in ("delay", "azimuth", "elevation", "path_gain"):
        np.testing.assert_allclose(interpreted[name], compiled[name], rtol=1e-6)


@pytest.mark.parametrize("damage", [b"", b"junk"], ids=["empty", "junk"])
def test_a_damaged_cache_is_made_anew(compiled, tmp_path, damage):
    kept = cache_directory()
    if kept is None:
        pytest.skip("no cache of kernels on this system")
    cache = tmp_path / "cache"
    shutil.copytree(kept, cache / kept.name)
    for index in cache.rglob("clipping*.nbi"):  # one for each copy of the package that was run from here
        index.write_bytes(damage)
    mpcs = process(tmp_path / "out", NUMBA_CACHE_DIR=str(cache))
    xr.testing.assert_identical(mpcs, compiled)
    sizes = [index.stat().st_size for index in cache.rglob("clipping*.nbi")]
    assert sizes
    assert min(sizes) > len(damage)

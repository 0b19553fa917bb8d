"""Products open in xarray by our engine, with what their root says, and by the usual ones."""

import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import sounder
from erm.common.errors import DataError
from erm.common.storage import write_product
from sounder import shipped
from sounder.products.engine import ProductEngine

pytestmark = pytest.mark.slow

PROJECT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def product(tmp_path_factory):
    recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    jobs, _ = sounder.gather(recordings, calibration=b2b)
    return sounder.process(jobs, tmp_path_factory.mktemp("products")).products[0]


def test_a_group_has_the_facts_of_its_position(product):
    mpcs = xr.open_dataset(product, engine=ProductEngine)
    plain = xr.open_dataset(product, group="/mpc", engine="h5netcdf")
    root = xr.open_dataset(product, engine="h5netcdf")
    for name in plain.data_vars:
        xr.testing.assert_identical(mpcs[name].reset_coords(drop=True), plain[name].reset_coords(drop=True))
    assert mpcs["position"].item() == root["position"].item()
    np.testing.assert_array_equal(mpcs["tx_position"], root["tx_position"][0])
    assert (mpcs.attrs["frequency"], mpcs.attrs["los"]) == (root.attrs["frequency"], root.attrs["los"])
    less = xr.open_dataset(product, engine=ProductEngine, group="/daps", drop_variables=["daps"])
    assert "daps" not in less
    assert "pdp" in less


def test_the_tree_is_that_of_the_file(product):
    ours = xr.open_datatree(product, engine=ProductEngine)
    with xr.open_datatree(product, engine="h5netcdf") as theirs:
        assert set(ours.children) == set(theirs.children)
        for name in ours.children:
            xr.testing.assert_identical(ours[name].to_dataset(), theirs[name].to_dataset().load())


def test_views(product):
    mpcs = xr.open_dataset(product, engine=ProductEngine)
    daps = xr.open_dataset(product, engine=ProductEngine, group="/daps")
    direct = mpcs.sounder.distance / 299792458
    np.testing.assert_allclose(mpcs.sounder.excess_delay, mpcs["delay"] - direct)
    np.testing.assert_allclose(mpcs.sounder.path_length, mpcs["delay"] * 299792458)
    expected = sounder.channel_parameters([product])[0]
    for name in ("rms_delay_spread", "path_loss", "k_los"):
        assert mpcs.sounder.parameters()[name].item() == expected[name].item()
    assert daps.sounder.parameters("12,40")["mpcs"] > 2  # samples
    assert float(daps.sounder.over_noise().max()) > 40
    figure = plt.figure()
    daps.sounder.plot_daps(figure.add_subplot(131), mpcs=mpcs)
    daps.sounder.plot_pdp(figure.add_subplot(132))
    daps.sounder.plot_polar(figure.add_subplot(133, projection="polar"))
    plt.close(figure)
    with pytest.raises(DataError, match="the dataset has no daps; open group"):
        mpcs.sounder.over_noise()


def test_files_of_others_are_left_to_others(product, tmp_path):
    engine = ProductEngine()
    write_product({"/": xr.Dataset({"a": ("x", [1.0])})}, tmp_path / "other.h5")
    (tmp_path / "text.nc").write_text("nothing", encoding="utf-8")
    known = [engine.guess_can_open(path) for path in (product, tmp_path / "other.h5", tmp_path / "text.nc", 7)]
    assert known == [True, False, False, False]


def test_the_engine_is_installed_by_its_name():
    points = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    assert points["xarray.backends"] == {"sounder": f"{ProductEngine.__module__}:{ProductEngine.__name__}"}


def test_flags_and_errors_are_told_as_cf_does(product):
    mpcs = xr.open_dataset(product, engine=ProductEngine)
    assert mpcs["delay"].attrs["ancillary_variables"] == "delay_std"
    wrapped = mpcs["may_be_wrapped"]
    assert list(np.atleast_1d(wrapped.attrs["flag_values"])) == [0, 1]
    assert len(wrapped.attrs["flag_meanings"].split()) == 2
    assert all("standard_name" not in mpcs[name].attrs for name in mpcs.variables)

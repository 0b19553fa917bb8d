"""`sounder figures`: a picture of every product, and of two together."""

import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.figures import processes

from .commands import digest, names, run


@pytest.mark.parametrize("suffix", ["png", "svg"])
@pytest.mark.slow
def test_figures_of_every_product_and_of_two_together(products, tmp_path, suffix):
    both = products / "RX1.h5", products / "RX2.h5"
    assert run("figures", *both, "--overlay", "--out", tmp_path, "--format", suffix) == 0
    kinds = ("daps", "daps_polar", "pdp")
    expected = {f"RX{i}_{kind}.{suffix}" for i in (1, 2) for kind in kinds} | {f"RX1_RX2_daps_polar.{suffix}"}
    assert set(names(tmp_path)) == expected
    assert all(path.stat().st_size > 5000 for path in tmp_path.iterdir())


@pytest.mark.slow
def test_figures_name_what_is_no_product_and_draw_the_rest(campaign, products, tmp_path, capsys):
    assert run("figures", campaign / "raw" / "RX1.h5", products / "RX1.h5", "--out", tmp_path) == 1
    error = capsys.readouterr().err
    assert str(campaign / "raw" / "RX1.h5") in error
    assert error.count("\n") == 1
    assert len(names(tmp_path)) == 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "change", "told"),
    [
        ("figures", lambda file: file["daps/delay"].write_direct(np.full(file["daps/delay"].shape, 1e308)), "a delay"),
        ("figures", lambda file: file["mpc/delay"].write_direct(np.full(file["mpc/delay"].shape, 1e308)), "a delay"),
        ("report", lambda file: file.attrs.__delitem__("processing_options"), "has no processing_options"),
        (
            "report",
            lambda file: file["daps/azimuth"].attrs.__delitem__("REFERENCE_LIST"),
            "daps is float32 along (axis_",
        ),
        ("report", lambda file: file.attrs.create("input_sha256", "{"), "input_sha256 is '{'; expected a table"),
    ],
)
def test_what_cannot_be_of_a_product_is_refused_by_name(products, tmp_path, capsys, command, change, told):
    path = shutil.copy(products / "RX1.h5", tmp_path)
    with h5py.File(path, "r+") as file:
        change(file)
    assert run(command, path, "--out", tmp_path / ("out" if command == "figures" else "r.html")) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"RX1.h5: {told}" in line


@pytest.mark.slow
def test_a_panel_for_each_elevation_on_request(products, tmp_path):
    assert run("figures", products / "RX1.h5", "--elevations", "--out", tmp_path / "out") == 0
    assert (tmp_path / "out" / "RX1_elevations.png").stat().st_size > 10_000


def drawn(wanted, out) -> list[tuple[list[Path], str]]:
    with processes.Drawing(out) as drawing:
        for product in wanted:
            drawing.order(product)
        return list(drawing.results())


@pytest.mark.slow
def test_several_processes_draw_the_same_as_this_one(campaign, products, tmp_path, monkeypatch):
    wanted = [campaign / "raw" / "RX1.h5", products / "RX1.h5"]
    alone = drawn(wanted, tmp_path / "alone")
    monkeypatch.setattr(processes, "PRODUCTS_PER_PROCESS", 1)
    monkeypatch.setattr(processes, "processors", lambda: 2)
    shared = drawn(wanted, tmp_path / "shared")
    assert [len(files) for files, _ in shared] == [0, 3]
    assert [failure for _, failure in shared] == [failure for _, failure in alone]
    assert "raw" in alone[0][1]
    assert digest(tmp_path / "shared") == digest(tmp_path / "alone")


def test_a_process_that_was_killed_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "PRODUCTS_PER_PROCESS", 1)
    monkeypatch.setattr(processes, "processors", lambda: 2)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    monkeypatch.setattr(processes.confined, "start", lambda *_: subprocess.Popen(["true"], **pipes))
    wanted = [tmp_path / "RX1.h5", tmp_path / "RX2.h5"]
    with pytest.raises(DataError, match=r"RX1\.h5: not drawn .* draw it again"):
        drawn(wanted, tmp_path)

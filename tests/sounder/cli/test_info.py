"""`sounder info`: what a file holds, and its health."""

import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest
from scipy.constants import c

from .commands import facts, group, run


def test_info_describes_a_recording(campaign, capsys):
    assert run("info", campaign / "raw" / "RX1.h5") == 0
    shown = facts(capsys)
    assert shown["kind"] == "raw recording"
    assert shown["position"] == "RX1"
    assert shown["line of sight"] == "yes"
    assert shown["sounder"] == "small sounder, 132 GHz"
    assert shown["waveform"] == "order 7, 2 samples per chip, 254 samples at 1.2 GS/s, 211.67 ns"
    assert shown["directions"] == "12 azimuths x 2 elevations"
    assert shown["RX position"] == "12.00, 3.00, 1.50 m"
    assert shown["health"] == "no direction missing, none zero, none clipped"
    # 10 dBm + 20 dBi + 15 dBi, the horn up to 15 degrees off (3 dB at most), 8.4 m of free space; the walls add little
    direct = 45 + 20 * np.log10(c / 132e9 / (4 * np.pi * np.sqrt(8**2 + 2**2 + 1.5**2)))
    highest = float(shown["received power"].split(" to ")[1].split(" dBm")[0])
    assert direct - 6 < highest < direct + 1


@pytest.mark.slow
def test_info_describes_back_to_back_and_product(campaign, products, capsys):
    assert run("info", campaign / "back-to-back.h5") == 0
    shown = facts(capsys)
    assert shown["kind"] == "back-to-back recording"
    assert shown["attenuation"] == "60 dB (nominal)"
    assert shown["sequence found"].startswith("order 7, polynomial [7, 1, 0] forward, ")
    assert run("info", products / "RX2.h5") == 0
    shown = facts(capsys)
    assert shown["kind"] == "product of sounder process"
    assert int(shown["MPCs"]) == group(products / "RX2.h5", "/mpc").sizes["mpc"]
    assert "0 directions missing" in shown["health"]


@pytest.mark.parametrize("file", ["products/RX1.h5", "raw/RX1.h5"])
@pytest.mark.slow
def test_info_imports_nothing_that_computes(campaign, products, file):
    heavy = ("numba", "scipy", "matplotlib", "dask", "xarray")
    program = (
        "import sys\n"
        "from sounder import cli\n"
        f"sys.argv = ['sounder', 'info', {str(campaign / file)!r}]\n"
        "try:\n    cli.main()\n"
        "except SystemExit as stop:\n    assert not stop.code\n"
        f"print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.slow
def test_info_names_what_a_broken_product_lacks(products, tmp_path, capsys):
    shutil.copy(products / "RX1.h5", tmp_path / "broken.h5")
    with h5py.File(tmp_path / "broken.h5", "r+") as file:
        del file.attrs["los"]
    assert run("info", tmp_path / "broken.h5") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{tmp_path / 'broken.h5'}: ")
    assert "no attribute los" in line


def test_info_describes_other_files_of_this_software(campaign, capsys):
    assert run("info", campaign / "truth" / "paths.h5") == 0
    shown = facts(capsys)
    assert shown["kind"] == "Traced propagation paths of all positions"
    assert shown["made by"] == "sounder simulate room"
    assert " path" in shown["holds"]


def test_info_says_how_much_of_a_file_is_there(copied, capsys):
    whole = (copied / "RX1.h5").read_bytes()
    (copied / "RX1.h5").write_bytes(whole[:5000])
    assert run("info", copied / "RX1.h5") == 1
    assert f"damaged HDF5 file (5000 of its {len(whole)} bytes); make or copy it again" in capsys.readouterr().err


def test_info_describes_a_foreign_file(campaign, joined, capsys):
    assert run("info", joined, "--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml") == 0
    out = capsys.readouterr().out
    assert out.count("raw recording") == 2
    assert out.count("sounder\tsmall sounder, 132 GHz") == 3
    assert out.count("back-to-back recording") == 1


def test_the_shipped_sounder_does_not_give_its_name_to_another(joined, capsys):
    layout = ("--layout", joined.with_name("layout.toml"))
    for command in (
        ("info", joined),
        ("process", joined, "--out", joined.parent),
        ("convert", joined, "--out", joined.parent / "x"),
    ):
        assert run(*command, *layout) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"{joined}: 254 samples per capture, but sounder of layout.toml describes 1022 ")
        assert line.endswith(" (all 2 positions of foreign.h5)")


@pytest.mark.slow
def test_many_positions_are_a_line_each_unless_all_is_asked_for(campaign, joined, capsys):
    with h5py.File(joined, "r+") as file:
        for name in ("iq", "agc_gain", "tx_position", "rx_position"):
            attributes, twice = dict(file[name].attrs), np.concatenate([file[name][()]] * 2)
            del file[name]
            file[name] = twice
            file[name].attrs.update(attributes)
        file["rx_position"][3] = 14, -1e-4, 1.5
    command = ("info", joined, "--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml")
    assert run(*command) == 0
    out = capsys.readouterr().out
    common, _, positions = out.partition("\nposition\t")
    assert "TX position\t4.00, 5.00, 3.00 m\n" in common
    assert common.endswith("\npositions\t4")
    header, *rows = positions.splitlines()[:5]  # the name stands first
    assert header.split("\t") == ["RX position", "received power"]
    assert [row.split("\t")[0] for row in rows] == ["P0", "P1", "P2", "P3"]
    assert rows[3].split("\t")[1] == "14.00, 0.00, 1.50 m"  # a tenth of a millimetre south is no minus
    assert run(*command, "--each") == 0
    assert capsys.readouterr().out.count("raw recording") == 4

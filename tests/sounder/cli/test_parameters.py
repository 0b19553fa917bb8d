"""Parameters of products as tables: CSV with definitions, LaTeX, HDF5, and the point data of groups."""

import csv

import numpy as np
import pytest
import xarray as xr

import erm
from erm.common.storage import SOFTWARE, sha256

from .commands import run


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def files(products):
    return [products / f"RX{i}.h5" for i in (1, 2)]


@pytest.mark.slow
def test_tables_of_a_campaign(files, tmp_path, capsys):
    outputs = {"--out": "all.csv", "--statistics": "statistics.csv", "--point-data": "points.csv"}
    arguments = [part for option, name in outputs.items() for part in (option, tmp_path / name)]
    assert run("parameters", *files, *arguments, "--clusters", "k-power-means") == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "rms_delay_spread\tns\t" in printed.out
    assert "from MPCs; threshold: MPCs extracted with at most 0.05 false MPCs a position by noise" in printed.out

    first, second = rows(tmp_path / "all.csv")
    mpcs = xr.open_dataset(files[0], group="/mpc", engine="h5netcdf")
    assert (first["position"], first["los"], second["position"]) == ("RX1", "1", "RX2")
    power = 10 ** (mpcs["path_gain"].values / 10)
    assert float(first["path_loss"]) == pytest.approx(-10 * np.log10(power.sum()))
    assert float(first["rms_delay_spread_std"]) > 0
    assert int(first["mpcs"]) == mpcs.sizes["mpc"]
    assert float(first["distance"]) == pytest.approx(np.linalg.norm([12 - 4, 3 - 5, 1.5 - 3]))
    assert (first["source"], first["antennas"], first["sha256"]) == ("mpcs", "removed", sha256(files[0]))

    statistics = rows(tmp_path / "statistics.csv")
    assert {"median", "p10", "p90", "exponent", "shadowing"} <= {row["statistic"] for row in statistics}
    assert all(row["definition"] for row in statistics)

    point, _ = rows(tmp_path / "points.csv")
    assert list(point)[:8] == ["Freq.", "TX", "RX", "Loc Type", "TR Sep", "PL", "Mean Dir DS", "Omni DS"]
    assert (point["Freq."], point["TX"], point["RX"], point["Loc Type"]) == ("132", "TX1", "RX1", "LOS")
    assert float(point["Omni DS"]) == pytest.approx(1e9 * float(first["rms_delay_spread"]))
    assert float(point["PL"]) == pytest.approx(float(first["path_loss"]))
    assert float(point["Omni ASA"]) == pytest.approx(float(first["azimuth_spread_arrival"]))
    assert 0 <= float(point["Mean Dir DS"]) < 200
    assert 0 < float(point["Mean Lobe ASA"]) < 60
    assert (point["Mean Lobe ASD"], point["Omni ASD"], point["software"]) == ("", "", SOFTWARE)


@pytest.mark.slow
def test_latex_and_hdf5(files, tmp_path):
    assert run("parameters", *files, "--out", tmp_path / "a.tex", "--statistics", tmp_path / "b.tex") == 0
    for name in ("a.tex", "b.tex"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        body = [line for line in text.splitlines() if "&" in line]
        assert text.startswith("% ")
        assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == 1
        assert len({line.count("&") for line in body}) == 1  # as many cells in each row
        assert "nan" not in text
        assert "% RMS delay spread: square root of the second central moment of delay; ITU-R P.1407 2.2.3" in text
        assert "% from MPCs; threshold: " in text
    assert run("parameters", files[0], "--out", tmp_path / "a.h5") == 0
    with xr.open_dataset(tmp_path / "a.h5", engine="h5netcdf") as made:
        assert made["rms_delay_spread"].attrs["units"] == "s"
        assert "P.1407 2.2.3" in made["rms_delay_spread"].attrs["definition"]
        assert made.sizes["position"] == 1


@pytest.mark.slow
def test_a_table_of_mpcs_gives_the_parameters_of_its_products(files, tmp_path):
    table, problems = erm.read_mpcs(files)
    assert not problems
    erm.write_mpcs(table, tmp_path / "mpcs.csv")
    assert run("parameters", files[1], "--out", tmp_path / "a.csv") == 0
    assert run("parameters", tmp_path / "mpcs.csv", "--out", tmp_path / "b.csv") == 0
    both = rows(tmp_path / "b.csv")
    assert [row["position"] for row in both] == ["RX1", "RX2"]
    for ours, theirs in zip(rows(tmp_path / "a.csv"), both[1:], strict=True):
        for name in ("position", "path_loss", "rms_delay_spread", "azimuth_spread_arrival", "k_strongest"):
            assert ours[name] == theirs[name]
        assert "does not say" in theirs["threshold"]


@pytest.mark.slow
def test_thresholds_and_profiles(files, tmp_path, capsys):
    assert run("parameters", files[0], "--from", "pdp", "--threshold", "12,30", "--out", tmp_path / "b.csv") == 0
    profile = rows(tmp_path / "b.csv")[0]
    assert (profile["source"], profile["azimuth_spread_arrival"]) == ("pdp", "")
    assert profile["antennas"] == "removed (PDP: synthesis)"
    # the synthesis has the powers of the MPCs, so that the losses agree
    assert run("parameters", files[0], "--threshold", "0,60", "--out", tmp_path / "c.csv") == 0
    selected = rows(tmp_path / "c.csv")[0]
    assert selected["threshold"].startswith(
        "60 dB under the strongest; of MPCs extracted with at most 0.05 false MPCs a position by noise"
    )
    whole = float(selected["path_loss"])
    assert float(profile["path_loss"]) == pytest.approx(whole, abs=0.05)
    capsys.readouterr()
    assert run("parameters", files[0], "--threshold", "90") == 0
    assert "note: RX1.h5: RX1: no path counts (90 dB over noise; of MPCs extracted" in capsys.readouterr().err


@pytest.mark.slow
def test_what_cannot_be_used_is_said(files, tmp_path, capsys):
    (tmp_path / "text.h5").write_text("nothing", encoding="utf-8")
    assert run("parameters", tmp_path / "text.h5", files[0]) == 1
    assert "text.h5: not an HDF5 file" in capsys.readouterr().err
    assert run("parameters", files[0], "--out", tmp_path / "a.txt") == 2
    assert run("parameters", files[0], "--out", files[0]) == 2
    assert run("parameters", files[0], "--threshold", "loud") == 2
    assert "threshold is 'loud'" in capsys.readouterr().err

"""The command line: exit codes, one line an error, files whole or not at all."""

import hashlib
import json
import subprocess
import sys
import time
from importlib.metadata import EntryPoint, version
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import c

from erm import cli
from erm.environment import Environment
from erm.geometry import azimuth_of, mirrored
from erm.mpc_table import make_table, read_csv, write_csv

TX = np.array([-40.0, 3.0, 12.0])
WALL = (90.0, -9.0)  # y = -9


@pytest.fixture
def mpcs(tmp_path: Path) -> Path:
    """Six positions along a street that see one wall."""
    rx = np.column_stack([np.linspace(-20, 30, 6), np.linspace(-2, 4, 6), np.full(6, 1.5)])
    tx = np.tile(TX, (6, 1))
    seen = mirrored(tx, *WALL) - rx[:, :2]
    length = np.hypot(np.linalg.norm(seen, axis=-1), TX[2] - 1.5)
    gain = 20 * np.log10(c / 132e9 / (4 * np.pi * length)) - 6
    table = make_table(
        {"position": np.array([f"RX{i}" for i in range(6)]), "tx_position": tx, "rx_position": rx}
        | {"frequency": 132e9, "delay": length / c, "azimuth": azimuth_of(seen), "path_gain": gain}
    )
    write_csv(table, tmp_path / "mpcs.csv")
    return tmp_path / "mpcs.csv"


def run(*arguments) -> int:
    """Run the command in this process as a shell would."""
    old, sys.argv = sys.argv, ["erm", *map(str, arguments)]
    try:
        with pytest.raises(SystemExit) as stop:
            cli.main()
    finally:
        sys.argv = old
    return int(stop.value.code or 0)


def test_positions_are_added_to_a_map_file(tmp_path: Path, mpcs: Path, capsys):
    header, *rows = mpcs.read_text().splitlines()
    for name, part in (("first", rows[:4]), ("second", rows[4:])):
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *part]) + "\n")
    assert run("reconstruct", tmp_path / "first.csv", "--out", tmp_path / "map.h5") == 0
    assert (
        run("reconstruct", tmp_path / "second.csv", "--add-to", tmp_path / "map.h5", "--out", tmp_path / "all.h5") == 0
    )
    assert "1 wall and 0 poles from 6 of 6 components" in capsys.readouterr().out
    assert (
        run("reconstruct", tmp_path / "second.csv", "--add-to", tmp_path / "map.h5", "--out", tmp_path / "map.h5") == 2
    )
    assert "is an input, which would be replaced" in capsys.readouterr().err


def test_mpcs_become_a_map_that_predicts_them(tmp_path: Path, mpcs: Path, capsys):
    out, rps, figure = tmp_path / "map.geojson", tmp_path / "rps.csv", tmp_path / "map.png"
    assert run("reconstruct", mpcs, "--out", out, "--rps", rps, "--figure", figure) == 0
    printed = capsys.readouterr()
    assert "1 wall and 0 poles from 6 of 6 components" in printed.out
    assert printed.err == ""
    wall = Environment.read(out).reflectors.isel(reflector=0)
    assert wall["offset"].item() == pytest.approx(-9, abs=1e-3)
    assert figure.stat().st_size > 1000
    header, *rows = rps.read_text().splitlines()
    assert header.startswith("position,wall,rp_x,rp_y,rp_z")
    assert len(rows) == 6

    assert run("predict", out, "--tx", -40, 3, 12, "--rx", -10, -0.8, 1.5, "--out", tmp_path / "p.csv") == 0
    table, complaints = read_csv(tmp_path / "p.csv")
    assert complaints == []
    measured, _ = read_csv(mpcs)
    reflected = table["delay"].values[1]
    assert table["los"].values.tolist() == [1, 1]
    assert reflected == pytest.approx(measured["delay"].values[1], abs=1e-12)
    assert capsys.readouterr().out.splitlines()[0].split("\t")[0] == "delay [ns]"


@pytest.mark.parametrize("suffix", ["h5", "geojson", "gpkg", "csv"])
def test_a_map_tells_where_it_came_from(tmp_path: Path, mpcs: Path, suffix):
    other, out = tmp_path / "other" / "mpcs.csv", tmp_path / f"map.{suffix}"
    other.parent.mkdir()
    other.write_text(mpcs.read_text().splitlines()[0] + "\n")
    assert run("reconstruct", mpcs, other, "--out", out, "--max-loss", 9, "--min-support", 2, "--ground", -1) == 0
    told = Environment.read(out).reflectors.attrs
    assert told["history"] == "erm reconstruct"
    assert json.loads(told["input_sha256"]) == {
        f"{path.parent.name}/mpcs.csv": hashlib.sha256(path.read_bytes()).hexdigest() for path in (mpcs, other)
    }
    assert json.loads(told["processing_options"]) == {
        "threshold": "consistency",
        "max_reflection_loss": 9,
        "min_support": 2,
        "ground_height": -1,
        "rx_std": 0,
    }


def test_a_map_is_judged_with_and_without_its_points(tmp_path: Path, mpcs: Path, capsys):
    out, outline = tmp_path / "map.h5", tmp_path / "outline.geojson"
    Environment.walls([[[-60, -9.1], [60, -9.1]]]).write(outline)
    assert run("reconstruct", mpcs, "--out", out) == 0
    capsys.readouterr()
    assert run("evaluate", out, mpcs, "--outline", outline, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert result["walls"]["found"] == 1
    assert result["walls"]["offset_error"]["rmse"] == pytest.approx(0.1, abs=1e-3)
    assert result["points"]["single"]["perpendicular"]["mean"] == pytest.approx(0.1, abs=1e-3)
    assert result["points"]["planar"]["perpendicular"]["mean"] > 0.3
    assert result["visible"][0]["length"] == pytest.approx(120)  # every receiver sees the one wall
    assert 0 < result["visible"][0]["share"] < 0.5  # of which only the middle reflected
    assert run("evaluate", out, "--outline", outline) == 0
    assert "1 wall, 0 false; on 1 of 1 face of the outline" in capsys.readouterr().out


def test_errors_of_millimetres_are_told(tmp_path: Path, capsys):
    Environment.walls([[[-60, 0], [60, 0]]]).write(tmp_path / "map.h5")
    Environment.walls([[[-60, 0.00312], [60, 0.00312]], [[-60, 20], [60, 20]]]).write(tmp_path / "outline.geojson")
    assert run("evaluate", tmp_path / "map.h5", "--outline", tmp_path / "outline.geojson") == 0
    walls, header, offset, _ = capsys.readouterr().out.splitlines()
    assert walls == "1 wall, 0 false; on 1 of 2 faces of the outline, seen by a receiver or not"
    told = dict(zip(header.split("\t"), offset.split("\t"), strict=True))
    assert (told["error"], told["count"], told["rmse"]) == ("walls: offset [m]", "1", "0.00312")


def test_an_input_is_never_replaced(tmp_path: Path, mpcs: Path, capsys):
    out = tmp_path / "map.csv"
    assert run("reconstruct", mpcs, "--out", out) == 0
    before = mpcs.read_bytes(), out.read_bytes()
    capsys.readouterr()
    ends = ("--tx", -40, 3, 12, "--rx", 0, 0, 1.5)
    for arguments, path in (
        (("reconstruct", mpcs, "--out", mpcs), mpcs),
        (("reconstruct", mpcs, "--out", tmp_path / "other.h5", "--rps", mpcs), mpcs),
        (("predict", out, *ends, "--out", out), out),
        (("export", out, "--out", out, "--origin", 48, 11), out),
    ):
        assert run(*arguments) == 2
        assert capsys.readouterr().err == f"{path}: is an input, which would be replaced; choose another output\n"
    assert (mpcs.read_bytes(), out.read_bytes()) == before
    assert run("predict", out, *ends, "--out", tmp_path / "paths.geojson") == 2
    assert "unknown format '.geojson'; choose .csv" in capsys.readouterr().err


def test_no_path_is_said(tmp_path: Path, capsys):
    Environment.walls([[[-9, 5], [9, 5]]]).write(tmp_path / "map.h5")
    assert run("predict", tmp_path / "map.h5", "--tx", 0, 0, 9, "--rx", 0, 9, 2) == 0
    assert capsys.readouterr().err == "no path of at most 2 reflections from TX to RX\n"


def test_a_suffix_that_is_not_known_is_told_before_anything_is_written(tmp_path: Path, mpcs: Path, capsys):
    out = tmp_path / "map.h5"
    for option, name in (("--rps", "points.xlsx"), ("--figure", "map.docx"), ("--figure", "map"), ("--out", "map.xyz")):
        assert run("reconstruct", mpcs, "--out", out, option, tmp_path / name) == 2
        assert capsys.readouterr().err.startswith(f"{tmp_path / name}: unknown format {Path(name).suffix!r}; choose .")
    assert not out.exists()
    assert run("letter", "--out", out) == 2
    assert "looks like a file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["reconstruct", "{mpcs}", "--out", "{map}", "--max-loss", "nan"], "nan"),
        (["reconstruct", "{mpcs}", "--out", "{map}", "--max-loss", "0"], "0.0 dB"),
        (["reconstruct", "{mpcs}", "--out", "{map}", "--max-loss", "-3"], "-3"),
        (["reconstruct", "{mpcs}", "--out", "{map}", "--ground", "nan"], "nan"),
        (["reconstruct", "{mpcs}", "--out", "{map}", "--rx-std", "nan"], "nan"),
        (["predict", "{map}", "--tx", 1, 2, 3, "--rx", 1, 2, 3], "expected two places"),
        (["predict", "{map}", "--tx", 1, 2, "nan", "--rx", 1, 2, 3], "nan"),
        (["predict", "{map}", "--tx", 1, 2, 3, "--rx", 1, 2, 4, "--frequency", "inf"], "inf"),
        (["predict", "{map}", "--tx", 1, 2, 3, "--rx", 1, 2, 4, "--frequency", "132"], "132"),
        (["evaluate", "{map}", "--outline", "{outline}", "--z-slice", "nan"], "nan"),
        (["evaluate", "{map}", "--outline", "{outline}", "--min-visible", "2"], "2"),
        (["export", "{map}", "--out", "{map}.csv", "--origin", 91, 0], "91"),
        (["export", "{map}", "--out", "{map}.obj", "--height", "nan"], "nan"),
        (["export", "{map}", "--out", "{map}.kml"], "'.kml'"),
    ],
)
def test_a_value_that_cannot_be_is_told_in_one_line_and_2(tmp_path: Path, mpcs: Path, capsys, arguments, found):
    names = {"map": tmp_path / "map.h5", "mpcs": mpcs, "outline": tmp_path / "outline.geojson"}
    for name in ("map", "outline"):
        Environment.walls([[[0, 0], [1, 0]]]).write(names[name])
    before = sorted(tmp_path.iterdir())
    assert run(*(str(argument).format(**names) for argument in arguments)) == 2
    error = capsys.readouterr().err
    assert found in error
    assert error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_the_letter_asks_for_an_instrument_where_none_is_installed(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.setattr("erm.letter.captures.entry_points", lambda group: ())
    assert run("letter", "--out", tmp_path / "letter") == 1
    error = capsys.readouterr().err
    assert error.startswith("entry point erm.captures: ")
    assert "pip install sounder-to-map" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "letter").exists()


def test_an_instrument_that_cannot_be_imported_is_named_in_one_line(tmp_path: Path, capsys, monkeypatch):
    twin = EntryPoint("twin", "no_such_instrument.captures", "erm.captures")
    monkeypatch.setattr("erm.letter.captures.entry_points", lambda group: (twin,))
    assert run("letter", "--out", tmp_path / "letter") == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "no_such_instrument.captures makes the captures" in told
    assert not (tmp_path / "letter").exists()


def test_a_bad_file_is_named_the_rest_is_done_and_the_exit_code_is_1(tmp_path: Path, mpcs: Path, capsys):
    with mpcs.open("a") as file:
        file.write("RX9,,-40,3,12,nan,0,1.5,132e9,3e-7,0,,-110\n")
    out = tmp_path / "map.h5"
    assert run("reconstruct", tmp_path / "none.csv", mpcs, "--out", out) == 1
    printed = capsys.readouterr()
    assert printed.err.splitlines() == [
        f"{tmp_path / 'none.csv'}: no such file",
        f"{mpcs}: 1 of 7 rows dropped: rx_x is not a number (first: line 8)",
    ]
    assert Environment.read(out).reflectors.sizes["reflector"] == 1


def test_nothing_usable_writes_nothing(tmp_path: Path, capsys):
    out = tmp_path / "map.h5"
    assert run("reconstruct", tmp_path / "none.csv", "--out", out) == 1
    assert "not written" in capsys.readouterr().err
    assert not out.exists()


def test_no_components_are_an_empty_map(tmp_path: Path, mpcs: Path):
    mpcs.write_text(mpcs.read_text().splitlines()[0] + "\n")
    assert run("reconstruct", mpcs, "--out", tmp_path / "map.csv") == 0
    assert Environment.read(tmp_path / "map.csv").reflectors.sizes["reflector"] == 0


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["predict", "{none}", "--tx", 1, 2, 3, "--rx", 4, 2, 3], "no such file"),
        (["evaluate", "{map}", "--outline", "{none}"], "none.h5: "),
        (["evaluate", "{none}", "{mpcs}", "--leave-one-out"], "none.h5: "),
        (["predict", "{folder}", "--tx", 1, 2, 3, "--rx", 4, 2, 3], "is a folder"),
        (["predict", "{text}", "--tx", 1, 2, 3, "--rx", 4, 2, 3], "unknown format '.txt'; expected a map: .h5"),
        (["reconstruct", "{empty}", "{mpcs}", "--out", "{map}"], "empty.h5: is empty"),
        (["reconstruct", "{other}", "{mpcs}", "--out", "{map}"], "other.csv: not an MPC table; expected the header"),
    ],
)
def test_an_error_is_one_line(tmp_path: Path, mpcs: Path, capsys, arguments, complaint):
    names = {"map": tmp_path / "map.h5", "none": tmp_path / "none.h5", "mpcs": mpcs, "folder": tmp_path}
    names |= {"empty": tmp_path / "empty.h5", "other": tmp_path / "other.csv", "text": tmp_path / "map.txt"}
    Environment.walls([[[0, 0], [1, 0]]]).write(names["map"])
    names["empty"].touch()
    for name in ("other", "text"):
        names[name].write_text("wall,1\n")
    assert run(*(str(argument).format(**names) for argument in arguments)) == 1
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["reconstruct"],
        ["predict", "m.h5", "--tx", 1, 2],
        ["letter"],
        ["wrong"],
        ["evaluate", "m.h5"],
        ["evaluate", "m.h5", "mpcs.csv", "--outline", "o.geojson", "--leave-one-out"],
    ],
)
def test_wrong_usage_exits_with_2(arguments):
    assert run(*arguments) == 2


def test_version_and_a_line_for_each_command(monkeypatch, capsys):
    assert run("--version") == 0
    assert capsys.readouterr().out == f"sounder-to-map {version('sounder-to-map')}\n"
    monkeypatch.setenv("COLUMNS", "80")
    assert run("--help") == 0
    told = capsys.readouterr().out
    assert "Reconstruct the environment from multipath components" in told
    assert "..." not in told.partition("Commands:")[2]


def test_help_is_quick():
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "erm.cli", "--help"], check=True, capture_output=True)
    # 0.35 s alone; numpy, xarray or pyplot would each add what tells them, on a busy machine too
    assert time.perf_counter() - start < 3
    heavy = "import erm.cli, sys; sys.exit(any(name in sys.modules for name in ('numpy', 'xarray', 'matplotlib')))"
    assert subprocess.run([sys.executable, "-c", heavy], check=False).returncode == 0

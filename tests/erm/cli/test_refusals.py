"""What the command line refuses: exit codes, one line an error, files whole or not at all."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map

from .commands import run


@pytest.mark.slow
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
    both = tmp_path / "both.csv"
    assert run("reconstruct", mpcs, "--out", both, "--rps", tmp_path / "." / "both.csv") == 2
    assert "both.csv: is given for two outputs; choose a different file for each" in capsys.readouterr().err
    assert not both.exists()
    assert (mpcs.read_bytes(), out.read_bytes()) == before
    assert run("predict", out, *ends, "--out", tmp_path / "paths.geojson") == 2
    assert "unknown format '.geojson'; choose .csv" in capsys.readouterr().err


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
        (["predict", "{map}", "--tx", 1, 2, 3, "--rx", 1, 2, 3], "expected two different positions"),
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
        write_map(Environment.walls([[[0, 0], [1, 0]]]), names[name])
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


@pytest.mark.slow
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
    assert read_map(out).reflectors.sizes["reflector"] == 1


def test_nothing_usable_writes_nothing(tmp_path: Path, capsys):
    out = tmp_path / "map.h5"
    assert run("reconstruct", tmp_path / "none.csv", "--out", out) == 1
    assert "not written" in capsys.readouterr().err
    assert not out.exists()


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
    write_map(Environment.walls([[[0, 0], [1, 0]]]), names["map"])
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

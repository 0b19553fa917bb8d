"""A sounder description is accepted whole or refused with a line that names the key."""

import shutil
from pathlib import Path

import pytest

from erm.common.errors import DataError
from sounder import shipped
from sounder.instrument.description import Sounder, load_sounder

SHIPPED = shipped.calibration("sounder-132ghz.toml")


@pytest.fixture
def edited(tmp_path: Path):
    """Write the shipped description with lines replaced; returns its path."""
    shutil.copy(shipped.calibration("horn-132ghz.csv"), tmp_path)

    def edit(**replaced: str) -> Path:
        lines = SHIPPED.read_text(encoding="utf-8").splitlines()
        for old, new in replaced.items():
            table, _, key = old.rpartition("__")
            start = lines.index(f"[{table}]") + 1 if table else 0
            at = next(i for i in range(start, len(lines)) if lines[i].split(" = ")[0] == key)
            lines[at] = new
        path = tmp_path / "sounder.toml"
        path.write_text("\n".join(lines), encoding="utf-8")
        return path

    return edit


def test_the_shipped_sounder_is_the_letters():
    sounder = load_sounder(SHIPPED)
    assert sounder.carrier.frequency == 132e9 == 6 * 21e9 + 6e9
    assert sounder.waveform.samples == 1022
    assert sounder.waveform.period == pytest.approx(1022 / 1.2e9)
    assert len(sounder.scan.azimuth) == 36
    assert sounder.scan.elevation == (-9, 0, 9)
    assert sounder.rx_antenna.cut is not None


def test_a_description_survives_its_own_text():
    sounder = load_sounder(SHIPPED)
    assert Sounder.model_validate_json(sounder.model_dump_json()) == sounder


def test_another_sounder_is_another_file_and_no_code(edited):
    # order 11, 1 GHz chips at 3 samples per chip, 300 GHz, a horn by its beamwidths, a coarse half-circle
    path = edited(
        waveform__order="order = 11",
        waveform__polynomial="polynomial = [11, 2, 0]",
        waveform__direction='direction = "reversed"',
        waveform__chip_rate="chip_rate = 1e9",
        waveform__samples_per_chip="samples_per_chip = 3",
        waveform__sample_rate="sample_rate = 3e9",
        carrier__frequency="frequency = 300e9",
        carrier__lo_frequency="lo_frequency = 24.5e9",
        carrier__multiplier="multiplier = 12",
        rx_antenna__pattern='pattern = "gaussian"',
        rx_antenna__cut="",
        scan__elevation="elevation = [0]",
        processing__bandwidth="",
    )
    sounder = load_sounder(path)
    assert sounder.waveform.chips == 2047
    assert sounder.waveform.samples == 6141
    assert sounder.bandwidth == pytest.approx(0.9 * 2e9)  # the main lobe is two chip rates wide, narrower than 3 GHz
    assert sounder.scan.elevation == (0,)


@pytest.mark.parametrize(
    ("replaced", "expected"),
    [
        (
            {"carrier__frequency": "frequency = 140e9"},
            "carrier: frequency is 140 GHz, but lo_frequency x multiplier + if_frequency is 21 x 6 + 6 = 132 GHz",
        ),
        ({"waveform__sample_rate": "sample_rate = 1.25e9"}, "waveform: sample_rate is 1.25e+09 Hz"),
        ({"waveform__order": "order = 6"}, "waveform.order is 6; expected at least 7"),
        ({"waveform__order": "order = 9.5"}, "waveform.order is 9.5; expected a whole number"),
        ({"waveform__order": 'order = "nine"'}, "waveform.order is 'nine'; expected a whole number"),
        ({"waveform__order": "ordr = 9"}, "waveform.ordr: unknown key; did you mean order?"),
        ({"waveform__polynomial": "polynomial = 9"}, "waveform.polynomial is 9; expected a list"),
        ({"waveform__order": "order = 10"}, "waveform: polynomial is [9, 4, 0]"),
        ({"waveform__polynomial": "polynomial = []"}, "waveform: polynomial is []"),
        ({"waveform__polynomial": "polynomial = [4, 9, 0]"}, "waveform: polynomial is [4, 9, 0]"),
        (
            {"waveform__polynomial": "polynomial = [9, 4, 1]"},
            "expected exponents in descending order from 9 (the order) to 0",
        ),
        ({"waveform__polynomial": "polynomial = [9, 1, 0]"}, "which is not primitive: its sequence repeats after"),
        (
            {"waveform__direction": 'direction = "backward"'},
            "waveform.direction is 'backward'; expected 'forward' or 'reversed'",
        ),
        ({"waveform__samples_per_chip": "samples_per_chip = 5"}, "waveform.samples_per_chip is 5; expected at most 4"),
        ({"waveform__chip_rate": "chip_rate = nan"}, "waveform.chip_rate is nan; expected a finite number"),
        ({"carrier__multiplier": "multiplier = 0"}, "carrier.multiplier is 0; expected at least 1"),
        ({"transmitter__power": "power = 6e9"}, "transmitter.power is 6000000000.0; expected at most 1000"),
        ({"transmitter__power": "power = inf"}, "transmitter.power is inf; expected a finite number"),
        ({"transmitter__power": "power = 10\nvolume = 11"}, "transmitter.volume: unknown key; known are power"),
        ({"name": 'name = "x"\ncolour = "red"'}, "colour: unknown key"),
        ({"rx_antenna__hpbw_azimuth": ""}, "rx_antenna: pattern"),
        ({"rx_antenna__cut": ""}, 'rx_antenna: pattern "cut" and the key cut go together'),
        ({"rx_antenna__pattern": 'pattern = "dipole"'}, "rx_antenna.pattern is 'dipole'; expected 'gaussian'"),
        (
            {"scan__elevation": "elevation = [0, -9, 9]"},
            "scan: elevation must have one or more values in ascending order",
        ),
        ({"scan__elevation": "elevation = []"}, "scan: elevation must have one or more values in ascending order"),
        ({"scan__elevation": "elevation = [0, 91]"}, "scan: elevation must lie within -90 to 90 degree"),
        ({"scan__azimuth": "azimuth = [0, 360]\nunused = ["}, "scan"),
        (
            {"processing__bandwidth": "bandwidth = 1.2e9"},
            "processing.bandwidth is 1.2 GHz; expected less than 1.2 GHz",
        ),
        # 16 lines of 1 / 851.67 ns each
        (
            {"processing__bandwidth": "bandwidth = 1e3"},
            "processing.bandwidth is 1000 Hz; expected 1.87867e+07 Hz or more",
        ),
        (
            {"processing__bandwidth": "artefact = [{ delay = 0.0, level = -20.0 }]"},
            "delay is 0; expected the delay of the copy",
        ),
        (
            {"processing__bandwidth": "artefact = [{ delay = 1e-8, level = 3.0 }]"},
            "processing.artefact.0.level is 3.0; expected less",
        ),
    ],
)
def test_what_does_not_fit_is_named_in_one_line(edited, replaced, expected):
    path = edited(**replaced)
    with pytest.raises(DataError) as error:
        load_sounder(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert expected in message
    assert "\n" not in message


def test_a_scan_names_no_direction_twice():
    tables = load_sounder(SHIPPED).model_dump()
    tables["scan"]["azimuth"] = [0.0, 180.0, 360.0]
    with pytest.raises(DataError, match="azimuth spans 360 degree or more"):
        Sounder.from_tables(tables, "x")


def test_a_description_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        load_sounder(SHIPPED).waveform.order = 10  # type: ignore[misc] # what is tested


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "expected an antenna cut (CSV: angle,azimuth,elevation)"),
        ("", "not an antenna cut"),
        ("angle,gain\n0,0\n", "not an antenna cut; expected an antenna cut (CSV: angle,azimuth,elevation)"),
        ("angle,azimuth,elevation\n-90,-20,-20\n0,0\n90,-20,-20\n", "not an antenna cut"),
        (
            "angle,azimuth,elevation\n-90,-20,-20\n0,zero,0\n90,-20,-20\n",
            "could not convert string to float: 'zero'; expected numbers of an antenna cut",
        ),
        ("angle,azimuth,elevation\n-90,-20,-20\n0,nan,0\n90,-20,-20\n", "rx_antenna.cut.azimuth.1 is nan; expected"),
        ("angle,azimuth,elevation\n-90,-20,-20\n0,0,0\ninf,-20,-20\n", "rx_antenna.cut.angle.2 is nan; expected"),
        ("angle,azimuth,elevation\n0,0,0\n", "rx_antenna.cut: angle, azimuth and elevation must have one length"),
        ("angle,azimuth,elevation\n-90,-20,-20\n0,0,0\n1e-320,0,0\n", "ascending order, by 1e-06 degree or more"),
        ("angle,azimuth,elevation\n0,0,0\n10,-3,-3\n90,-20,-20\n", "reach to both sides of boresight"),
    ],
)
def test_a_file_that_is_no_antenna_cut_is_refused(edited, tmp_path, content, expected):
    path = edited()
    cut = tmp_path / "horn-132ghz.csv"
    cut.unlink()
    if content is not None:
        cut.write_text(content, encoding="utf-8")
    with pytest.raises(DataError) as error:
        load_sounder(path)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


def test_comments_in_a_cut_are_passed_over(edited, tmp_path):
    (tmp_path / "horn-132ghz.csv").write_text(
        "# a horn\nangle,azimuth,elevation\n# left\n-30,-20,-19\n0,0,0\n30,-20,-21\n\n", encoding="utf-8"
    )
    cut = load_sounder(edited()).rx_antenna.cut
    assert cut is not None
    assert cut.elevation == (-19, 0, -21)


@pytest.mark.parametrize(
    ("content", "expected"), [(None, "expected a TOML file"), (b"name = ", "not TOML"), (b"\xff\xfe\0\xd8", "not text")]
)
def test_a_file_that_is_no_toml_is_refused(tmp_path, content, expected):
    path = tmp_path / "x.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError, match=expected):
        load_sounder(path)

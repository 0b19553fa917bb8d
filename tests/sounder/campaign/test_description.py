"""A campaign file finds its recordings, and its errors are reported in one line."""

import re
from pathlib import Path

import pytest

from erm.common.errors import DataError
from erm.maps.georeference import Georeference
from sounder.campaign.description import load_campaign
from sounder.options import Options

EXAMPLES = Path(__file__).parents[3] / "examples" / "campaigns"
MINIMAL = '[recordings]\nfiles = ["*.h5"]\ncalibration = "b2b.h5"\n'
LAYOUT = """
[captures]
dataset = "iq"
axes = ["sample"]
[grid]
azimuth = [0]
elevation = [0]
[positions]
tx = [0, 0, 1]
rx = [1, 0, 1]
"""


@pytest.fixture
def campaign(tmp_path):
    """Load a campaign of some text."""

    def make(text: str, name: str = "street.toml"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return load_campaign(tmp_path / name)

    return make


def found(campaign, out: Path) -> list[str]:
    """What the campaign tries to open; no file here is a recording, so each is a failure that begins with its name."""
    jobs, failures = campaign.jobs(out)
    assert jobs == []
    return [Path(line.partition(": ")[0]).name for line in failures]


def test_recordings_and_calibration_are_all_that_must_be_said(campaign, tmp_path):
    made = campaign(MINIMAL)
    assert (made.name, made.out) == ("street", tmp_path / "street")
    assert made.recordings[0].calibration == tmp_path / "b2b.h5"
    assert made.processing.options == Options()
    # the defaults of `erm reconstruct`
    assert (made.map.threshold, made.map.max_loss, made.map.min_support) == ("consistency", None, 3)
    assert (made.map.ground, made.map.rx_std, made.map.georeference) == (0.0, None, None)
    assert made.map.formats == ("h5", "geojson")
    assert made.figures.wanted("anybody")


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ('"nyu"', "nyu"),
        ("12", "usc"),
        ('"10,30"', "10,30"),
        ('"cfar:0.01,30"', "cfar:0.01,30"),
        ("{ false_alarms = 0.05, dynamic_range = 40 }", "cfar,40"),
        ("{ noise_margin = 10, delay_gate = 4e-7 }", "10,inf,4e-07"),
        ('"loud"', "processing.threshold: found 'loud'; expected one of cfar, usc, nyu, or numbers"),
        ("{ noise = 10 }", "processing.threshold: found {'noise': 10}; expected a number for each of noise_margin"),
        ("{ noise_margin = -1 }", "processing.threshold: noise_margin is -1; expected 0 or more"),
    ],
)
def test_thresholds_are_names_or_numbers(campaign, value, expected):
    text = f"{MINIMAL}[processing]\nthreshold = {value}"
    if expected.startswith("processing"):
        with pytest.raises(DataError, match=re.escape(expected)):
            campaign(text)
    else:
        assert campaign(text).processing.options.threshold == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (MINIMAL.replace("calibration", "calibraton"), "recordings.calibraton: unknown key; did you mean calibration?"),
        (MINIMAL + "[maps]\n", "maps: unknown key; did you mean map?"),
        (MINIMAL + '[processing]\nmethod = "peak"\n', "processing.method is 'peak'; expected 'sage',"),
        (MINIMAL + "[processing]\nworkers = 0\n", "processing.workers is 0; expected at least 1"),
        (MINIMAL + "[map]\nmax_loss = 0\n", "map.max_loss is 0; expected more than 0"),
        (MINIMAL + "[map]\nground = nan\n", "map.ground is nan; expected a finite number"),
        (MINIMAL + "[map]\nheading = 30\n", "map: heading is given without origin; expected both or neither"),
        (MINIMAL + "[map]\norigin = [148.1, 11.5]\n", "map: origin at latitude 148.1 longitude 11.5 height 0 heading"),
        (MINIMAL + "[map]\norigin = 48.1\n", "map.origin: found 48.1; expected latitude, longitude and, optionally,"),
        (MINIMAL + '[figures]\npositions = "RX1"\n', "figures.positions: found 'RX1'; expected \"all\", \"none\" or"),
        (MINIMAL + '[figures]\nout = "x"\n', "figures.out: unknown key; known are format, positions"),
        ("[recordings]\ncalibration = 'b2b.h5'\n", "recordings.files: missing"),
        ("[recordings]\nfiles = []\ncalibration = 'b2b.h5'\n", "recordings.files: is empty; expected at least one"),
        ("[recordings]\nfiles = ['a.h5']\n", "recordings: calibration is missing; expected a back-to-back"),
        ("recordings = []\n", "recordings: is empty"),
        ("", "recordings: missing"),
        ("[[recordings]]\nfiles = ['a.h5']\nlayout = 'l'\n[[recordings]]\nfile = 'b'\n", "recordings.1.files: missing"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_by_its_key(campaign, tmp_path, text, expected):
    with pytest.raises(DataError) as error:
        campaign(text)
    assert str(error.value).startswith(f"{tmp_path / 'street.toml'}: {expected}")
    assert "\n" not in str(error.value)


def test_an_invalid_campaign_is_reported(tmp_path):
    (tmp_path / "RX1.h5").write_bytes(b"\x89HDF\r\n")
    for path, expected in (
        (tmp_path / "absent.toml", "no such file; expected a TOML file"),
        (tmp_path, "is a folder; expected a TOML file"),
        (tmp_path / "RX1.h5", "not TOML ("),
    ):
        with pytest.raises(DataError) as error:
            load_campaign(path)
        assert str(error.value).startswith(f"{path}: {expected}")


def test_files_are_named_from_the_campaigns_own_folder(campaign, tmp_path):
    text = 'out = "../maps"\n[recordings]\nfiles = ["x"]\nlayout = "l.toml"\nsounder = "/s.toml"\n'
    made = campaign(text + '[map]\noutline = "o.geojson"\n')
    assert made.out == tmp_path / "../maps"
    assert made.recordings[0].layout == tmp_path / "l.toml"
    assert made.recordings[0].sounder == Path("/s.toml")
    assert made.map.outline == tmp_path / "o.geojson"


def test_an_origin_needs_no_height(campaign):
    placed = campaign(MINIMAL + "[map]\norigin = [48.1, 11.5]\nheading = 30\n")
    assert placed.map.georeference == Georeference(48.1, 11.5, 0.0, 30.0)
    placed = campaign(MINIMAL + "[map]\norigin = [48.1, 11.5, 520]\n")
    assert placed.map.georeference == Georeference(48.1, 11.5, 520.0, 0.0)


def test_a_pattern_finds_recordings_in_the_order_of_their_numbers_and_none_of_what_else_lies_there(campaign, tmp_path):
    out = tmp_path / "street"
    for name in ("RX10.h5", "RX2.h5", "RX1.h5", "b2b.h5", "street/products/RX1.h5", "street/map.h5", "street/raw.h5"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("nothing")
    (tmp_path / "folder.h5").mkdir()
    text = '[recordings]\nfiles = ["**/*.h5", "RX1.h5"]\nlayout = "l.toml"\n'
    (tmp_path / "l.toml").write_text(LAYOUT)
    # "street/raw.h5" is a recording that somebody keeps in the folder named after the campaign
    assert found(campaign(text), out) == ["RX1.h5", "RX2.h5", "RX10.h5", "b2b.h5", "raw.h5"]


def test_a_name_is_no_pattern_where_a_file_has_it(campaign, tmp_path):
    (tmp_path / "RX[1].h5").write_text("nothing")
    (tmp_path / "l.toml").write_text(LAYOUT)
    text = '[recordings]\nfiles = ["RX[1].h5", "RX[2].h5", "RX2.h5"]\nlayout = "l.toml"\n'
    pattern, first, second = campaign(text).jobs(tmp_path / "out")[1]
    assert pattern == f"{tmp_path / 'street.toml'}: recordings.files: RX[2].h5 matches no file"
    assert first.startswith(f"{tmp_path / 'RX[1].h5'}: not an HDF5 file")
    assert second == f"{tmp_path / 'RX2.h5'}: no such file"


def test_a_calibration_that_is_none_costs_its_recordings_alone(campaign, tmp_path):
    (tmp_path / "l.toml").write_text(LAYOUT)
    groups = ("calibration = 'absent.h5'", "layout = 'l.toml'")
    text = "".join(f"[[recordings]]\nfiles = ['{i}.h5']\n{group}\n" for i, group in enumerate(groups))
    assert found(campaign(text), tmp_path / "out") == ["absent.h5", "1.h5"]


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_examples_are_campaigns(path):
    made = load_campaign(path)
    for group in made.recordings:
        assert group.layout is None or group.layout.is_file()

"""`sounder run`: a campaign to map and report. A failure costs one position, and existing products are kept."""

import json
import os
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from erm.common.storage import open_group
from sounder.campaign import run as campaign_run
from sounder.figures.files import is_up_to_date
from sounder.processing import pipeline
from sounder.processing.jobs import gather

from .commands import digest, facts, names, run

OF_ALL = ["map", "parameter-cdfs", "path-loss"]  # figures of all positions
FILES = [
    "map.geojson", "map.h5", "mpcs.csv", "parameters.csv", "point-data.csv", "reflection-points.csv", "report.html",
    "statistics.csv",
]  # fmt: skip
TEXT = """
[recordings]
files = ["*.h5"]
calibration = "back-to-back.h5"
[map]
min_support = 2
[figures]
positions = "none"
"""


@pytest.fixture
def written(copied):
    """Write the campaign beside the copied recordings, some of its text replaced."""

    def write(*replaced: tuple[str, str]) -> Path:
        text = TEXT
        for old, new in replaced:
            assert old in text
            text = text.replace(old, new)
        path = copied / "street.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="module")
def made(campaign, tmp_path_factory) -> Path:
    """Folder of a campaign, run once with the figures of one position, its recordings beside."""
    folder = tmp_path_factory.mktemp("made")
    for name in ("raw/RX1.h5", "raw/RX2.h5", "back-to-back.h5"):
        shutil.copy(campaign / name, folder)
    outline = f'min_support = 2\noutline = "{campaign / "truth" / "environment.geojson"}"'
    text = TEXT.replace("min_support = 2", outline).replace('"none"', '["RX2"]')
    (folder / "street.toml").write_text(text, encoding="utf-8")
    before = digest(folder)
    assert run("run", folder / "street.toml") == 0
    after = digest(folder)
    assert {name: after[name] for name in before} == before  # inputs are never written to
    return folder


def stamps(folder: Path) -> dict[str, tuple[int, bytes]]:
    return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()}


@pytest.mark.slow
def test_one_command_makes_products_table_map_figures_and_report(made):
    out = made / "street"
    assert names(out) == sorted([*FILES, "figures", "products"])
    assert names(out / "products") == ["RX1.h5", "RX2.h5"]  # the back-to-back, which fits the pattern too, is none
    assert [Path(name).stem for name in names(out / "figures")] == ["RX2_daps", "RX2_daps_polar", "RX2_pdp", *OF_ALL]
    header = (out / "mpcs.csv").read_text().splitlines()[0].split(",")
    assert {"delay_std", "azimuth_std", "elevation_std", "path_gain_std"} < set(header)
    options = json.loads(open_group(out / "map.h5").attrs["processing_options"])
    assert options == {
        "threshold": "consistency", "max_reflection_loss": None, "ground_height": 0.0, "min_support": 2,
        "rx_std": None, "heading_std": None, "clock_std": None, "as_given": False,
    }  # fmt: skip
    inputs = json.loads(open_group(out / "map.h5").attrs["input_sha256"])
    assert inputs == {name.removeprefix("products/"): sha for name, sha in digest(out).items() if "products" in name}


def data_of(out: Path) -> dict:
    """Data of the page of a campaign."""
    text = (out / "report.html").read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


@pytest.mark.slow
def test_the_page_shows_every_position_wall_and_error(made):
    out = made / "street"
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "<h1>street</h1>" in text
    for link in re.findall(r'href="([^"#]+)"', text):  # each file that it links is there
        assert (out / link).is_file(), link
    assert "What failed" not in text
    assert "small sounder, 132 GHz" in text
    data = data_of(out)
    assert [one["name"] for one in data["positions"]] == ["RX1", "RX2"]
    assert len(data["calibrations"][0]["response"]) > 10
    # the direct path of RX1 as the product has it
    first = open_group(out / "products" / "RX1.h5", "/mpc").isel(mpc=0)
    assert data["mpcs"]["delay"][0] == pytest.approx(float(first["delay"]) * 1e9, abs=1e-3)
    assert data["mpcs"]["delay_std"][0] == pytest.approx(float(first["delay_std"]) * 1e9, abs=1e-4)
    assert data["mpcs"]["uses"][data["mpcs"]["use"][0]] == "direct path"
    # walls: what the map holds, with its errors
    walls = open_group(out / "map.h5")
    assert len(data["reflectors"]) == walls.sizes["reflector"] > 0
    for number, shown in enumerate(data["reflectors"]):
        assert shown["offset"] == pytest.approx(walls["offset"].values[number], abs=1e-4)
        assert shown["offset_std"] == pytest.approx(np.sqrt(walls["offset_variance"].values[number]), abs=1e-4)
    # the truth is a room of four walls, and what is found stands on them
    assert ">false walls, where the outline has no face</th><td>0</td>" in text


@pytest.mark.slow
def test_what_exists_is_not_made_again(made, capsys):
    out = made / "street"
    before = {folder: stamps(out / folder) for folder in ("products", "figures")}
    whole = digest(out)
    for name in OF_ALL:  # follow from the tables in a second, and are made again
        before["figures"].pop(f"{name}.png")
    assert run("run", made / "street.toml") == 0
    assert f"{out}: 2 products; 2 of 2 positions kept from an earlier run\n" in capsys.readouterr().out
    after = {folder: stamps(out / folder) for folder in ("products", "figures")}
    for name in OF_ALL:
        after["figures"].pop(f"{name}.png")
    assert after == before
    assert digest(out) == whole


@pytest.mark.slow
def test_the_page_is_there_before_figures_and_says_afterwards_which_failed(made, copied, monkeypatch, capsys):
    class Failing(campaign_run.Drawing):
        def results(self):
            out = copied / "street"
            assert (out / "report.html").is_file()
            assert names(out / "figures") == [f"{name}.png" for name in OF_ALL]  # those of an older product are gone
            yield [], "RX2.h5: no room for figures"

    shutil.copytree(made / "street", copied / "street")
    os.utime(copied / "street" / "figures" / "RX2_pdp.png", (1, 1))
    shutil.copy(made / "street.toml", copied)
    monkeypatch.setattr(campaign_run, "Drawing", Failing)
    assert run("run", copied / "street.toml") == 1
    assert capsys.readouterr().err == "RX2.h5: no room for figures\n"
    page = (copied / "street" / "report.html").read_text(encoding="utf-8")
    assert "<li>RX2.h5: no room for figures</li>" in page


@pytest.mark.slow
def test_a_figure_that_is_not_younger_than_its_product_is_drawn_again(made, tmp_path):
    product, figures = tmp_path / "RX2.h5", [tmp_path / name for name in ("a.png", "b.png")]
    for path in (product, *figures):
        path.write_bytes(b"")
    for times, drawn in (((10, 11, 12), True), ((10, 11, 10), False), ((12, 11, 13), False)):
        for path, time in zip((product, *figures), times, strict=True):
            os.utime(path, (time, time))
        assert is_up_to_date(figures, product) == drawn
    figures[0].unlink()
    assert not is_up_to_date(figures, product)


@pytest.mark.slow
def test_products_of_sounder_process_are_continued_from(written, copied, capsys):
    arguments = ("process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5")
    assert run(*arguments, "--out", copied / "elsewhere" / "products") == 0
    before = stamps(copied / "elsewhere" / "products")
    assert run("run", written(), "--out", copied / "elsewhere") == 0
    assert "2 products; 1 of 2 positions kept from an earlier run" in capsys.readouterr().out
    assert before.items() <= stamps(copied / "elsewhere" / "products").items()


@pytest.mark.slow
def test_an_option_that_changed_makes_products_anew(written, copied, capsys):
    products, one = copied / "street" / "products", ('"*.h5"', '"RX1.h5"')

    def again(*replaced: tuple[str, str]) -> str:
        assert run("run", written(one, *replaced)) == 0
        return re.search(r"(\d of \d) position kept", capsys.readouterr().out)[1]

    assert again() == "0 of 1"
    before = stamps(products)
    assert again(("min_support = 2", "min_support = 3")) == "1 of 1"  # of the map, not of the products
    assert stamps(products) == before
    assert again(("[map]", '[processing]\nmethod = "peaks"\n[map]')) == "0 of 1"
    assert json.loads(open_group(products / "RX1.h5").attrs["processing_options"])["method"] == "peaks"


@pytest.mark.slow
def test_a_layout_or_description_that_changed_makes_products_anew(campaign, joined, tmp_path):
    files = {"layout": tmp_path / "layout.toml", "sounder": tmp_path / "sounder.toml"}
    shutil.copy(campaign / "sounder.toml", tmp_path)
    for changed, expected in ((None, 0), (None, 2), ("layout", 0), ("sounder", 0), (None, 2)):
        if changed:
            with files[changed].open("a", encoding="utf-8") as file:
                file.write("\n# another\n")
        jobs, _ = gather([joined], **files)
        assert pipeline.process(jobs, tmp_path / "out", resume=True).already == expected


@pytest.mark.slow
def test_an_interrupted_run_goes_on_to_the_same_bytes(made, copied, monkeypatch, capsys):
    shutil.copy(made / "street.toml", copied)
    (copied / "street").mkdir()
    (copied / "street" / "report.html").write_text("of an earlier run")
    process = pipeline.process_position

    def stopped(job, target, *arguments, **keywords):
        if job.recording.name == "RX2":
            raise KeyboardInterrupt
        return process(job, target, *arguments, **keywords)

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "process_position", stopped)
        assert run("run", copied / "street.toml") == 130
    assert names(copied / "street") == ["products"]
    # what a process that was killed while it wrote would have left
    for folder in ("products/.RX2.h5.0123abcd.part", ".mpcs.csv.0123abcd.part"):
        (copied / "street" / folder).mkdir()
        (copied / "street" / folder / "half").write_text("half")
    capsys.readouterr()
    assert run("run", copied / "street.toml") == 0
    assert "2 products; 1 of 2 positions kept from an earlier run" in capsys.readouterr().out
    assert digest(copied / "street") == digest(made / "street")


@pytest.mark.slow
def test_a_position_that_fails_is_named_and_the_rest_is_done(written, copied, capsys):
    (copied / "RX0.h5").write_text("not HDF5")
    with h5py.File(copied / "RX2.h5", "r+") as file:
        file["iq"][2, 0] = 0
    said = []
    for already in (0, 2):  # failures of a kept product are reported again
        assert run("run", written()) == 1
        printed = capsys.readouterr()
        assert f"2 products; {already} of 2 positions kept from an earlier run" in printed.out
        said.append((printed.err, (copied / "street" / "report.html").read_bytes()))
    assert said[0] == said[1]
    broken, zero = said[0][0].splitlines()
    assert broken.startswith(f"{copied / 'RX0.h5'}: not an HDF5 file")
    assert zero.startswith(f"{copied / 'RX2.h5'}: RX2: all samples are zero in 1 of 24 directions")
    assert names(copied / "street" / "products") == ["RX1.h5", "RX2.h5"]
    failed = re.search(r"What failed</h3>(.*?)</ul>", said[0][1].decode(), re.DOTALL)[1]
    assert re.findall("<li>(.*?):", failed) == ["RX0.h5", "RX2.h5"]  # from the campaign's folder
    second = data_of(copied / "street")["positions"][1]
    assert (second["name"], second["missing"], second["problems"], len(second["failures"])) == ("RX2", 0, 1, 1)
    assert run("info", copied / "street" / "products" / "RX2.h5") == 0
    assert facts(capsys)["failure"] == zero.removeprefix(f"{copied / 'RX2.h5'}: RX2: ")


@pytest.mark.slow
def test_products_that_are_not_of_the_campaign_are_left_and_not_used(written, copied, capsys):
    assert run("run", written()) == 0
    before = stamps(copied / "street" / "products")
    capsys.readouterr()
    assert run("run", written(('"*.h5"', '"RX1.h5"'))) == 0
    assert "1 product; 1 of 1 position kept from an earlier run" in capsys.readouterr().out
    assert stamps(copied / "street" / "products") == before
    rows = (copied / "street" / "mpcs.csv").read_text().splitlines()[1:]
    assert {row.partition(",")[0] for row in rows} == {"RX1"}


def test_nothing_to_process_is_reported_and_nothing_written(written, copied, capsys):
    out = copied / "street"
    assert run("run", written(('"*.h5"', '"RX7.h5", "day2/*.h5"'))) == 1
    assert capsys.readouterr().err.splitlines() == [
        f"{copied / 'street.toml'}: recordings.files: day2/*.h5 matches no file",
        f"{copied / 'RX7.h5'}: no such file",
        f"{out}: no map; no position could be processed",
    ]
    assert not out.exists()


@pytest.mark.parametrize(
    ("replaced", "expected"),
    [
        (("min_support = 2", 'outline = "absent.geojson"'), "{folder}/absent.geojson: no such file"),
        (("min_support = 2", 'outline = "street/map.h5"'), "{folder}/street/map.h5: no such file"),
        (("positions", "position"), "{folder}/street.toml: figures.position: unknown key; did you mean positions?"),
    ],
)
def test_what_cannot_end_well_is_refused_before_anything_is_processed(written, copied, replaced, expected, capsys):
    assert run("run", written(replaced)) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(expected.format(folder=copied))
    assert not (copied / "street").exists()


def test_outputs_never_replace_inputs(written, copied, capsys):
    (copied / "map.geojson").write_text('{"type": "LineString", "coordinates": [[0, 0], [20, 0]]}')
    before = digest(copied)
    path = written(("min_support = 2", 'outline = "map.geojson"'))
    assert run("run", path, "--out", copied) == 2
    assert capsys.readouterr().err.startswith(f"{copied / 'map.geojson'}: is an input, which would be replaced")
    assert run("run", path, "--out", copied / "RX1.h5") == 2
    path.unlink()
    assert digest(copied) == before


@pytest.mark.slow
def test_formats_of_map_and_figures_and_the_place_on_earth(written, copied, capsys):
    place = 'min_support = 2\norigin = [48.1, 11.5, 520.0]\nheading = 30.0\nformats = ["geojson", "csv"]'
    figures = 'positions = ["RX9"]\nformat = "pdf"'
    assert run("run", written(("min_support = 2", place), ('positions = "none"', figures))) == 1
    expected = f"{copied / 'street.toml'}: figures.positions: RX9 is not a processed position\n"
    assert capsys.readouterr().err == expected
    out = copied / "street"
    assert names(out / "figures") == [f"{name}.pdf" for name in OF_ALL]
    assert (out / "map.csv").is_file()
    assert not (out / "map.h5").exists()
    georeference = json.loads((out / "map.geojson").read_text())["georeference"]
    assert georeference == {"latitude": 48.1, "longitude": 11.5, "height": 520.0, "heading": 30.0}
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "<dt>origin</dt><dd>48.1, 11.5, 520 m; heading 30 degrees</dd>" in text
    assert data_of(out)["north"] == 30.0


@pytest.mark.slow
def test_a_campaign_of_noise_gives_an_empty_map(written, copied, capsys):
    rng = np.random.default_rng(7)
    for name in ("RX1", "RX2"):
        with h5py.File(copied / f"{name}.h5", "r+") as file:
            # k T B F of 8 dB in 1.2 GHz, in each of I and Q, through the gain of each direction
            rms = 10 ** ((-75.2 + file["agc_gain"][()]) / 20) / np.sqrt(2) / file["iq"].attrs["scale_factor"]
            file.attrs["los"] = 0
            file["iq"][()] = np.round(rms[..., None, None, None] * rng.standard_normal(file["iq"].shape))
    assert run("run", written()) == 0
    assert "map: 0 walls and 0 poles from 0 of 0 MPCs" in capsys.readouterr().out
    text = (copied / "street" / "report.html").read_text(encoding="utf-8")
    assert "No reflector was found." in text
    assert data_of(copied / "street")["mpcs"]["delay"] == []

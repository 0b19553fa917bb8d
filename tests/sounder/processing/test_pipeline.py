"""Many positions: a failure costs one position, and products are written completely or not at all."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from erm.common import storage
from erm.common.errors import DataError
from erm.common.storage import open_group
from sounder.options import Options
from sounder.processing import departures, position
from sounder.processing.jobs import Explained, Job, Source, gather
from sounder.processing.pipeline import process
from sounder.recordings.writer import write_back_to_back, write_recording
from sounder.twin import receiver

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}
HORN = {"pattern": "gaussian", "cut": None, "hpbw_azimuth": 60.0, "hpbw_elevation": 60.0}


@pytest.fixture(scope="module")
def sounder(description):
    scan = {"azimuth": [0.0, 60.0, 120.0, 180.0, 240.0, 300.0], "elevation": [0.0]}
    return description(waveform=WAVEFORM, scan=scan, rx_antenna=HORN)


def paths(count: int) -> xr.Dataset:
    columns = {"delay": 50e-9, "azimuth": 70.0, "elevation": 0.0, "coefficient": 1e-6 + 0j}
    return xr.Dataset({name: ("path", np.full(count, value)) for name, value in columns.items()})


@pytest.fixture
def jobs(sounder, tmp_path):
    """Jobs of recordings named as asked, each read from a file; ``count`` paths in each."""

    def make(*names: str, count: int = 1) -> list[Job]:
        write_back_to_back(receiver.back_to_back(sounder, 60.0), tmp_path / "b2b.h5", history="test")
        files = []
        for i, name in enumerate(names):
            places = {"tx_position": (0, 0, 1), "rx_position": (3 + i, 4, 1)}
            made = receiver.record(paths(count), sounder, name=name, snapshots=2, **places)
            files.append(tmp_path / f"{i}.h5")
            write_recording(made, files[-1], history="test")
        found, failures = gather(files, calibration=tmp_path / "b2b.h5")
        assert failures == []
        return found

    return make


@pytest.mark.slow
def test_products_are_in_the_order_of_the_jobs_and_progress_counts_them(jobs, tmp_path):
    steps = []
    outcome = process(jobs("C", "A", "B"), tmp_path / "out", progress=lambda: steps.append(1))
    assert [path.stem for path in outcome.products] == ["C", "A", "B"]
    assert (outcome.failures, outcome.notes, len(steps)) == ([], [], 3)


@pytest.mark.slow
def test_a_fault_that_positions_tell_only_together_is_one_line(jobs, tmp_path, monkeypatch):
    monkeypatch.setattr(departures, "quadrature_evidence", lambda responses, deembedding: [3.0, 0.0, 0.0])
    three = jobs("A", "B", "C")
    for again in range(2):
        outcome = process(three, tmp_path / "out", resume=True, threads=1)
        assert outcome.already == 3 * again
        [line] = outcome.failures
        assert "b2b.h5: 3 positions together: I and Q are exchanged" in line
    assert process(three[:2], tmp_path / "two", threads=1).failures == []


@pytest.mark.slow
def test_damage_met_while_reading_costs_its_position_alone(jobs, tmp_path):
    first, second, third = jobs("A", "B", "C")

    def read(a, e, s):
        raise DataError("B.h5: iq cannot be read (checksum); copy the file again")

    broken = replace(second, recording=replace(second.recording, read=read))
    outcome = process([first, broken, third], tmp_path / "out")
    assert [path.stem for path in outcome.products] == ["A", "C"]
    assert outcome.failures == ["B.h5: iq cannot be read (checksum); copy the file again"]


@pytest.mark.slow
def test_the_same_failure_of_many_positions_is_reported_once(jobs, tmp_path, description):
    batch = jobs("A", "B", "C")
    other = description(waveform={**WAVEFORM, "polynomial": [7, 3, 0]}, rx_antenna=HORN)
    write_back_to_back(receiver.back_to_back(other, 60.0), tmp_path / "b2b.h5", history="test")
    batch = gather([job.recording.source for job in batch], calibration=tmp_path / "b2b.h5")[0]
    (failure,) = process(batch, tmp_path / "out").failures
    assert failure.startswith(f"{tmp_path / 'b2b.h5'}: back-to-back of another sounder: ")
    assert failure.endswith(" (all 3 positions)")


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.slow
def test_a_position_that_failed_leaves_its_name_to_the_next_recording_of_it(jobs, tmp_path, workers):
    batch = jobs("A", "A", "B", "A")
    with h5py.File(batch[0].recording.source, "r+") as file:
        file["iq"][()] = 0
    outcome = process(batch, tmp_path / "out", workers=workers)
    assert [path.stem for path in outcome.products] == ["A", "B"]
    assert json.loads(open_group(outcome.products[0]).attrs["input_sha256"]).keys() == {"1.h5", "b2b.h5"}
    zero, taken = outcome.failures
    assert zero.startswith(f"{tmp_path / '0.h5'}: A: all samples are zero")
    assert taken.startswith(f"{tmp_path / '3.h5'}: position A: ")
    assert f"is already taken by {tmp_path / '1.h5'}: position A" in taken


@pytest.mark.slow
def test_products_are_left_where_nothing_changed_and_made_anew_where_anything_did(jobs, tmp_path):
    batch, out = jobs("A", "B"), tmp_path / "out"
    first = process(batch, out, resume=True)
    assert first.already == 0
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in first.products}
    steps = []
    again = process(batch, out, resume=True, progress=lambda: steps.append(1))
    assert (again.already, again.products, len(steps)) == (2, first.products, 2)
    assert {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in again.products} == before
    assert process(batch, out, options=Options(method="peaks"), resume=True).already == 0
    assert process(batch, out, resume=True).already == 0  # and back
    assert {path: path.read_bytes() for path in first.products} == {path: data for path, (_, data) in before.items()}
    source = batch[0].recording.source
    size = source.stat().st_size
    with h5py.File(source, "r+") as file:
        file["iq"][0, 0, 0, 0, 0] += 1
    assert source.stat().st_size == size
    files = [job.recording.source for job in batch]
    assert process(gather(files, calibration=tmp_path / "b2b.h5")[0], out, resume=True).already == 1
    with h5py.File(tmp_path / "b2b.h5", "r+") as file:
        file.attrs["attenuation"] = 61.0
    assert process(gather(files, calibration=tmp_path / "b2b.h5")[0], out, resume=True).already == 0


@pytest.mark.slow
def test_a_product_of_another_version_is_made_anew(jobs, tmp_path, monkeypatch):
    batch = jobs("A")
    process(batch, tmp_path / "out")
    monkeypatch.setattr(storage, "__version__", "0.0.9")
    assert process(batch, tmp_path / "out", resume=True).already == 0


@pytest.mark.parametrize("spoiled", ["cut short", "no HDF5", "of an earlier version"])
@pytest.mark.slow
def test_a_file_in_the_place_of_a_product_that_is_none_is_made_anew(jobs, tmp_path, spoiled):
    batch = jobs("A")
    (product,) = process(batch, tmp_path / "out").products
    whole = product.read_bytes()
    if spoiled == "of an earlier version":
        with h5py.File(product, "r+") as file:
            del file["quality"]
    else:
        product.write_bytes(whole[: len(whole) // 2] if spoiled == "cut short" else b"notes")
    assert process(batch, tmp_path / "out", resume=True).already == 0
    assert product.read_bytes() == whole


@pytest.mark.slow
def test_a_position_of_another_ones_name_is_not_taken_for_it(jobs, tmp_path):
    batch = jobs("A", "A")
    process(batch[1:], tmp_path / "out")
    outcome = process(batch, tmp_path / "out", resume=True)
    assert (outcome.already, len(outcome.products)) == (0, 1)  # the first has the name
    root = open_group(outcome.products[0])
    assert root["rx_position"].values.tolist() == [batch[0].recording.rx_position.tolist()]


@pytest.mark.slow
def test_noise_alone_gives_a_legal_product_without_mpcs(jobs, tmp_path):
    outcome = process(jobs("A", count=0), tmp_path / "out")
    assert outcome.failures == []
    mpc = open_group(outcome.products[0], "/mpc")
    assert mpc.sizes["mpc"] == 0
    assert set(mpc) >= {"delay", "azimuth", "elevation", "path_gain"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a/b", "../up", "RX 1", "Straße 7", "..."])
def test_any_name_of_a_position_becomes_a_file_in_the_folder(jobs, tmp_path, name):
    outcome = process(jobs(name), tmp_path / "out")
    (product,) = outcome.products
    assert product.parent == tmp_path / "out"
    assert product.is_file()
    assert open_group(product)["position"].item() == name  # the name itself is kept inside


@pytest.mark.slow
def test_a_product_is_whole_or_absent(jobs, tmp_path, monkeypatch):
    batch = jobs("A")
    out = tmp_path / "out"
    process(batch, out)
    before = (out / "A.h5").read_bytes()

    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(storage, "write_group", interrupted)
    for folder in (out, tmp_path / "new"):
        with pytest.raises(KeyboardInterrupt):
            process(batch, folder)
    assert (out / "A.h5").read_bytes() == before
    assert [path.name for path in out.iterdir()] == ["A.h5"]
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_options_are_stored_in_the_product(jobs, tmp_path):
    options = Options(averaging="power", threshold="nyu", omnidirectional="maximum", keep_cir=True)
    (product,) = process(jobs("A"), tmp_path / "out", options=options).products
    assert open_group(product, "/cir").attrs["averaging"] == "power"
    assert open_group(product, "/mpc").attrs["threshold"] == "nyu"
    assert open_group(product, "/daps").attrs["omnidirectional"] == "maximum"


@pytest.mark.slow
def test_one_filter_serves_a_campaign(jobs, tmp_path, monkeypatch):
    made = []
    calibrate = position.calibrate
    monkeypatch.setattr(position, "calibrate", lambda *args: (made.append(1), calibrate(*args))[1])
    process(jobs("A", "B", "C"), tmp_path / "out")
    assert len(made) == 1


def test_gather_names_what_it_cannot_use_and_keeps_the_rest(jobs, tmp_path):
    jobs("A")
    absent = tmp_path / "absent.h5"
    found, failures = gather([absent, tmp_path / "0.h5"], calibration=tmp_path / "b2b.h5")
    assert [job.recording.name for job in found] == ["A"]
    assert found[0].source == Source(tmp_path / "0.h5", 0, Explained(tmp_path / "b2b.h5"))
    assert failures == [f"{absent}: no such file"]
    with pytest.raises(DataError, match="no such file"):  # without a calibration nothing can be done
        gather([tmp_path / "0.h5"], calibration=Path("absent.h5"))

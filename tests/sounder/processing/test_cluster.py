"""Positions on dask workers: the same bytes as in one process, also if workers are lost."""

import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from sounder.options import Options
from sounder.processing import cluster as dask_cluster
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process
from sounder.recordings.writer import write_back_to_back, write_recording
from sounder.twin import receiver

distributed = pytest.importorskip("distributed")

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}
HORN = {"pattern": "gaussian", "cut": None, "hpbw_azimuth": 60.0, "hpbw_elevation": 60.0}
OPTIONS = Options(averaging="phase-aligned")  # takes long enough to be interrupted


@pytest.fixture(scope="module")
def jobs(description, tmp_path_factory):
    """Eight positions of 300 snapshots, and one that cannot be processed."""
    folder = tmp_path_factory.mktemp("campaign")
    scan = {"azimuth": [0.0, 60.0, 120.0, 180.0, 240.0, 300.0], "elevation": [0.0]}
    sounder = description(waveform=WAVEFORM, scan=scan, rx_antenna=HORN)
    write_back_to_back(receiver.back_to_back(sounder, 60.0), folder / "b2b.h5", history="test")
    columns = {"delay": [50e-9], "azimuth": [70.0], "elevation": [0.0], "coefficient": [1e-6 + 0j]}
    paths = xr.Dataset({name: ("path", values) for name, values in columns.items()})
    files = [folder / f"P{i}.h5" for i in range(9)]
    for i, file in enumerate(files):
        places = {"tx_position": (0, 0, 1), "rx_position": (3 + i, 4, 1)}
        made = receiver.record(paths, sounder, name=file.stem, snapshots=300, seed=i, **places)
        write_recording(made, file, history="test")
    with h5py.File(files[4], "r+") as file:
        file["iq"][...] = np.int16(0)
    found, failures = gather(files, calibration=folder / "b2b.h5")
    assert failures == []
    return found


@pytest.fixture(scope="module")
def alone(jobs, tmp_path_factory):
    """What one process makes of them."""
    return process(jobs, tmp_path_factory.mktemp("alone"), options=OPTIONS)


@pytest.fixture(scope="module")
def cluster(alone):  # the kernels are compiled by now
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as made:
        yield made


def require_same(outcome, alone):
    assert outcome.failures == alone.failures
    assert outcome.notes == alone.notes
    assert [product.name for product in outcome.products] == [product.name for product in alone.products]
    for product, expected in zip(outcome.products, alone.products, strict=True):
        assert product.read_bytes() == expected.read_bytes(), product.name


@pytest.mark.slow
def test_a_scheduler_s_workers_make_the_same_bytes_of_paths_in_this_folder(jobs, alone, cluster, monkeypatch):
    folder = jobs[0].source.path.parent
    monkeypatch.chdir(folder)  # the workers run in another one
    relative, _ = gather([job.source.path.name for job in jobs], calibration="b2b.h5")
    outcome = process(relative, "out", options=OPTIONS, scheduler=cluster.scheduler_address)
    assert len(outcome.products) == 8
    assert outcome.failures[-1].startswith("P4.h5: ")
    outcome.failures, outcome.notes = (
        [f"{folder}/{line}" for line in lines] for lines in (outcome.failures, outcome.notes)
    )
    require_same(outcome, alone)


@pytest.mark.slow
def test_a_worker_killed_midway_costs_no_more_than_a_second_try(jobs, alone, cluster, tmp_path):
    def workers() -> set[int]:
        return {nanny.pid for nanny in cluster.workers.values()}

    before = workers()
    done = 0

    def kill_once() -> None:
        nonlocal done
        done += 1
        if done == 1:
            os.kill(min(before), signal.SIGKILL)

    outcome = process(jobs, tmp_path / "out", options=OPTIONS, scheduler=cluster.scheduler_address, progress=kill_once)
    assert done == 9
    assert workers() != before
    require_same(outcome, alone)
    assert list(Path(tmp_path / "out").glob(".*")) == []  # what the lost worker had begun


@pytest.mark.slow
def test_a_scheduler_that_is_gone_costs_one_line_and_a_second_run_the_rest(jobs, alone, tmp_path):
    with distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=":0", silence_logs=50) as cluster:
        address = cluster.scheduler_address
        outcome = process(jobs, tmp_path / "out", options=OPTIONS, scheduler=address, progress=cluster.close)
    (failure,) = outcome.failures
    assert failure.startswith("dask: the scheduler is gone; complete products are kept")
    assert 1 <= len(outcome.products) < 8
    again = process(jobs, tmp_path / "out", options=OPTIONS, resume=True)
    assert again.already >= len(outcome.products)
    require_same(again, alone)


def test_a_worker_of_another_version_makes_nothing(jobs, tmp_path):
    others = dask_cluster._versions() | {"numpy": "0.0"}
    outcome = dask_cluster._work(others, jobs[0].source, tmp_path / "P0.h5", OPTIONS, 1)
    assert not outcome.products
    assert "; expected 0.0 as here" in outcome.failures[0]


@pytest.mark.slow
def test_own_workers_make_the_same_bytes(jobs, alone, tmp_path):
    require_same(process(jobs, tmp_path / "out", options=OPTIONS, workers=2), alone)

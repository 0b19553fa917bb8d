"""Positions on dask workers: the same bytes as in one process, also if workers are lost."""

import os
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from sounder.options import Options
from sounder.processing import cluster as dask_cluster
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process

distributed = pytest.importorskip("distributed")

COUNT = 35
OPTIONS = Options(averaging="phase-aligned")  # takes long enough to be interrupted


@pytest.fixture(scope="module")
def jobs(campaign_maker):
    """Positions, the fifth of which cannot be processed."""
    *files, b2b = campaign_maker(COUNT + 1, snapshots=80)
    with h5py.File(files[4], "r+") as file:
        file["iq"][...] = np.int16(0)
    found, failures = gather(files, calibration=b2b)
    assert failures == []
    return found


@pytest.fixture(scope="module")
def alone(jobs, tmp_path_factory):
    """What one process makes of them."""
    return process(jobs, tmp_path_factory.mktemp("alone"), options=OPTIONS)


@pytest.fixture(scope="module")
def cluster(alone):  # the kernels are compiled by now
    with distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as made:
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
    assert len(outcome.products) == COUNT
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
        if done == COUNT // 2:
            os.kill(min(before), signal.SIGKILL)

    outcome = process(jobs, tmp_path / "out", options=OPTIONS, scheduler=cluster.scheduler_address, progress=kill_once)
    assert done == COUNT + 1
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
    assert 1 <= len(outcome.products) < COUNT
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

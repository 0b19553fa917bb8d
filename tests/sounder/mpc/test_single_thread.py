"""The same bits, whatever number of threads linear algebra is given."""

import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from sounder.mpc.extract import extract_mpcs
from sounder.mpc.single_thread import single_thread


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture
def two():
    with threadpool_limits(2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("this BLAS cannot be told how many threads to use")
        yield


@pytest.mark.slow
def test_a_crowded_position_gives_the_same_bits(bench, two):
    # eight paths within four chips and three beams are fitted together, in products large enough to be shared
    rng = np.random.default_rng(3)
    late, aside = 200e-9 + 1.1e-9 * np.arange(8), 40 + 6 * (np.arange(8) % 4)
    paths = [(-100.0 - rng.uniform(0, 6), t, a, 2.0) for t, a in zip(late, aside, strict=True)]
    scan = bench.scan(paths, seed=3)
    many = extract_mpcs(scan, bench.filter_, bench.sounder)
    with threadpool_limits(1, user_api="blas"):
        one = extract_mpcs(scan, bench.filter_, bench.sounder)
    assert one.sizes["mpc"] > 4
    assert one.identical(many)


def test_the_number_of_threads_is_set_back_by_the_last(two):
    inside, leave = threading.Event(), threading.Event()

    def other():
        with single_thread():
            inside.set()
            leave.wait(10)

    thread = threading.Thread(target=other)
    with single_thread():
        thread.start()
        assert inside.wait(10)
        assert threads() == {1}
    assert threads() == {1}
    leave.set()
    thread.join()
    assert threads() == {2}

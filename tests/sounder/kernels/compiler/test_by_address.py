"""Stages: compiled on their own, called by address."""

import sys
import types

import numpy as np
import pytest

from sounder.kernels.compiler import ahead, by_address
from sounder.kernels.compiler.compile import jit
from sounder.kernels.extraction.fit_path import fit
from sounder.mpc.extract import extract


@jit
def twice(x, step):
    step(x)
    step(x)


@pytest.fixture
def helpers(monkeypatch):
    """Processes that were started."""
    started = []

    def popen(command, **_):
        started.append(command)
        return types.SimpleNamespace(wait=lambda: None, terminate=lambda: None)

    monkeypatch.setattr(by_address.subprocess, "Popen", popen)
    monkeypatch.setattr(by_address.atexit, "register", lambda *_: None)
    monkeypatch.setattr(by_address, "processors", lambda: 2)
    monkeypatch.setattr(by_address, "_helpers", [])
    return started


def new_stage():
    def add_one(x):
        for k in range(x.size):
            x[k] += 1.0

    return by_address.Stage(add_one)


def test_an_entry_point_calls_a_stage_by_its_address():
    x = np.zeros(3)
    twice(x, new_stage().given(x))
    np.testing.assert_array_equal(x, 2.0)


def test_a_helper_is_started_only_for_what_is_not_kept(helpers, monkeypatch):
    step = new_stage().given(np.zeros(3))
    for kept in (False, True):
        monkeypatch.setattr(by_address.Stage, "kept", lambda _, kept=kept: kept)
        by_address.compile_meanwhile(step, "some.module")
    assert helpers == [[sys.executable, "-m", "some.module"]]


def test_what_is_compiled_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("sounder.kernels.compiler.compile.cache_directory", lambda: tmp_path)
    step = new_stage().given(np.zeros(3))
    assert not step.kept()
    step.compile()
    assert step.kept()


def test_one_processor_gets_no_helper(helpers, monkeypatch):
    monkeypatch.setattr(by_address, "processors", lambda: 1)
    monkeypatch.setattr(by_address.Stage, "kept", lambda _: False)
    by_address.compile_meanwhile(new_stage(), "some.module")
    assert not helpers


def test_a_helper_that_fails_costs_only_time(monkeypatch):
    monkeypatch.setattr(by_address, "_helpers", [])
    monkeypatch.setattr(by_address, "processors", lambda: 2)
    x = np.zeros(3)
    step = new_stage().given(x)
    monkeypatch.setattr(by_address.Stage, "kept", lambda _: False)
    by_address.compile_meanwhile(step, "sounder.no_such_module")
    twice(x, step)
    np.testing.assert_array_equal(x, 2.0)
    (helper,) = by_address._helpers
    assert helper.returncode == 1


def test_the_fit_is_compiled_ahead_for_what_the_extraction_calls_it_with(monkeypatch, bench):
    extract(bench.scan([(-100.0, 200e-9, 3.0, 2.0)]), bench.filter_, bench.sounder)
    called = fit.signature()
    monkeypatch.setattr(by_address.Stage, "compile", lambda _: None)
    fit.given()
    ahead.main()
    assert fit.signature() == called
    assert len(called.args) == 8

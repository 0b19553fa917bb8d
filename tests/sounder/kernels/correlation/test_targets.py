"""Correlation for other processors than this one: what numba is told to compile for is what counts."""

import os
import subprocess
import sys

import numpy as np
import pytest

from sounder.kernels.correlation.m_sequence import MSequenceCorrelator

REGISTERS = "+avx512f,+avx512bw,+avx512dq,+avx512vl"
AVAILABLE = """
from sounder.kernels.correlation.avx512_instructions import available
print(available())
"""
AVERAGE = """
import sys
import numpy as np
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
given = np.load(sys.argv[1])
mean, power = MSequenceCorrelator(given["chips"], 2).average(given["iq"])
np.savez(sys.argv[2], mean=mean, power=power)
"""
COMPILE = """
import sys
import numba
import numpy as np
from sounder.kernels.correlation import avx512
from sounder.kernels.correlation.permutations import permutations
tables = avx512.tables(permutations(np.load(sys.argv[1])["chips"]), 2)
state = avx512.state(tables)
captures = np.zeros((2, 2 * 1022), np.int16)
captures.flags.writeable = False
function = numba.njit(avx512.kernels(9, 2).add_int16.function)
function.compile(tuple(map(numba.typeof, (captures, 0, tables, state))))
(code,) = function.inspect_asm().values()
print(code.count("vpmaddwd") > 0, code.count("%zmm") > 0)
"""

pytestmark = pytest.mark.slow


def run(script, *arguments, **environment):
    kept = {name: text for name, text in os.environ.items() if not name.startswith(("NUMBA_CPU", "SOUNDER_"))}
    command = [sys.executable, "-W", "error", "-c", script, *map(str, arguments)]
    done = subprocess.run(command, env=kept | environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def given(m_sequence, tmp_path):
    """File with a sequence and captures."""
    iq = np.random.default_rng(1).integers(-9000, 9000, (5, 1022, 2)).astype(np.int16)
    np.savez(tmp_path / "given.npz", chips=m_sequence(9), iq=iq)
    return tmp_path / "given.npz"


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({"NUMBA_CPU_NAME": "generic"}, False),
        ({"NUMBA_CPU_FEATURES": "+avx2,+avx512f"}, False),
        ({"NUMBA_CPU_FEATURES": REGISTERS}, True),
        ({"NUMBA_CPU_FEATURES": REGISTERS, "SOUNDER_PORTABLE_KERNELS": "1"}, False),
        ({"NUMBA_CPU_FEATURES": REGISTERS, "NUMBA_DISABLE_JIT": "1"}, False),
    ],
)
def test_registers_are_used_if_numba_compiles_for_them(environment, expected):
    assert run(AVAILABLE, **environment) == str(expected)


@pytest.mark.parametrize(
    "environment",
    [{"NUMBA_CPU_NAME": name} for name in ("generic", "nehalem", "haswell")] + [{"NUMBA_DISABLE_JIT": "1"}],
    ids=lambda environment: "=".join(*environment.items()),
)
def test_averages_are_the_same_whatever_numba_compiles_for(given, tmp_path, environment):
    run(AVERAGE, given, tmp_path / "got.npz", **environment)
    data, got = np.load(given), np.load(tmp_path / "got.npz")
    mean, power = MSequenceCorrelator(data["chips"], 2).average(data["iq"])
    # each path rounds to 2**-24 in at most 15 additions, and no sum exceeds the peak; see `test_m_sequence`
    np.testing.assert_allclose(got["mean"], mean, atol=1e-6 * np.abs(mean).max())
    np.testing.assert_allclose(got["power"], power, atol=1e-6 * power.max())


def test_llvm_knows_the_instructions_of_the_registers(given):
    """Compiled, not run: the processor may lack them."""
    assert run(COMPILE, given, NUMBA_CPU_NAME="skylake-avx512", NUMBA_CPU_FEATURES=REGISTERS) == "True True"

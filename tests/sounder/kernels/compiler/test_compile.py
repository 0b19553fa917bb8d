"""Where machine code is kept."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from sounder.kernels.compiler import compile as compiler

COMPILE = """
import numpy as np
from sounder.kernels.compiler import compile as compiler
@compiler.jit
def double(x):
    for k in range(x.size):
        x[k] *= 2
x = np.ones(3)
double(x)
assert x.tolist() == [2, 2, 2]
print(compiler.cache_directory())
"""


def run(script: str, tmp_path: Path, **environment: str) -> str:
    """Run a script without a home: /proc cannot be written even by an administrator."""
    kept = {name: os.environ[name] for name in ("PATH", "SYSTEMROOT", "LD_LIBRARY_PATH") if name in os.environ}
    place = {"HOME": "/proc/nowhere", "TMPDIR": str(tmp_path), **environment}
    file = tmp_path / "script.py"
    file.write_text(script)
    done = subprocess.run(
        [sys.executable, "-W", "error", str(file)], env=kept | place, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_package_is_imported_without_the_compiler(tmp_path):
    run("import sounder, sys; assert 'numba' not in sys.modules", tmp_path)


@pytest.mark.slow
def test_without_a_home_the_temporary_directory_serves(tmp_path):
    directory = Path(run(COMPILE, tmp_path))
    assert directory.parent == tmp_path
    assert list(directory.rglob("*.nbc"))
    assert not directory.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO)


@pytest.mark.slow
def test_without_any_directory_kernels_are_compiled_anew(tmp_path):
    script = "import tempfile; tempfile.tempdir = '/proc/nowhere'" + COMPILE
    assert run(script, tmp_path) == "None"


@pytest.mark.slow
def test_directories_are_asked_in_order(tmp_path):
    own, usual = tmp_path / "own", tmp_path / "usual"
    assert Path(run(COMPILE, tmp_path, XDG_CACHE_HOME=str(usual))).is_relative_to(usual)
    assert Path(run(COMPILE, tmp_path, NUMBA_CACHE_DIR=str(own), XDG_CACHE_HOME=str(usual))).is_relative_to(own)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners on this system")
def test_a_directory_that_others_can_write_is_not_trusted(tmp_path, monkeypatch):
    open_to_all, private = tmp_path / "a", tmp_path / "b"
    for directory in (open_to_all, private):
        directory.mkdir(mode=0o700)
    open_to_all.chmod(0o777)
    monkeypatch.setattr(compiler, "_candidates", lambda _name: iter([open_to_all, private]))
    compiler.cache_directory.cache_clear()
    try:
        assert compiler.cache_directory() == private
    finally:
        compiler.cache_directory.cache_clear()


@pytest.mark.slow
def test_processes_that_start_together_get_the_same(tmp_path):
    file = tmp_path / "script.py"
    file.write_text(COMPILE)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, str(file)]
    together = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    said = [process.communicate()[0].strip() for process in together]
    later = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()
    assert len({*said, later}) == 1
    assert len(list(tmp_path.rglob("*.nbc"))) == 1

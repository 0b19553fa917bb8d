"""Where machine code is kept."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from sounder.kernels.compiler import cache

COMPILE = """
import numpy as np
from sounder.kernels.compiler import cache, compile
@compile.jit
def double(x):
    for k in range(x.size):
        x[k] *= 2
x = np.ones(3)
double(x)
assert x.tolist() == [2, 2, 2]
print(cache.cache_directory())
"""


def run(script: str, tmp_path: Path, **environment: str) -> str:
    """Run a script without a home: /proc cannot be written even by an administrator."""
    kept = {
        name: os.environ[name] for name in ("PATH", "PYTHONPATH", "SYSTEMROOT", "LD_LIBRARY_PATH") if name in os.environ
    }
    place = {"HOME": "/proc/nowhere", "TMPDIR": str(tmp_path), **environment}
    file = tmp_path / "script.py"
    file.write_text(script)
    done = subprocess.run(
        [sys.executable, "-W", "error", str(file)], env=kept | place, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_directory_that_cannot_be_written_is_passed_over(tmp_path):
    # /proc stands for a directory that is read-only; an administrator may write to others
    assert Path(run(COMPILE, tmp_path, NUMBA_CACHE_DIR="/proc")).parent == tmp_path


def test_a_directory_without_room_is_passed_over(tmp_path, monkeypatch):
    class Full:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def write(self, data):
            if data:
                raise OSError(28, "No space left on device")

    full, roomy = tmp_path / "full", tmp_path / "roomy"
    real = cache.tempfile.TemporaryFile
    monkeypatch.setattr(cache.tempfile, "TemporaryFile", lambda dir: Full() if dir == full else real(dir=dir))
    monkeypatch.setattr(cache, "_candidates", lambda _name: iter([full, roomy]))
    assert cache.cache_directory.__wrapped__() == roomy
    (full / "kernels.nbi").touch()  # what it holds can be loaded
    assert cache.cache_directory.__wrapped__() == full


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners on this system")
def test_a_directory_that_others_can_write_is_not_trusted(tmp_path, monkeypatch):
    open_to_all, private = tmp_path / "a", tmp_path / "b"
    for directory in (open_to_all, private):
        directory.mkdir(mode=0o700)
    open_to_all.chmod(0o777)
    monkeypatch.setattr(cache, "_candidates", lambda _name: iter([open_to_all, private]))
    assert cache.cache_directory.__wrapped__() == private


def test_other_processors_settings_and_versions_have_directories_of_their_own(monkeypatch):
    names = {cache._fingerprint()}
    for attribute, value in [("CPU_NAME", "generic"), ("CPU_FEATURES", "+avx"), ("OPT", 1), ("BOUNDSCHECK", 1)]:
        with monkeypatch.context() as changed:
            changed.setattr(numba.config, attribute, value)
            names.add(cache._fingerprint())
    for replaced in ("processor_kind", "version"):
        with monkeypatch.context() as changed:
            changed.setattr(cache, replaced, lambda *_: "another")
            names.add(cache._fingerprint())
    assert len(names) == 7


def test_the_environment_is_as_before(tmp_path, monkeypatch):
    for before in (None, str(tmp_path / "own")):
        if before:
            monkeypatch.setenv("NUMBA_CACHE_DIR", before)
            numba.config.reload_config()
        with cache.numba_caches_in(tmp_path):
            assert str(tmp_path) == numba.config.CACHE_DIR
        assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR


@pytest.mark.slow
def test_processes_that_start_together_get_the_same(tmp_path):
    file = tmp_path / "script.py"
    file.write_text(COMPILE)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, str(file)]
    together = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    printed = [process.communicate()[0].strip() for process in together]
    later = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()
    assert len({*printed, later}) == 1
    assert len(list(tmp_path.rglob("*.nbc"))) == 1

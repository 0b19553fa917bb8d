"""Entry points are compiled, whatever state their cache is in."""

import sys

import numba
import numpy as np
import pytest

from sounder.kernels.compiler import cache, compile


@compile.part
def twice(x):
    return 2 * x


def double(x):
    for k in range(x.size):
        x[k] = twice(x[k])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Folder of machine code of this test's own."""
    for module in (cache, compile):
        monkeypatch.setattr(module, "cache_directory", lambda: tmp_path)
    return tmp_path


def doubled():
    """Compile `double`, or load it, and call it; return the entry point."""
    entry = compile.jit(double)
    for factor in (2, 4):
        x = np.ones(3) * (factor / 2)
        entry(x)
        np.testing.assert_array_equal(x, factor)
    return entry


def hits(entry):
    """How often numba found machine code in the cache."""
    return sum(entry.compiled.stats.cache_hits.values())


@pytest.mark.slow
def test_what_was_compiled_is_loaded_by_the_next_process(folder):
    assert cache.kept_files(double) == []
    assert hits(doubled()) == 0
    assert {path.suffix for path in cache.kept_files(double)} == {".nbi", ".nbc"}
    assert hits(doubled()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize(
    "damage", [lambda whole: b"", lambda whole: b"junk", lambda whole: whole[:100]], ids=["empty", "junk", "cut short"]
)
def test_damaged_files_are_made_anew(folder, suffix, damage):
    doubled()
    (file,) = (path for path in cache.kept_files(double) if path.suffix == suffix)
    file.write_bytes(damage(file.read_bytes()))
    assert hits(doubled()) == 0
    assert hits(doubled()) == 1


@pytest.mark.slow
def test_a_disk_that_is_full_costs_only_time(folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    doubled()
    assert cache.kept_files(double) == []


def test_without_a_directory_kernels_are_compiled_anew(monkeypatch):
    for module in (cache, compile):
        monkeypatch.setattr(module, "cache_directory", lambda: None)
    doubled()


def test_an_error_of_the_kernel_itself_is_raised(folder):
    with pytest.raises(numba.TypingError):
        compile.jit(double)("no array")


@pytest.mark.slow
@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_is_told_once_that_kernels_are_compiled(folder, monkeypatch, capsys, terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    monkeypatch.setattr(compile, "_announced", compile.threading.Event())
    doubled()
    assert capsys.readouterr().err == ("compiling, once\n" if terminal else "")
    for path in cache.kept_files(double):
        path.unlink()
    doubled()
    assert capsys.readouterr().err == ""


def test_a_terminal_is_not_told_of_what_is_loaded(folder, monkeypatch, capsys):
    doubled()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(compile, "_announced", compile.threading.Event())
    doubled()
    assert capsys.readouterr().err == ""

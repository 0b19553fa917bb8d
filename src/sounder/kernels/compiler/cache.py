"""Where machine code is kept between runs.

The cache serves read-only installations, accounts without a home, clusters that share one home among unlike machines,
and several processes that start at once. Two rules make it safe:

* its directory is named by everything that the machine code depends on (kernel sources, versions, settings of numba,
  processor), so that a cache entry is never stale and never another machine's;
* every entry point is called with one signature only. Numba numbers the signatures of a function as they come, and
  two processes that compile different ones at the same time could swap them. With one there is nothing to swap.
"""

import contextlib
import hashlib
import os
import platform
import stat
import tempfile
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba

from sounder.kernels.compiler.machine import processor_kind

SETTINGS = ("CPU_NAME", "CPU_FEATURES", "ENABLE_AVX", "OPT", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "DISABLE_INTEL_SVML")
"""Settings of `numba.config` that change the machine code."""
NOT_IN_NAMES = str.maketrans("", "", "<>")
"""What numba leaves out of file names."""
MIN_FREE_SPACE = 1 << 22
"""Free space that a new directory must have [byte]: four times what the machine code of all kernels takes."""


@cache
def cache_directory() -> Path | None:
    """Return the directory of this build's machine code, or None when no directory can be written.

    First of: ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME`` or ``~/.cache``, the system's temporary directory. One that holds
    machine code needs no more room: on a disk that became full, kernels are loaded as before.
    """
    for directory in _candidates(f"kernels-{_fingerprint()}"):
        try:
            directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            filled = any(directory.rglob("*.nbi"))
            with tempfile.TemporaryFile(dir=directory) as probe:
                probe.write(b"" if filled else bytes(MIN_FREE_SPACE))
        except OSError:
            continue
        if _private(directory):
            return directory
    return None


def kept_files(function: Any) -> list[Path]:
    """List the files that numba keeps of a function: an index, and machine code."""
    directory = cache_directory()
    if directory is None:
        return []
    name = f"{Path(function.__code__.co_filename).stem}.{function.__qualname__}-".translate(NOT_IN_NAMES)
    return [path for path in directory.rglob("*.nb[ic]") if path.name.startswith(name)]


@contextlib.contextmanager
def numba_caches_in(directory: Path) -> Iterator[None]:
    """Have numba keep what is decorated meanwhile in a directory.

    Numba takes the directory from the environment. So the variable is set meanwhile, and numba asked to read the
    environment again; settings that a program assigned to `numba.config` are lost by that.
    """
    before = os.environ.get("NUMBA_CACHE_DIR")
    os.environ["NUMBA_CACHE_DIR"] = str(directory)
    numba.config.reload_config()
    try:
        yield
    finally:
        if before is None:
            del os.environ["NUMBA_CACHE_DIR"]
        else:
            os.environ["NUMBA_CACHE_DIR"] = before
        numba.config.reload_config()


def _candidates(name: str) -> Iterator[Path]:
    if numba.config.CACHE_DIR:
        yield Path(numba.config.CACHE_DIR) / name
    configured = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    if configured:
        yield Path(configured) / "sounder" / name
    with contextlib.suppress(RuntimeError):  # no home to be found; the temporary directory follows
        yield Path.home() / ".cache" / "sounder" / name
    # Directly in the (sticky) temporary directory, so that nobody can exchange what is in between.
    user = os.getuid() if hasattr(os, "getuid") else "user"
    with contextlib.suppress(FileNotFoundError):  # not even that; kernels are then compiled in every process
        yield Path(tempfile.gettempdir()) / f"sounder-{user}-{name}"


def _private(directory: Path) -> bool:
    """Tell whether the directory is the user's own and nobody else can put code there: it is run unseen."""
    if not hasattr(os, "getuid"):
        return True
    facts = directory.stat(follow_symlinks=False)
    return stat.S_ISDIR(facts.st_mode) and facts.st_uid == os.getuid() and not facts.st_mode & 0o022


def _fingerprint() -> str:
    """Name everything that the machine code depends on."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(source.read_bytes())
    settings = [f"{name}={getattr(numba.config, name, None)}" for name in SETTINGS]
    build = [platform.python_version(), numba.__version__, version("llvmlite"), *settings, processor_kind()]
    digest.update("\n".join(build).encode())
    return digest.hexdigest()[:16]

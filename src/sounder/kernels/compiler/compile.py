"""The compiler's settings: how a kernel is compiled, and where its machine code is kept between runs.

The cache must serve read-only installations, accounts without a home, clusters that share one home among unlike
machines, and several processes that start at once. Two rules make it safe:

* its directory is named by everything the machine code depends on (kernel sources, versions, processor), so that a
  cache entry is never stale and never another machine's;
* every entry point is only ever called with one signature. Numba numbers the signatures of a function as they come,
  and two processes compiling different ones at the same time could swap them; with one there is nothing to swap.
"""

import contextlib
import hashlib
import os
import platform
import stat
import tempfile
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding as llvm
import numba
from numba.extending import overload

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

# Strict arithmetic, not even a*b + c in one instruction: parts are compiled within each entry point they are in, and
# only what every compilation must round alike gives the same bits in all.
SETTINGS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

_setting = threading.Lock()


def jit(function: Kernel) -> Kernel:
    """Compile an entry point: releases the GIL, cached on disk when any directory can be written.

    Call it with one signature only (see the module's docstring).
    """
    directory = cache_directory()
    if directory is None:
        return numba.njit(**SETTINGS)(function)
    with _setting:
        chosen = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(directory)
        try:
            return numba.njit(cache=True, **SETTINGS)(function)
        finally:
            numba.config.CACHE_DIR = chosen


def part(function: Kernel) -> Kernel:
    """Let entry points call a function, and compile it within them; Python can call it as it is written."""

    @overload(function, jit_options={"error_model": "numpy"}, strict=False, prefer_literal=True)
    def itself(*_arguments: Any) -> Kernel:
        return function

    return function


@cache
def cache_directory() -> Path | None:
    """Return the directory of this build's machine code, or None when no directory can be written.

    First of: ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME`` or ``~/.cache``, the system's temporary directory.
    """
    for directory in _candidates(f"kernels-{_fingerprint()}"):
        try:
            directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                pass
        except OSError:
            continue
        if _private(directory):
            return directory
    return None


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
    features = sorted(name for name, present in llvm.get_host_cpu_features().items() if present)
    build = [
        platform.python_version(),
        numba.__version__,
        llvmlite.__version__,
        llvm.get_host_cpu_name(),
        *features,
    ]
    digest.update(" ".join(build).encode())
    return digest.hexdigest()[:16]

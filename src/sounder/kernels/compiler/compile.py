"""How kernels are compiled: `jit` for entry points, `part` for the functions that these call."""

import functools
import gc
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numba
from numba.extending import overload

from sounder.kernels.compiler.cache import cache_directory, kept_files, numba_caches_in

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

# Strict arithmetic, not even a*b + c in one instruction: parts are compiled within each entry point they are in, and
# only what every compilation must round alike gives the same bits in all.
SETTINGS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}

ANY_ORDER = {**SETTINGS, "fastmath": {"contract", "nsz", "reassoc"}}
"""Sums of many numbers in whatever order and partial sums the processor is fastest with."""

_first_calls = threading.RLock()
_announced = threading.Event()


def jit(function: Callable[..., Any]) -> "EntryPoint":
    """Compile an entry point at its first call: releases the GIL, cached on disk when any directory can be written.

    Call it with one signature only (see `sounder.kernels.compiler.cache`).
    """
    return EntryPoint(function)


def part(function: Kernel) -> Kernel:
    """Let entry points call a function, and compile it within them; Python calls it as it is written."""
    return _compiled_within(function, SETTINGS, literals=False)


def part_in_any_order(function: Kernel) -> Kernel:
    """Like `part`, but sums may be taken in any order: the last bits depend on the processor."""
    return _compiled_within(function, ANY_ORDER, literals=False)


def part_with_literals(function: Kernel) -> Kernel:
    """Like `part`, but compiled anew for every number that is written in the source and passed as an argument."""
    return _compiled_within(function, SETTINGS, literals=True)


def _compiled_within(function: Kernel, settings: dict[str, Any], *, literals: bool) -> Kernel:
    @overload(function, jit_options=settings, strict=False, prefer_literal=literals)
    def itself(*_arguments: Any) -> Kernel:
        return function

    return function


class EntryPoint:
    """A compiled function that Python calls.

    Attributes
    ----------
    function : function
        As it is written.
    compiled : callable or None
        What numba made of it; None before the first call.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.function = function
        self.compiled: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Call it; the first call compiles it, or loads what was compiled earlier."""
        if self.compiled is None:
            with _first_calls:
                if self.compiled is None:
                    self.compiled = self._prepared(tuple(map(numba.typeof, arguments)))
        return self.compiled(*arguments)

    @property
    def signatures(self) -> list[Any]:
        """Types of arguments that it was compiled for."""
        return list(getattr(self.compiled, "signatures", []))

    def _prepared(self, signature: tuple[Any, ...]) -> Callable[..., Any]:
        """Compile it, or load it, whatever state the cache is in."""
        if numba.config.DISABLE_JIT:
            return self.function
        if not kept_files(self.function):
            _announce()
        try:
            return self._compiled(signature, cached=True)
        except numba.NumbaError:  # of the kernel itself
            raise
        except OSError:  # the disk is full
            return self._compiled(signature, cached=False)
        except Exception:  # unpickling what is damaged may raise anything
            for path in kept_files(self.function):
                path.unlink(missing_ok=True)
        return self._compiled(signature, cached=True)

    def _compiled(self, signature: tuple[Any, ...], *, cached: bool) -> Callable[..., Any]:
        compiled = self._decorated(cached=cached)
        with _no_garbage_collection():
            compiled.compile(signature)
        return compiled

    def _decorated(self, *, cached: bool) -> Any:
        directory = cache_directory() if cached else None
        if directory is None:
            return numba.njit(**SETTINGS)(self.function)
        with numba_caches_in(directory):
            return numba.njit(cache=True, **SETTINGS)(self.function)


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Collect no garbage meanwhile: compiling makes many objects and little garbage; this saves a tenth of its time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _announce() -> None:
    """Say on a terminal, once, what takes so long."""
    if _announced.is_set() or not sys.stderr.isatty():
        return
    _announced.set()
    once = "once" if cache_directory() else "at every start: no folder for compiled code can be written"
    print(f"compiling, {once}", file=sys.stderr)

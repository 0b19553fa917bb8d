"""Functions large enough to be compiled on their own, by a process of their own where that saves time.

Compiling keeps one processor busy for seconds, most of it in Python: threads would take turns. An entry point calls a
stage by its address, so that neither is compiled with the other, and a second process can do the one meanwhile.
"""

import atexit
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numba.experimental.function_type  # has numba know the protocol
from numba.core.types import WrapperAddressProtocol

from sounder.kernels.compiler.compile import cache_directory, jit
from sounder.kernels.correlation.directions import processors

_helpers: list[subprocess.Popen[bytes]] = []


class Stage(WrapperAddressProtocol):
    """A compiled function that entry points take as an argument and call.

    It returns nothing, and like an entry point is only ever called with arguments of the same types.

    Parameters
    ----------
    function : callable
    """

    def __init__(self, function: Callable[..., None]) -> None:
        self._function = function
        self._dispatcher: Any = jit(function, by_address=True)
        self._types: tuple[Any, ...] = ()

    def given(self, *arguments: Any) -> "Stage":
        """Say what it will be called with."""
        self._types = tuple(numba.typeof(argument) for argument in arguments)
        return self

    def compile(self) -> None:
        """Compile it, or load what was compiled earlier."""
        self._dispatcher.compile(self._types)

    def kept(self) -> bool:
        """Tell whether its machine code is in the cache."""
        module = self._function.__module__.rpartition(".")[2]
        return any(Path(self._dispatcher.stats.cache_path).glob(f"{module}.*{self._function.__name__}-*.nbi"))

    def __call__(self, *arguments: Any) -> None:
        """Call it; compiled functions do."""
        self._dispatcher(*arguments)

    def signature(self) -> Any:
        """Types of arguments and result, as numba asks for them."""
        return numba.void(*self._types)

    def __wrapper_address__(self) -> int:
        """Address of the machine code, as numba asks for it before a call."""
        if self._types not in self._dispatcher.overloads:
            for helper in _helpers:
                helper.wait()
            self.compile()
        compiled = self._dispatcher.overloads[self._types]
        address: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)
        return address


def compile_meanwhile(stage: Stage, module: str) -> None:
    """Have a module run in another process, which compiles the stage, unless its machine code is kept already.

    Entry points that need the stage wait for it; if the process fails, they compile it themselves.
    """
    if cache_directory() is None or processors() < 2 or stage.kept():
        return
    quiet = subprocess.DEVNULL
    helper = subprocess.Popen([sys.executable, "-m", module], stdin=quiet, stdout=quiet, stderr=quiet)
    _helpers.append(helper)
    atexit.register(_end, helper)


def _end(helper: "subprocess.Popen[bytes]") -> None:
    helper.terminate()
    helper.wait()

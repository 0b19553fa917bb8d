"""Processes with limits on memory and processor time, for libraries that a hostile file can crash or hang."""

import os
import subprocess
import sys

CALL = "import sys; sys.path[:] = {path!r}; from {module} import main; main()"
BASE = 2**30
"""Address space that Python and its libraries take before they read anything [byte]; chosen, twice what they take."""
KILLED = "a crash, or the limit of time"


def start(module: str, *arguments: str) -> "subprocess.Popen[bytes]":
    """Start ``main`` of a module in a process of its own, with pipes to its input and its output.

    It ends with this process: its input ends then.
    """
    return subprocess.Popen(
        [sys.executable, "-P", "-c", CALL.format(path=sys.path, module=module), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"},
    )


def limit(memory: int, seconds: int) -> None:
    """Limit this process: address space beyond `BASE` [byte] and processor time [s]. Windows has no such limits."""
    if sys.platform == "win32":
        return
    import resource
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to the process that waits for this one
    for what, most in ((resource.RLIMIT_AS, BASE + memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, most))

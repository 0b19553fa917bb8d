"""Properties of this machine: number of processors that a process may use, and their type."""

import os
import platform
from pathlib import Path

CPUINFO = Path("/proc/cpuinfo")
X86 = "vendor_id", "cpu family", "model", "model name", "stepping", "flags"
ARM = "CPU implementer", "CPU architecture", "CPU variant", "CPU part", "CPU revision", "Features"
"""Lines of `CPUINFO` that tell kinds of processors apart."""


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processor_kind() -> str:
    """Describe the kind of processor: equal texts for machines that run each other's machine code."""
    try:
        lines = CPUINFO.read_text(errors="replace").splitlines()
    except OSError:  # not Linux
        lines = []
    kind = {line for line in lines if line.partition(":")[0].strip() in X86 + ARM}
    return "\n".join([platform.machine(), platform.processor(), *sorted(kind)])

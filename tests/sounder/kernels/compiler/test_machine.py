"""What this machine is."""

import os

from sounder.kernels.compiler import machine


def test_processors_are_those_that_this_process_may_use():
    assert 1 <= machine.processors() <= os.cpu_count()


def test_another_kind_of_processor_is_told_apart(monkeypatch, tmp_path):
    kinds = set()
    for flags in ("sse2 avx2", "sse2 avx2 avx512f"):
        for clock in ("2400", "3100"):
            cpuinfo = tmp_path / "cpuinfo"
            cpuinfo.write_text(f"model name\t: A\ncpu MHz\t\t: {clock}\nflags\t\t: {flags}\n")
            monkeypatch.setattr(machine, "CPUINFO", cpuinfo)
            kinds.add(machine.processor_kind())
    monkeypatch.setattr(machine, "CPUINFO", tmp_path / "absent")
    assert machine.processor_kind() not in kinds
    assert len(kinds) == 2  # by the flags, not by the clock

"""Command lines in forked children with limits, so that libraries are loaded once for thousands of them."""

import contextlib
import io
import multiprocessing
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import sounder.campaign.run
import sounder.figures.processes
import sounder.processing.scoring
import sounder.twin.simulate  # noqa: F401 - commands import these when they run; here they are loaded once for all
from erm import cli as erm_cli
from sounder import cli as sounder_cli

MOST_SECONDS, MOST_BYTES = 10, 2 * 2**30
"""Processor time [s] and memory [byte] that a command line may take for a small file, whatever is in it."""
PATIENCE = 60 * MOST_SECONDS
"""Time after which a command that does not compute hangs [s]; other processes of the machine may take most of it."""
CRASHED = 97
"""Exit code of a child that ended otherwise than a command does."""
FORK = multiprocessing.get_context("fork")

Command = Sequence[object]


@dataclass(frozen=True)
class Trial:
    """A command line, what makes its files before, and what must hold when it succeeds (the names of what does not)."""

    command: Command
    prepare: Callable[[], object] = int
    verify: Callable[[], list[str]] = list


@dataclass(frozen=True)
class Ended:
    """How a command line ended; a signal is a negative exit code, as `subprocess` has it."""

    code: int
    said: str = ""
    seconds: float = 0.0
    memory: int = 0
    wrong: list[str] = field(default_factory=list)

    @property
    def faults(self) -> list[str]:
        """What must not happen, whatever a file holds."""
        crashed = f"signal {signal.Signals(-self.code).name}" if self.code < 0 else f"exit code {self.code}"
        found = {
            crashed: self.code not in (0, 1, 2),
            "traceback or warning": "Traceback" in self.said or "Warning:" in self.said,
            "internal error": "internal error" in self.said,
            "failed without a word": self.code in (1, 2) and not self.said.strip(),
            f"more than {MOST_SECONDS} s": self.seconds > MOST_SECONDS,
            "more than 2 GiB": self.memory > MOST_BYTES,
        }
        return [name for name, is_so in found.items() if is_so] + self.wrong


def run(command: Command) -> int:
    """Run a command line in this process, and return its exit code."""
    sys.argv = list(map(str, command))
    try:
        (sounder_cli if command[0] == "sounder" else erm_cli).main()
    except SystemExit as stop:
        return int(stop.code or 0)
    return CRASHED


def load(commands: Sequence[Command]) -> None:
    """Run command lines in this process, so that its children have all modules and compiled kernels."""
    for command in commands:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            run(command)
    assert threading.active_count() == 1, "children lack the threads of their parent"


def started(trial: Trial, log: Path) -> Any:
    """Start a command line in a child of its own; its output goes to ``log``."""
    child = FORK.Process(target=_alone, args=(trial, log))
    child.start()
    return child


def waited(child: Any, log: Path, patience: float | None = PATIENCE) -> Ended:
    """Wait for a child of `started`."""
    child.join(patience)
    if child.is_alive():
        child.kill()
        child.join()
    return Ended(child.exitcode, log.read_text(errors="replace"))


def run_all(trials: Sequence[Trial], log: Path) -> Iterator[Ended]:
    """Run command lines one after another in one child, and in a new one after each that crashes, hangs or swells."""
    done = 0
    while done < len(trials):
        here, there = FORK.Pipe(duplex=False)
        child = FORK.Process(target=_serve, args=(trials[done:], log, there))
        child.start()
        there.close()
        try:
            while here.poll(PATIENCE):
                yield here.recv()
                done += 1
        except EOFError:
            child.join()
        else:
            child.kill()
            child.join()
        if done < len(trials) and (child.exitcode or not done):
            yield Ended(child.exitcode, log.read_text(errors="replace"))
            done += 1


def _alone(trial: Trial, log: Path) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):  # as a command finds them
        signal.signal(number, signal.SIG_DFL)
    _redirect(log)
    trial.prepare()
    _leave(run(trial.command))


def _serve(trials: Sequence[Trial], log: Path, pipe: Any) -> None:
    _redirect(log)
    resource.setrlimit(resource.RLIMIT_AS, (4 * MOST_BYTES, 4 * MOST_BYTES))
    for trial in trials:
        trial.prepare()
        os.truncate(log, 0)
        signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)  # its signal ends the child, also within a library
        begun = time.process_time()
        code = run(trial.command)
        seconds = time.process_time() - begun
        signal.setitimer(signal.ITIMER_PROF, 0)
        sys.stderr.flush()
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        pipe.send(Ended(code, log.read_text(errors="replace"), seconds, memory, trial.verify() if not code else []))
        if memory > MOST_BYTES:
            break
    pipe.close()
    _leave(0)


def _redirect(log: Path) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND), 2)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))


def _leave(code: int) -> None:
    sys.stderr.flush()
    os._exit(code)

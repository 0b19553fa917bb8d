"""What commands say besides their result: notes, failures and details on stderr, and results as JSON.

Colours are for terminals only, and not where ``NO_COLOR`` is set (https://no-color.org).
"""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from contextvars import ContextVar
from enum import IntEnum
from typing import Any, TextIO


class Loudness(IntEnum):
    """How much a command says."""

    QUIET = 0
    """Failures, and results as JSON."""
    USUAL = 1
    VERBOSE = 2
    """Also how long each step took."""


_loudness: ContextVar[Loudness] = ContextVar("loudness", default=Loudness.USUAL)
_results: ContextVar[TextIO | None] = ContextVar("results", default=None)
RED, YELLOW = 31, 33
"""Colours of terminals (ECMA-48, select graphic rendition)."""


@contextmanager
def loudness(level: Loudness) -> Iterator[None]:
    """Say as much as ``level`` within a block."""
    with ExitStack() as stack:
        if level == Loudness.QUIET:
            results = _results.set(sys.stdout)
            stack.callback(_results.reset, results)
            stack.enter_context(redirect_stdout(stack.enter_context(open(os.devnull, "w", encoding="utf-8"))))
        before = _loudness.set(level)
        stack.callback(_loudness.reset, before)
        yield


def note(text: str) -> None:
    """Say what is not a failure."""
    if _loudness.get() > Loudness.QUIET:
        print(_coloured(text, YELLOW), file=sys.stderr)


def failure(text: str) -> None:
    """Say what failed."""
    print(_coloured(text, RED), file=sys.stderr)


def detail(text: str) -> None:
    """Say what only ``--verbose`` says."""
    if _loudness.get() == Loudness.VERBOSE:
        print(text, file=sys.stderr)


def write_json(value: Any) -> None:
    """Print a result as JSON, also if the command is quiet."""
    print(json.dumps(value, indent=2, allow_nan=False), file=_results.get() or sys.stdout)


def _coloured(text: str, colour: int) -> str:
    if not sys.stderr.isatty() or "NO_COLOR" in os.environ:
        return text
    return f"\x1b[{colour}m{text}\x1b[0m"

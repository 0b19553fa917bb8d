"""Ctrl-C and SIGTERM, remembered: libraries lose what is raised within their callbacks, or make errors of it."""

import signal
from threading import Event
from typing import Any

terminated = Event()
interrupted = Event()


def listen(handler: Any) -> None:
    """Set what happens on Ctrl-C and SIGTERM, and forget those that were."""
    interrupted.clear()
    terminated.clear()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


def interrupt(number: int, frame: object) -> None:
    """Raise KeyboardInterrupt and remember it."""
    interrupted.set()
    if number == signal.SIGTERM:
        terminated.set()
    signal.default_int_handler(number, None)


def raise_lost_interrupt() -> None:
    """Raise KeyboardInterrupt again if a library lost one."""
    if interrupted.is_set():
        interrupted.clear()
        raise KeyboardInterrupt

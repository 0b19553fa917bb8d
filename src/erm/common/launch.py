"""A command line started: Ctrl-C is heard while it is still being loaded, too."""

import sys
from importlib import import_module

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def launch(module: str) -> None:
    """Load a module and run its ``main``."""
    try:
        main = import_module(module).main
    except KeyboardInterrupt:
        print("interrupted before anything was begun", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    main()

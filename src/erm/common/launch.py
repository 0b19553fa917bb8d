"""Start a command line so that Ctrl-C also works while it is loading."""

import os
import sys
from importlib import import_module

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def launch(module: str) -> None:
    """Load a module and run its ``main``."""
    os.environ["MPLBACKEND"] = "agg"  # notebooks leave theirs to the commands that they start; these draw files only
    try:
        import_module(module).main()
    except KeyboardInterrupt:
        print("interrupted; nothing was done", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None

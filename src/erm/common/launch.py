"""Start a command line so that Ctrl-C works while it is loaded, too."""

import sys
from importlib import import_module

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


def launch(module: str) -> None:
    """Load a module and run its ``main``."""
    try:
        main = import_module(module).main
    except KeyboardInterrupt:
        print("interrupted; nothing was done", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    main()

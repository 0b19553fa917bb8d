"""What the tests of the command line do with commands."""

import sys

import pytest

from erm import cli


def run(*arguments) -> int:
    """Run the command in this process as a shell would."""
    old, sys.argv = sys.argv, ["erm", *map(str, arguments)]
    try:
        with pytest.raises(SystemExit) as stop:
            cli.main()
    finally:
        sys.argv = old
    return int(stop.value.code or 0)

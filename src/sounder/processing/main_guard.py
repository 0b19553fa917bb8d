"""Scripts that start processes: these run the script again, so it must tell when it is run itself."""

import ast
import sys
from pathlib import Path

from erm.common.errors import DataError

GUARD = 'if __name__ == "__main__":'


def require_main_guard() -> None:
    """Refuse to start processes from a script whose call is not below `GUARD`.

    Raises
    ------
    DataError
        The line that runs now, of the file that Python was started with, is not below it.
    """
    frame = sys._getframe()
    while frame.f_back is not None:
        frame = frame.f_back
        if frame.f_code.co_name == "<module>" and frame.f_globals.get("__name__") == "__main__":
            break
    path = Path(frame.f_code.co_filename)
    if frame.f_globals.get("__spec__") is None and path.is_file() and not _guarded(path, frame.f_lineno):
        raise DataError(
            f"{path}:{frame.f_lineno}: workers are processes that run this script again; put this line below `{GUARD}`"
        )


def _guarded(path: Path, line: int) -> bool:
    """Whether a line is below a condition on ``__name__``."""
    tree = ast.parse(path.read_bytes())
    guards = [node for node in ast.walk(tree) if isinstance(node, ast.If) and "__name__" in ast.unparse(node.test)]
    return any(node.lineno <= line <= (node.end_lineno or line) for node in guards)

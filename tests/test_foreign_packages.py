"""How the sources use other packages: by their documented names, and without changing them."""

import ast
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

SRC = Path(__file__).parents[1] / "src"
OURS = ("sounder", "erm")
INTRINSICS = SRC / "sounder" / "kernels" / "correlation" / "avx512_instructions.py"
"""The one file that writes instructions; numba has no documented interface for that."""
HOOKS = ("os.environ", "sys.unraisablehook")
"""What Python documents to be set by programs."""

SOURCES = set(SRC.rglob("*.py"))


def undocumented(name: str) -> bool:
    """Tell whether a dotted name is numba's own business, or that of the compiler behind it."""
    first, *rest = name.split(".")
    if first == "llvmlite":
        return True
    return first == "numba" and (
        rest[:1] in (["core"], ["np"]) or any(part.startswith("_") and not part.startswith("__") for part in rest)
    )


def dotted(node: ast.AST) -> str:
    """Return the dotted name that an expression begins with: ``a.b`` of ``a.b[0].c``."""
    if isinstance(node, ast.Subscript):
        return dotted(node.value)
    if isinstance(node, ast.Attribute):
        before = dotted(node.value)
        return f"{before}.{node.attr}" if before else ""
    return node.id if isinstance(node, ast.Name) else ""


def imported(tree: ast.Module) -> dict[str, str]:
    """Names that a file imports, and what they stand for."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for each in node.names:
                names[each.asname or each.name.split(".")[0]] = each.name if each.asname else each.name.split(".")[0]
                names[f"import {each.name}"] = each.name
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
    return names


def full_name(node: ast.AST, names: dict[str, str]) -> str:
    """Name an expression by what its first name stands for; empty if that is not imported."""
    first, _, rest = dotted(node).partition(".")
    return ".".join(filter(None, [names[first], rest])) if first in names else ""


def undocumented_names(tree: ast.Module) -> Iterator[str]:
    names = imported(tree)
    used = [full_name(node, names) for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    yield from (name for name in [*names.values(), *used] if undocumented(name))


def changed_names(tree: ast.Module) -> Iterator[str]:
    names = imported(tree)
    for node in ast.walk(tree):
        targets: list[ast.AST] = []
        if isinstance(node, ast.Assign | ast.Delete):
            targets = [leaf for target in node.targets for leaf in ast.walk(target)]
        elif isinstance(node, ast.AugAssign | ast.AnnAssign):
            targets = [node.target]
        elif isinstance(node, ast.Call) and dotted(node.func) in ("setattr", "delattr"):
            targets = [node.args[0]]
        for target in targets:
            name = full_name(target, names)
            by_call = isinstance(node, ast.Call)
            by_statement = isinstance(target, ast.Attribute | ast.Subscript) and not isinstance(target.ctx, ast.Load)
            if name and (by_call or by_statement) and not name.startswith((*HOOKS, *OURS)):
                yield name


def found_in(sources: Iterable[Path], scan: Callable[[ast.Module], Iterator[str]]) -> dict[str, set[str]]:
    found = {str(path.relative_to(SRC)): set(scan(ast.parse(path.read_text(encoding="utf-8")))) for path in sources}
    return {path: names for path, names in found.items() if names}


@pytest.mark.slow
def test_numba_is_used_by_its_documented_names():
    assert found_in(SOURCES - {INTRINSICS}, undocumented_names) == {}


@pytest.mark.slow
def test_no_other_package_is_changed():
    assert found_in(SOURCES, changed_names) == {}


def test_the_scan_finds_what_it_looks_for():
    source = """
import numba, numba.core.types, os, sys, llvmlite.binding as llvm
from numba import _dynfunc, njit
from numba.np import arrayobj
numba._helperlib
numba.config.CACHE_DIR = "x"
sys.modules["dask"] = None
types = njit.attribute
a, njit.attribute = 1, 2
setattr(numba, "X", 1)
os.environ["x"] = "y"
"""
    tree = ast.parse(source)
    assert set(undocumented_names(tree)) == {
        "numba.core.types",
        "llvmlite.binding",
        "numba._dynfunc",
        "numba.np.arrayobj",
        "numba._helperlib",
    }
    assert set(changed_names(tree)) == {"numba.config.CACHE_DIR", "sys.modules", "numba.njit.attribute", "numba"}

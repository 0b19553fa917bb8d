"""Compilation of an entry point and its parts in one go.

Numba optimises every function and makes machine code of it, and both again of the copy within each function that
calls it: some of the parts here, seven times. Parts are not called from elsewhere, so one time will do: their code is
kept as it is first written until the entry point they are in is optimised. The passes over numba's own representation
that look for what kernels do not use, closures and array expressions among them, are left out.
"""

from typing import Any

from numba import _dynfunc, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering

NEEDLESS = {
    "with_lifting",
    "inline_closure_likes",
    "rewrite_semantic_constants",
    "dead_branch_prune",
    "Rewrite dynamic raises",
    "make_function_op_code_to_jit_function",
    "inline_inlinables",
    "find_literally",
    "literal_unroll",
    "LiteralPropagation",
    "inline_overloads",
    "nopython_rewrites",
    "nopython_supported_feature_validation",
    "dump_parfor_diagnostics",
}


find_call_type = types.Function.get_call_type
_call_types: dict[Any, Any] = {}


class SettledFlags(Flags):
    """Flags of a compilation, which change no more once it goes on.

    Numba looks them up by value at every call that it finds, and makes a dictionary of their two dozen values each
    time, a tenth of its work.
    """

    __slots__ = ("_settled",)

    def __init__(self, flags: Flags | None = None) -> None:
        super().__init__(flags)
        self._settled: tuple[int, dict[str, Any]] | None = None

    def settled(self) -> tuple[int, dict[str, Any]]:
        """Hash and values."""
        if self._settled is None:
            self._settled = super().__hash__(), self.values()
        return self._settled

    def __hash__(self) -> int:
        return self.settled()[0]

    def __eq__(self, other: object) -> bool:
        if isinstance(other, SettledFlags):
            return self is other or self.settled() == other.settled()
        return super().__eq__(other)


class EntryCompiler(CompilerBase):
    """Compiler of functions that Python calls."""

    def __init__(self, typing: Any, target: Any, library: Any, args: Any, kind: Any, flags: Flags, names: Any) -> None:
        super().__init__(typing, target, library, args, kind, SettledFlags(flags), names)

    def define_pipelines(self) -> list[PassManager]:
        """Take numba's passes but the needless."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [self.chosen(each) for each in passes.passes if each[0].name() not in NEEDLESS]
        passes.finalize()
        return [passes]

    def chosen(self, each: tuple[type, str]) -> tuple[type, str]:
        """Choose what does a pass's work."""
        return each

    def compile_extra(self, function: Any) -> Any:
        """Compile, with a memory for what types calls have."""
        with global_compiler_lock:
            before = types.Function.get_call_type
            types.Function.get_call_type = remember_call_type
            try:
                return super().compile_extra(function)
            finally:
                types.Function.get_call_type = before


class PartCompiler(EntryCompiler):
    """Compiler of functions that only compiled functions call."""

    def chosen(self, each: tuple[type, str]) -> tuple[type, str]:
        """Have no machine code made."""
        return (PartLowering, each[1]) if each[0] is NativeLowering else each


def remember_call_type(function: Any, context: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """Type of a call, found once for each types of arguments.

    Numba goes through all definitions of an operator at every place where it is used, a quarter of its work.
    """
    if arguments and isinstance(arguments[0], types.Array):  # numbers in the source have types of their own
        arguments = tuple(map(types.unliteral, arguments))
    call = function, tuple(arguments)
    if named:
        return find_call_type(function, context, arguments, named)
    if call not in _call_types:
        _call_types[call] = find_call_type(function, context, arguments, named)
    return _call_types[call]


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Write a part's code for those that call it."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Register the part with an address of zero."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        described = lowered.fndesc
        function = _dynfunc.make_function(
            described.lookup_module(), described.qualname, "", 0, lowered.env, (state.library,)
        )
        state.targetctx.insert_user_function(function, described, [state.library])
        state["cr"] = lowered._replace(cfunc=function)
        return True


class PartLibrary(JITCodeLibrary):
    """Code of a part and of those that it calls, neither optimised nor made machine code of."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

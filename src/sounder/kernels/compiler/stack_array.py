"""Small arrays that live as long as a call."""

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np import arrayobj


@intrinsic(prefer_literal=True)
def scratch(_context: Any, size: Any) -> tuple[Any, Callable[..., Any]]:
    """Array of a literal number of float64 on the stack, not set; allocating it as numpy does takes seven functions."""
    kind = types.Array(types.float64, 1, "C")

    def generate(context: Any, builder: Any, _signature: Any, _values: Any) -> Any:
        array = arrayobj.make_array(kind)(context, builder)
        count = context.get_constant(types.intp, size.literal_value)
        data = cgutils.alloca_once(builder, context.get_data_type(kind.dtype), size=count)
        width = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        arrayobj.populate_array(array, data, [count], [width], width, meminfo=None)
        return array._getvalue()

    return kind(size), generate

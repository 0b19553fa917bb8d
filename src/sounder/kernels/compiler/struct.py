"""Named tuples of arrays, handed to compiled functions by reference.

Numba hands a named tuple over field by field: seven to nine numbers an array, a hundred and more for some tuples here,
at every call, and taking them apart and putting them together again was most of the code there was to compile. As a
`bundle`, a tuple is one address: of a copy of its fields that the entry point makes on its stack. Compiled functions
may read attributes of a bundle, and that is all; in Python it stays the named tuple it is.
"""

from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np import arrayobj

Tuple = TypeVar("Tuple", bound=type)
Value = Any


def bundle(kind: Tuple) -> Tuple:
    """Hand a class of named tuples to compiled functions by reference."""

    @typeof_impl.register(kind)
    def typeof(value: Any, context: Any) -> Bundle:
        return Bundle(types.BaseTuple.from_types([typeof_impl(field, context) for field in value], kind))

    return kind


class Bundle(types.Type):
    """Type of a bundle of the fields of a named tuple type."""

    def __init__(self, fields: types.BaseNamedTuple) -> None:
        self.fields = fields
        super().__init__(name=f"Bundle({fields})")

    def place(self, attribute: str) -> int:
        """Place of a field."""
        place: int = self.fields.fields.index(attribute)
        return place


@register_model(Bundle)
class BundleModel(models.PrimitiveModel):
    """Address of the fields."""

    def __init__(self, manager: Any, kind: Bundle) -> None:
        fields = [manager.lookup(field).get_value_type() for field in kind.fields]
        super().__init__(manager, kind, ir.LiteralStructType(fields).as_pointer())


@unbox(Bundle)
def unbox_bundle(kind: Bundle, value: Value, c: Any) -> NativeValue:
    """Put the fields on the stack of the function that Python calls."""
    native = c.unbox(kind.fields, value)
    return NativeValue(
        cgutils.alloca_once_value(c.builder, native.value), is_error=native.is_error, cleanup=native.cleanup
    )


@infer_getattr
class BundleAttributes(AttributeTemplate):
    """Types of the fields."""

    key = Bundle

    def generic_resolve(self, kind: Bundle, attribute: str) -> types.Type | None:
        """Type of one of them."""
        return kind.fields[kind.place(attribute)] if attribute in kind.fields.fields else None


@lower_getattr_generic(Bundle)
def read_field(context: Any, builder: Any, kind: Bundle, address: Value, attribute: str) -> Value:
    """Load a field; of an array, what says where it is, while the caller answers for its life."""
    place = kind.place(attribute)
    field = kind.fields[place]
    if not isinstance(field, types.Array):
        return _load(builder, cgutils.gep_inbounds(builder, address, 0, place))
    array = arrayobj.make_array(field)(context, builder)
    members = context.data_model_manager[field]._fields

    def member(name: str, *index: int) -> Value:
        return _load(builder, cgutils.gep_inbounds(builder, address, 0, place, members.index(name), *index))

    shape = [member("shape", k) for k in range(field.ndim)]
    size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(field.dtype)))
    if field.layout == "C":
        strides = [size]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(length, strides[0]))
    else:
        strides = [member("strides", k) for k in range(field.ndim)]
    arrayobj.populate_array(array, member("data"), shape, strides, size, meminfo=None)
    return array._getvalue()


def _load(builder: Any, address: Value) -> Value:
    """Load what no function changes: the compiler may load it once, whatever is written in between."""
    loaded = builder.load(address)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded

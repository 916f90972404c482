"""Arrays that a part is handed and may not write: others read the same ones after it."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import lower_builtin, type_callable

_type_callable: Any = type_callable
_lower: Any = lower_builtin
_RECORD: Any = types.BaseNamedTuple
_TUPLE: Any = types.BaseTuple


def readonly(value: Any) -> Any:
    """An array, or a record of arrays, in a form that cannot be written: numba refuses to compile a store."""
    return map_arrays(value, _readonly_view)


def map_arrays(value: Any, make: Callable[[Any], Any]) -> Any:
    """An array, or a record of arrays and of such records, with what `make` gives in place of each array."""
    if isinstance(value, np.ndarray):
        return make(value)
    if isinstance(value, tuple):
        values = [map_arrays(item, make) for item in value]
        return type(value)(*values) if hasattr(value, "_fields") else tuple(values)
    return value


def _readonly_view(array: Any) -> Any:
    view = array.view()
    view.flags.writeable = False
    return view


def _map_type(kind: Any) -> Any:
    if isinstance(kind, types.Array):
        return kind.copy(readonly=True)
    if isinstance(kind, _RECORD):
        return _TUPLE.from_types([_map_type(member) for member in kind.types], kind.instance_class)
    return kind


_type_callable(readonly)(lambda _context: _map_type)
_lower(readonly, types.Any)(lambda _context, _builder, _signature, arguments: arguments[0])

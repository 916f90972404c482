"""The Open Dynamics Engine (ODE), version 0.16 in double precision: its C functions, for Python and for machine code.

It is a package of the system, not of Python: `apt-get install libode8` on Debian. Nothing here needs it until
`library` is called.
"""

import ctypes
from contextlib import suppress
from functools import cache
from typing import Any

import llvmlite.binding
import numpy as np
from numba import types

from epuckhebb.controller.arrays import Floats

_NAMES = ("libode.so.8", "libode.8.dylib")  # of version 0.16, whose functions and records these are
_PRECISION = b"ODE_double_precision"
_POINTER, _REAL, _INT, _NOTHING = ctypes.c_void_p, ctypes.c_double, ctypes.c_int, None
_FUNCTIONS: dict[str, tuple[Any, ...]] = {  # the C functions that Python calls: result, arguments
    "dInitODE2": (_INT, ctypes.c_uint),
    "dSetMessageHandler": (_NOTHING, _POINTER),
    "dAllocateODEDataForThread": (_INT, ctypes.c_uint),
    "dThreadingAllocateSelfThreadedImplementation": (_POINTER,),
    "dThreadingImplementationGetFunctions": (_POINTER, _POINTER),
    "dThreadingFreeImplementation": (_NOTHING, _POINTER),
    "dWorldCreate": (_POINTER,),
    "dWorldDestroy": (_NOTHING, _POINTER),
    "dWorldSetGravity": (_NOTHING, _POINTER, _REAL, _REAL, _REAL),
    "dWorldSetERP": (_NOTHING, _POINTER, _REAL),
    "dWorldSetCFM": (_NOTHING, _POINTER, _REAL),
    "dWorldSetStepThreadingImplementation": (_NOTHING, _POINTER, _POINTER, _POINTER),
    "dJointGroupCreate": (_POINTER, _INT),
    "dJointGroupDestroy": (_NOTHING, _POINTER),
    "dCreatePlane": (_POINTER, _POINTER, _REAL, _REAL, _REAL, _REAL),
    "dCreateBox": (_POINTER, _POINTER, _REAL, _REAL, _REAL),
    "dCreateCylinder": (_POINTER, _POINTER, _REAL, _REAL),
    "dGeomDestroy": (_NOTHING, _POINTER),
    "dGeomSetPosition": (_NOTHING, _POINTER, _REAL, _REAL, _REAL),
    "dGeomSetBody": (_NOTHING, _POINTER, _POINTER),
    "dGeomSetOffsetPosition": (_NOTHING, _POINTER, _REAL, _REAL, _REAL),
    "dGeomSetOffsetRotation": (_NOTHING, _POINTER, _POINTER),
    "dBodyCreate": (_POINTER, _POINTER),
    "dBodySetMass": (_NOTHING, _POINTER, _POINTER),
    "dBodySetPosition": (_NOTHING, _POINTER, _REAL, _REAL, _REAL),
    "dBodySetRotation": (_NOTHING, _POINTER, _POINTER),
    "dMassSetParameters": (_NOTHING, _POINTER, *[_REAL] * 10),
    "dMassSetCylinderTotal": (_NOTHING, _POINTER, _REAL, _INT, _REAL, _REAL),
    "dRFromAxisAndAngle": (_NOTHING, _POINTER, _REAL, _REAL, _REAL, _REAL),
    "dJointCreateHinge": (_POINTER, _POINTER, _POINTER),
    "dJointAttach": (_NOTHING, _POINTER, _POINTER, _POINTER),
    "dJointSetHingeAnchor": (_NOTHING, _POINTER, _REAL, _REAL, _REAL),
    "dJointSetHingeAxis": (_NOTHING, _POINTER, _REAL, _REAL, _REAL),
    "dJointSetHingeParam": (_NOTHING, _POINTER, _INT, _REAL),
}
_compiled: list[str] = []  # the C functions that machine code calls
# In rare steps the solver of contacts says that it stops early, "LCP internal error"; see docs/ode.md. ODE's errors
# have another handler, which ends the process.
_say_nothing = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p)(lambda *_: None)


def _callback(name: str, result: types.Type, *arguments: types.Type) -> Any:
    _compiled.append(name)
    return types.ExternalFunction(name, result(*arguments))


_at = types.intp  # an address
set_hinge = _callback("dJointSetHingeParam", types.void, _at, types.intc, types.float64)
empty_group = _callback("dJointGroupEmpty", types.void, _at)
collide = _callback("dCollide", types.intc, _at, _at, types.intc, _at, types.intc)
create_contact = _callback("dJointCreateContact", _at, _at, _at, _at)
attach = _callback("dJointAttach", types.void, _at, _at, _at)
world_step = _callback("dWorldStep", types.intc, _at, types.float64)
copy_position = _callback("dBodyCopyPosition", types.void, _at, _at)
copy_rotation = _callback("dBodyCopyRotation", types.void, _at, _at)


@cache
def library() -> Any:
    """The library, ready for use.

    Raises:
        ValueError: it is not installed, or is another version.
    """
    needed = "physics=ode needs the Open Dynamics Engine 0.16 in double precision (Debian: apt-get install libode8)"
    loaded: Any = None
    for name in _NAMES:
        with suppress(OSError):
            loaded = ctypes.CDLL(name)
    if loaded is None or not loaded.dCheckConfiguration(_PRECISION):
        raise ValueError(needed)
    for name, (result, *arguments) in _FUNCTIONS.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    loaded.dInitODE2(0)
    loaded.dSetMessageHandler(_say_nothing)
    for name in _compiled:
        address = ctypes.cast(getattr(loaded, name), ctypes.c_void_p).value
        llvmlite.binding.add_symbol(name, address)
    return loaded


def rotation(x: float, y: float, z: float, angle: float) -> Floats:
    """The matrix of a rotation about an axis [rad]."""
    rows = np.zeros(12)
    library().dRFromAxisAndAngle(rows.ctypes.data, x, y, z, angle)
    return rows.reshape(3, 4)[:, :3]


def matrix_rows(matrix: Floats) -> Floats:
    """A matrix as ODE has it: rows of four numbers."""
    return np.hstack([matrix, np.zeros((3, 1))]).ravel()

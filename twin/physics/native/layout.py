"""Where the fields of mjModel and mjData lie in memory, for compiled code that has no bindings.

Offsets follow from the declarations that MuJoCo ships (`mujoco.introspect.structs`) and the C
rules of alignment, and are checked against the addresses the Python bindings report before the
first callback is installed (`verify`).

Compiled code takes the address of a struct and an offset::

    @cfunc(types.void(types.voidptr, types.voidptr))
    def callback(model, data):
        m, d = address(model), address(data)
        numeric = floats(m, MODEL["numeric_data"], size(m, MODEL["nnumericdata"]))
"""

# ruff: noqa: ANN401, ARG001 - numba hands its builders objects that carry no types
import ctypes
import functools
from collections.abc import Callable, Sequence
from typing import Any, Final, cast

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from twin.errors import TwinError
from twin.physics.native.cache import jit

# C type -> bytes; alignment equals size for each (x86-64 and AArch64, LP64 and LLP64)
_SCALARS: Final = {
    "int": 4,
    "float": 4,
    "double": 8,
    "mjtNum": 8,
    "mjtBool": 1,
    "mjtByte": 1,
    "char": 1,
    "mjtSize": 8,
    "size_t": 8,
    "uint64_t": 8,
    "uintptr_t": 8,
}
_POINTER: Final = 8


class LayoutError(TwinError):
    """MuJoCo's structs are not laid out as its own declarations say."""


def _extent(kind: Any) -> tuple[int, int]:
    """Size and alignment of a declared C type [bytes]."""
    if isinstance(kind, ast_nodes.PointerType):
        return _POINTER, _POINTER
    if isinstance(kind, ast_nodes.ArrayType):
        size, alignment = _extent(kind.inner_type)
        return size * int(np.prod(kind.extents)), alignment
    if isinstance(kind, ast_nodes.AnonymousStructDecl):
        return _struct_extent(kind.fields)
    if kind.name in structs.STRUCTS:
        return _struct_extent(structs.STRUCTS[kind.name].fields)
    if kind.name.startswith("mjt") and kind.name not in _SCALARS:
        return 4, 4  # enums are int
    if kind.name not in _SCALARS:
        raise LayoutError(
            f"MuJoCo {mujoco.__version__} declares the C type '{kind.name}', which is unknown here;"
            f" known are {', '.join(_SCALARS)}"
        )
    return _SCALARS[kind.name], _SCALARS[kind.name]


def _place(fields: Sequence[Any]) -> tuple[dict[str, int], int, int]:
    """Offsets of the fields, end of the last one, and alignment of the struct [bytes]."""
    offsets, end, widest = {}, 0, 1
    for field in fields:
        size, alignment = _extent(field.type)
        end += -end % alignment
        offsets[field.name] = end
        end += size
        widest = max(widest, alignment)
    return offsets, end, widest


def _struct_extent(fields: Sequence[Any]) -> tuple[int, int]:
    _, end, alignment = _place(fields)
    return end + -end % alignment, alignment


def constant(value: int) -> int:
    """Integer that numba types as int64; a Python int would be a literal, with its own compilation.

    `size(m, _NBODY)` and `size(m, _NSITE)` then share their machine code.
    """
    return cast(int, np.int64(value))


def _offsets(struct: str) -> dict[str, int]:
    return {n: constant(at) for n, at in _place(structs.STRUCTS[struct].fields)[0].items()}


MODEL: Final = _offsets("mjModel")
DATA: Final = _offsets("mjData")
TIMESTEP: Final = MODEL["opt"]  # the first field of mjOption; checked by a test
INTEGRATOR: Final = MODEL["opt"] + _place(structs.STRUCTS["mjOption"].fields)[0]["integrator"]
RK4: Final = int(mujoco.mjtIntegrator.mjINT_RK4)
MULTISTEP: Final = int(mujoco.mjtIntegrator.mjINT_IMPLICIT)  # stands for Adams–Bashforth


def _address(typing_context: Any, pointer: Any) -> Any:
    """Address held by a C pointer, as an integer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ptrtoint(arguments[0], context.get_value_type(types.intp))

    return types.intp(pointer), generate


address: Callable[[Any], int] = intrinsic(_address)


def _loader(kind: Any, doc: str) -> Any:
    """Intrinsic that reads one value of a numba type at an address."""

    def load(typing_context: Any, location: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer = context.get_value_type(kind).as_pointer()
            return builder.load(builder.inttoptr(arguments[0], pointer))

        return kind(types.intp), generate

    load.__doc__ = doc
    return intrinsic(load)


_load_double: Callable[[int], float] = _loader(types.float64, "One mjtNum.")
_load_int: Callable[[int], int] = _loader(types.int32, "One int.")
_load_size: Callable[[int], int] = _loader(types.int64, "One mjtSize.")
_pointer: Any = types.CPointer
_load_doubles = _loader(_pointer(types.float64), "One pointer to mjtNum.")
_load_ints = _loader(_pointer(types.int32), "One pointer to int.")
_load_bytes = _loader(_pointer(types.uint8), "One pointer to char.")


@jit
def number(struct: int, offset: int) -> float:
    """Scalar mjtNum field, for example the time of mjData."""
    return _load_double(struct + offset)


@jit
def integer(struct: int, offset: int) -> int:
    """Scalar int field."""
    return _load_int(struct + offset)


@jit
def size(struct: int, offset: int) -> int:
    """Scalar mjtSize field, for example nbody of mjModel."""
    return _load_size(struct + offset)


@jit
def floats(struct: int, offset: int, count: int) -> NDArray[np.float64]:
    """View (count,) of the mjtNum array a pointer field refers to."""
    return carray(_load_doubles(struct + offset), (count,))


@jit
def integers(struct: int, offset: int, count: int) -> NDArray[np.int32]:
    """View (count,) of the int array a pointer field refers to."""
    return carray(_load_ints(struct + offset), (count,))


@jit
def characters(struct: int, offset: int, count: int) -> NDArray[np.uint8]:
    """View (count,) of the char array a pointer field refers to."""
    return carray(_load_bytes(struct + offset), (count,))


_PROBE: Final = """
<mujoco>
  <custom><numeric name="probe" data="1 2 3"/></custom>
  <worldbody>
    <body name="a"><freejoint/><geom size="0.1"/><site name="s"/>
      <body><joint/><geom size="0.1" pos="1 0 0"/></body>
    </body>
  </worldbody>
</mujoco>"""


def mismatches(owner: Any, struct: str) -> list[str]:
    """Names of the array fields of an MjModel or MjData that do not lie at their offset.

    Arrays that MuJoCo has not allocated (null pointers) are passed over.
    """
    fields = structs.STRUCTS[struct].fields
    offsets = _place(fields)[0]
    wrong = []
    for name in (f.name for f in fields if isinstance(f.type, ast_nodes.PointerType)):
        view = getattr(owner, name, None)
        held = ctypes.c_void_p.from_address(owner._address + offsets[name]).value
        if isinstance(view, np.ndarray) and view.size and held and held != view.ctypes.data:
            wrong.append(f"{struct}.{name}")
    return wrong


@functools.cache
def verify() -> None:
    """Compare every derived offset with the addresses MuJoCo's own bindings report.

    Raises
    ------
    LayoutError
        The running MuJoCo lays out its structs differently.
    """
    model = mujoco.MjModel.from_xml_string(_PROBE)
    wrong = mismatches(model, "mjModel") + mismatches(mujoco.MjData(model), "mjData")
    if wrong:
        raise LayoutError(
            f"MuJoCo {mujoco.__version__}: {', '.join(wrong[:5])} do not lie where its declarations"
            " put them; install a MuJoCo whose headers and library belong together (4.0 is known"
            " to fit)"
        )

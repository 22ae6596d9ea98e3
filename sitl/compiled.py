"""How do loops over numbers become quick? By numba, compiled once for a machine and kept beside the source."""

from collections.abc import Callable
from typing import Any, TypeVar

try:
    from numba import njit
except ImportError as missing:
    raise ImportError("the simulator needs numba: pip install 'swiftnav[sitl]'") from missing

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """The function as machine code; it takes and gives numbers, tuples and arrays."""
    kernel: Function = njit(cache=True)(function)
    return kernel

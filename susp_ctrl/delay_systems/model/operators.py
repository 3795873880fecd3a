"""Operators of `DelayLTI`: ``+``, ``-``, ``*``, ``/``, indexing; the arithmetic itself is in `algebra`."""

from __future__ import annotations

from importlib import import_module
from numbers import Real
from typing import TYPE_CHECKING, Any

import control
import numpy as np

from susp_ctrl.errors import InputError

if TYPE_CHECKING:
    from susp_ctrl.delay_systems.model.system import DelayLTI


class DelayOperators:
    """Arithmetic of systems with delays; every result is a `DelayLTI` with exact delays.

    Numbers, matrices, `control.StateSpace` and `control.TransferFunction` may stand on either side.
    """

    # Arrays and numpy numbers on the left leave the operation to this class instead of taking it apart.
    __array_ufunc__ = None

    def __neg__(self) -> DelayLTI:
        return _algebra().negated(self)

    def __pos__(self) -> DelayOperators:
        return self

    def __add__(self, other: Any) -> DelayLTI:
        return _operate("add", self, other)

    def __radd__(self, other: Any) -> DelayLTI:
        return _operate("add", other, self)

    def __sub__(self, other: Any) -> DelayLTI:
        return _operate("subtract", self, other)

    def __rsub__(self, other: Any) -> DelayLTI:
        return _operate("subtract", other, self)

    def __mul__(self, other: Any) -> DelayLTI:
        return _operate("multiply", self, other)

    def __rmul__(self, other: Any) -> DelayLTI:
        return _operate("multiply", other, self)

    def __truediv__(self, other: Any) -> DelayLTI:
        if not isinstance(other, (Real, np.number)) or isinstance(other, bool):
            return NotImplemented
        if other == 0:
            raise InputError("division of a system by zero is not allowed")
        return self * (1.0 / float(other))

    def __getitem__(self, key: Any) -> DelayLTI:
        return _algebra().select(self, key)

    def feedback(self, other: Any = 1, sign: float = -1, **names: Any) -> DelayLTI:
        """Close a loop around this system; see `susp_ctrl.feedback`."""
        return _algebra().feedback(self, other, sign, **names)

    def append(self, other: Any) -> DelayLTI:
        """Put another system beside this one; see `susp_ctrl.append`."""
        return _algebra().append(self, other)


def _algebra() -> Any:
    # algebra builds systems of the class that inherits from this one, so it can only be imported afterwards
    return import_module("susp_ctrl.delay_systems.model.arithmetic")


def _is_operand(value: Any) -> bool:
    if isinstance(value, (DelayOperators, control.StateSpace, control.TransferFunction)):
        return True
    if isinstance(value, (Real, np.number)):
        return not isinstance(value, (bool, np.complexfloating))
    return isinstance(value, (np.ndarray, list, tuple))


def _operate(name: str, left: Any, right: Any) -> Any:
    if not (_is_operand(left) and _is_operand(right)):
        return NotImplemented
    module = _algebra()
    return getattr(module, name)(module.as_delay_lti(left, "operand"), module.as_delay_lti(right, "operand"))

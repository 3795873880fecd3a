"""Arithmetic expressions of a study file, such as ``-(ksf + ktf)/mtf``: numbers, symbols, + - * / ** and brackets."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping

from susp_ctrl.errors import InputError

_BINARY: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type, Callable[[float], float]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}


def evaluate(text: str, symbols: Mapping[str, float]) -> float:
    """Return the value of an expression.

    Parameters
    ----------
    text : str
        The expression.
    symbols : mapping of str to float
        Values of its symbols.

    Raises
    ------
    InputError
        Anything but arithmetic, an unknown symbol, a division by zero.

    Examples
    --------
    >>> evaluate("-(ksf + ksr)/m", {"ksf": 17000.0, "ksr": 22000.0, "m": 690.0}).__round__(3)
    -56.522
    """
    try:
        return float(_value(ast.parse(text.strip(), mode="eval").body, symbols))
    except _NotArithmeticError as problem:
        raise InputError(f"expression {text[:80]!r} is not allowed: {problem}") from None
    except (SyntaxError, ValueError, TypeError, ArithmeticError, RecursionError, MemoryError):
        # TypeError: the root of a negative number; MemoryError: Python's word for brackets in too many brackets
        raise InputError(
            f"expression {text[:80]!r} is not allowed: this is no arithmetic expression"
        ) from None


class _NotArithmeticError(Exception):
    pass


def _value(node: ast.expr, symbols: Mapping[str, float]) -> float:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        if node.id not in symbols:
            raise _NotArithmeticError(f"{node.id} is unknown; known are {', '.join(symbols)}")
        return symbols[node.id]
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        return _BINARY[type(node.op)](_value(node.left, symbols), _value(node.right, symbols))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        return _UNARY[type(node.op)](_value(node.operand, symbols))
    raise _NotArithmeticError("only numbers, symbols, + - * / ** and brackets are needed")

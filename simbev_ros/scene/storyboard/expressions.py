"""Evaluates the expressions of scenarios, ``${…}``, without executing anything.

Python parses the text, because operators and precedence are the same; only what the standard knows is evaluated (ASAM
OpenSCENARIO XML 1.3.1, section 9.2).
"""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

MAX_EXPRESSION_CHARS = 1_000
MAX_EXPRESSION_DEPTH = 100


def evaluate(text: str, parameter: Callable[[str], Any]) -> int | float | bool:
    """The value of an expression.

    Args:
        text: The expression without ``${`` and ``}``; a parameter in it is its name after a ``$``.
        parameter: Gives the value of a parameter, or raises ValueError; only numbers and booleans can be operands.

    Raises:
        ValueError: It is not an expression, too long or too deep, or has no finite value.
    """
    if len(text) > MAX_EXPRESSION_CHARS:
        raise ValueError(f"has {len(text):,} characters; allowed are {MAX_EXPRESSION_CHARS:,}")
    try:
        tree = ast.parse(re.sub(r"\$(\w+)", rf"{_PREFIX}\1", text.strip()), mode="eval")
        return _value_of(tree.body, parameter, MAX_EXPRESSION_DEPTH)
    except (SyntaxError, MemoryError, RecursionError):
        raise ValueError(f"is {text!r:.80}, which is not an expression") from None


_PREFIX = "_parameter_"


def _value_of(node: ast.AST, parameter: Callable[[str], Any], depth: int) -> Any:
    """The value of a node of the syntax tree, which may be nested as deep as given."""
    if depth == 0:
        raise ValueError(f"is nested more than {MAX_EXPRESSION_DEPTH} deep")
    key, parts = _operation(node)
    if not parts:
        return _leaf(node, parameter)
    if key not in _OPERATIONS:
        raise ValueError(f"has something that expressions do not have; functions are {', '.join(_FUNCTIONS)}")
    values = [_value_of(part, parameter, depth - 1) for part in parts]
    for value in values:
        if isinstance(value, bool) != (key in _LOGIC) or not isinstance(value, (int, float)):
            raise ValueError(
                f"has the operand {value!r:.80}, which is not a {'boolean' if key in _LOGIC else 'number'}"
            )
    try:
        result = _OPERATIONS[key](*values)
    except (ArithmeticError, ValueError, TypeError) as error:
        raise ValueError(f"has no value: {error}") from None
    if not abs(result) < _MAX_INTEGER and (isinstance(result, int) or not math.isfinite(result)):
        raise ValueError("exceeds the range of numbers")
    return result


_MAX_INTEGER = 2**63


def _operation(node: ast.AST) -> tuple[Any, list[ast.expr]]:
    """The operator or function of a node and its operands."""
    match node:
        case ast.BinOp(left=left, op=sign, right=right):
            return type(sign), [left, right]
        case ast.UnaryOp(op=sign, operand=operand):
            return type(sign), [operand]
        case ast.BoolOp(op=sign, values=parts):
            return type(sign), parts
        case ast.Call(func=ast.Name(id=name), args=parts, keywords=[]):
            return name, parts
        case _:
            return None, []


def _leaf(node: ast.AST, parameter: Callable[[str], Any]) -> Any:
    """The value of a constant or a parameter."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return value
        case ast.Name(id="true" | "false" as name):
            return name == "true"
        case ast.Name(id=name) if name.startswith(_PREFIX):
            return parameter(name.removeprefix(_PREFIX))
        case _:
            raise ValueError("has something that is neither a number nor a parameter, which has a $ in front")


def _remainder(left: float, right: float) -> float:
    """The remainder of a division that truncates, as in C, of the operands' type."""
    rest = math.fmod(left, right)
    return int(rest) if isinstance(left, int) and isinstance(right, int) else rest


_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "round": lambda value: int(math.copysign(math.floor(abs(value) + 0.5), value)),
    **{name: getattr(math, name) for name in ("floor", "ceil", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan")},
    "sign": lambda value: (value > 0) - (value < 0),
    "abs": abs,
    "max": max,
    "min": min,
    "pow": math.pow,
}
_LOGIC = {ast.Not: operator.not_, ast.And: lambda *flags: all(flags), ast.Or: lambda *flags: any(flags)}
_ARITHMETIC = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
_OPERATIONS: Mapping[Any, Callable[..., Any]] = {
    ast.Mod: _remainder,
    ast.USub: operator.neg,
    **_ARITHMETIC,
    **_LOGIC,
    **_FUNCTIONS,
}

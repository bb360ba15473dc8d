"""Expressions of numbers, names, + - * / ** and parentheses: parsing, value, range, unit.

A parsed expression is a nested tuple, hashable: ("number", 2.0), ("name", "film.n"), ("neg", a), ("+", a, b).
The range over the bounds of its names is that of interval arithmetic (R. Moore, Interval Analysis,
1966), which is exact where each name occurs once and too wide, never too narrow, elsewhere.
"""

import ast
import itertools
import operator
from collections.abc import Callable, Hashable
from typing import Any, TypeAlias

from pellicle.errors import UsageError

Expression: TypeAlias = tuple[Any, ...]
_OPERATORS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_FUNCTIONS = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
}
_LONGEST = 1000


def parsed(text: str) -> Expression:
    """Parse an expression; a name that is no word of Python stands in quotes, as in "2 * 'top-1'.thickness".

    **Raises:** UsageError for anything but numbers, names, + - * / ** and parentheses.
    """
    if len(text) > _LONGEST:
        raise UsageError(f"an expression has at most {_LONGEST} characters, not {len(text)}")
    try:
        return _converted(ast.parse(text.strip(), mode="eval").body, text)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, UsageError):
            raise
        raise UsageError(
            f"{text!r} is neither a number nor an expression of numbers (without units), names of other"
            ' parameters, + - * / ** and parentheses, as in "2 * film.thickness + 1.5"'
        ) from None


def _converted(node: ast.AST, text: str) -> Expression:
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)], _converted(node.left, text), _converted(node.right, text)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        inside = _converted(node.operand, text)
        return ("neg", inside) if isinstance(node.op, ast.USub) else inside
    if isinstance(node, ast.Constant):
        number = node.value
        if isinstance(number, int | float) and not isinstance(number, bool):
            return "number", float(number)
    words: list[str] = []
    part = node
    while isinstance(part, ast.Attribute):
        words.insert(0, part.attr)
        part = part.value
    if isinstance(part, ast.Name):
        return "name", ".".join([part.id, *words])
    if isinstance(part, ast.Constant) and isinstance(part.value, str):
        return "name", ".".join([part.value, *words])
    shown = ast.get_source_segment(text.strip(), node) or text  # pyright: ignore[reportArgumentType]
    raise UsageError(
        f"{shown!r} cannot stand in the expression {text!r}: it may have numbers, names of other parameters,"
        " + - * / ** and parentheses"
    )


def names(expression: Expression) -> list[Hashable]:
    """Names in an expression, each once, in their order."""
    kind, *parts = expression
    if kind == "name":
        return parts
    return [] if kind == "number" else [*dict.fromkeys(x for part in parts for x in names(part))]


def replaced(expression: Expression, by: Callable[[Any], Expression]) -> Expression:
    """The expression with `by(name)` in place of each name."""
    kind, *parts = expression
    if kind in ("name", "number"):
        return by(parts[0]) if kind == "name" else expression
    return kind, *(replaced(part, by) for part in parts)


def value(expression: Expression, of: Callable[[Any], Any]) -> Any:
    """The value where `of(name)` are numbers, arrays or traced numbers."""
    kind, *parts = expression
    if kind in ("name", "number"):
        return of(parts[0]) if kind == "name" else parts[0]
    numbers = [value(part, of) for part in parts]
    if kind == "**" and parts[1][0] == "number" and float(parts[1][1]).is_integer():
        numbers[1] = int(parts[1][1])  # a whole power of a negative number has a derivative
    return -numbers[0] if kind == "neg" else _FUNCTIONS[kind](*numbers)


def interval(expression: Expression, of: Callable[[Any], tuple[float, float]]) -> tuple[float, float]:
    """Least and largest value where names lie between bounds `of(name)`.

    **Raises:** UsageError for a division by what may be 0, and a power of what may be negative.
    """
    kind, *parts = expression
    if kind in ("name", "number"):
        return of(parts[0]) if kind == "name" else (parts[0], parts[0])
    (low, high), *others = (interval(part, of) for part in parts)
    if kind == "neg":
        return -high, -low
    other = others[0]
    if kind == "/" and other[0] <= 0 <= other[1]:
        raise UsageError("divides by what may be 0 within its bounds")
    ends = [low, high]
    if kind == "**":
        power = other[0] if other[0] == other[1] else None
        whole = power is not None and float(power).is_integer()
        if low < 0 and not whole:
            raise UsageError("takes a power of what may be negative within its bounds")
        if low <= 0 <= high and other[0] < 0:
            raise UsageError("divides by what may be 0 within its bounds")
        if whole and low < 0 < high:
            ends.append(0.0)
    try:
        corners = [float(_FUNCTIONS[kind](a, b)) for a, b in itertools.product(ends, other)]
    except OverflowError:
        raise UsageError("is too large for a number within its bounds") from None
    return min(corners), max(corners)


Unit: TypeAlias = dict[str, float]
"""Powers of units: {"nm": 2} for nm²."""


def unit(expression: Expression, of: Callable[[Any], str]) -> Unit | None:
    """The unit where names have the units `of(name)`; None of plain numbers, which take any in a sum.

    **Raises:** UsageError for a sum of two units, naming them.
    """
    kind, *parts = expression
    if kind == "number":
        return None
    if kind == "name":
        base, _, power = of(parts[0]).partition("^")
        return {base: float(power or 1)} if base else {}
    units = [unit(part, of) for part in parts]
    if kind == "neg":
        return units[0]
    one, other = units
    if kind in "+-":
        if one is not None and other is not None and one != other:
            first, second = ([shown(x) for x in names(part)] for part in parts)
            raise UsageError(
                f"adds {', '.join(first)} ({spelled(one)}) and {', '.join(second)} ({spelled(other)})"
            )
        return other if one is None else one
    if kind == "**":
        if other:
            raise UsageError(f"has an exponent in {spelled(other)}: an exponent has no unit")
        if one and parts[1][0] not in ("number", "neg"):
            raise UsageError(f"takes a power of {spelled(one)}: give the exponent as a plain number")
        power = value(parts[1], lambda _: 1.0)
        return None if one is None and other is None else {k: x * power for k, x in (one or {}).items()}
    if one is None and other is None:
        return None
    sign = 1 if kind == "*" else -1
    keys = {**(one or {}), **(other or {})}
    powers = {key: (one or {}).get(key, 0.0) + sign * (other or {}).get(key, 0.0) for key in keys}
    return {key: power for key, power in powers.items() if power}


def spelled(powers: Unit) -> str:
    """Words for a unit."""
    return " ".join(key if x == 1 else f"{key}^{x:g}" for key, x in powers.items()) or "without unit"


def shown(name: Any) -> str:
    """A name in backquotes, as errors show it."""
    return f"`{name}`"

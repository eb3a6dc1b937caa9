"""Expressions of missions: their grammar, their operations, and their evaluation in a run.

Python's parser reads an expression, in which `$name` stands for a variable. Only the operations in this file
are allowed, and Python executes nothing.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import cast

from executive.cell.ledger import Ledger
from executive.cell.protocols import Clock
from executive.errors import Fault
from executive.text.findings import Finding, Span, make_error, suggest_choice
from executive.tree.specification import Constant, Expression, InvalidValue, Reference, Value

MAX_LENGTH = 500
"""Maximum number of characters of an expression."""
MAX_DEPTH = 20
"""Maximum number of nested operations."""
MAX_NUMBER = 1e15
"""Maximum absolute value of a number, so that a counter that multiplies itself ends with an error."""
MARK = "="
"""First character of a value that is an expression."""

COMPARISONS: Mapping[str, Callable[..., object]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt,
    ">=": operator.ge,
}  # fmt: skip
"""Comparisons of two values."""
ARITHMETIC: Mapping[str, Callable[..., object]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "//": operator.floordiv,
    "%": operator.mod, "negative": operator.neg,
}  # fmt: skip
"""Operations on numbers; `negative` is the sign."""
FUNCTIONS: Mapping[str, Callable[..., object]] = {"min": min, "max": max, "abs": abs, "round": round}
"""Functions of numbers: `min` and `max` of at least two, `abs` and `round` of one."""
RUN_FIELDS = {"elapsed": "s", "placed": "", "rejected": "", "open": ""}
"""Units of the fields of `run`: the time since its start, and numbers of items in a state."""
SYMBOLS: Mapping[type[ast.AST], str] = {
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.In: "in",
    ast.NotIn: "not in", ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//",
    ast.Mod: "%", ast.And: "and", ast.Or: "or", ast.Not: "not", ast.USub: "negative",
}  # fmt: skip
"""Names of operations by node of Python's syntax tree."""
_HOLE = re.compile(r"\{\{|\}\}|\{([^{}]*)\}")
"""An expression in a text, for instance in the message of `fail`."""
_VARIABLE = re.compile(r"\$(?=[A-Za-z_])")
_RULE = (
    "Allowed are $names, run.…, bin.NAME.count, numbers, quoted texts, lists, + - * / // %, comparisons, in, "
    "and, or, not, min, max, abs and round."
)


class ExpressionError(Exception):
    """An expression is not allowed; `column` is the place of the mistake, from 0, and `hint` the remedy."""

    def __init__(self, message: str, column: int = 0, hint: str = "") -> None:
        super().__init__(message)
        self.column = column
        self.hint = hint


def read_expression(text: str, span: Span, findings: list[Finding]) -> Value:
    """Return the expression in the text of a scalar at `span`; a `=` at its beginning is ignored.

    After an error, which is added to `findings`, the result is an invalid value.
    """
    start = len(text) - len(text.removeprefix(MARK).lstrip())
    return _parse(text, start, len(text), span, findings)


def _parse(text: str, start: int, end: int, span: Span, findings: list[Finding]) -> Value:
    """Return the expression in a part of a scalar at `span`, or an invalid value after an error."""

    def locate(column: int, length: int) -> Span:
        return _locate(text, span, start + column, length)

    parser = _Parser(text[start:end].replace("\n", " "), locate)
    try:
        return parser.parse()
    except ExpressionError as error:
        place = parser.locate(error.column, end - start - error.column)
        findings.append(make_error(place, "expression", str(error), error.hint))
        return InvalidValue(place)


def read_template(text: str, span: Span, findings: list[Finding]) -> Value:
    """Return the expression of a text with expressions in braces: `only {$items.count} are left`.

    Doubled braces stand for braces.
    """
    parts: list[Value] = []
    end = 0
    for hole in _HOLE.finditer(text):
        parts.append(Constant(text[end : hole.start()], span))
        end = hole.end()
        if hole[1] is None:
            parts.append(Constant(hole[0][0], span))
        else:
            parts.append(_parse(text, *hole.span(1), span, findings))
    parts.append(Constant(text[end:], span))
    if any(_VARIABLE.search(str(one.value)) for one in parts if isinstance(one, Constant)):
        hint = "Write a variable in braces: {$name}."
        findings.append(
            make_error(span, "bad-reference", f'"{text}" names a variable outside of braces', hint)
        )
        return InvalidValue(span)
    if any(isinstance(part, InvalidValue) for part in parts):
        return InvalidValue(span)
    return Expression("text", tuple(parts), span)


def _locate(text: str, span: Span, column: int, length: int) -> Span:
    """Return the position of a part of the text of a scalar; if it is written otherwise, of the whole."""
    lines = span.source.text.splitlines()
    line = lines[span.line - 1][span.col - 1 :] if 0 < span.line <= len(lines) else text
    quote_count = int(line[:1] in ("'", '"'))
    if not line.startswith(text, quote_count):
        return span
    return replace(span, col=span.col + quote_count + column, length=max(1, length))


class _Parser:
    """Parser of one expression; `locate` returns the position of a part of it from column and length."""

    def __init__(self, text: str, locate: Callable[[int, int], Span]) -> None:
        self._text = text
        self.locate = locate
        # `$` becomes `_`, so that all columns stay; names that begin with `_` are not allowed.
        self._python_text = _VARIABLE.sub("_", text)

    def parse(self) -> Expression:
        if len(self._text) > MAX_LENGTH:
            raise ExpressionError(f"an expression has at most {MAX_LENGTH} characters, not {len(self._text)}")
        if self._text.count("(") > 2 * MAX_DEPTH:
            raise ExpressionError(f"an expression has at most {2 * MAX_DEPTH} brackets")
        if not self._text.strip():
            raise ExpressionError("an expression is missing here", hint=_RULE)
        try:
            tree = ast.parse(self._python_text.rstrip(), mode="eval").body
        except SyntaxError as error:
            raise ExpressionError(*self._explain_syntax(error)) from None
        except (ValueError, MemoryError, RecursionError):
            raise ExpressionError("this is no expression that can be read", hint=_RULE) from None
        value = self._convert(tree, 0)
        return value if isinstance(value, Expression) else Expression("value", (value,), value.span)

    def _explain_syntax(self, error: SyntaxError) -> tuple[str, int, str]:
        """Return message, column and hint for a text that Python cannot parse."""
        column = min(max((error.offset or 1) - 1, 0), max(len(self._text) - 1, 0))
        if re.search(r"(?<![=!<>])=(?!=)", self._text):
            return "= is no comparison", self._text.index("="), "Write == for equal values."
        if self._text.count("(") > self._text.count(")"):
            hint = "In {...}, a comma ends a value: put the expression in quotes."
            return "a bracket is not closed", column, hint
        return f'"{self._text}" is no expression', column, _RULE

    def _convert(self, node: ast.AST, depth: int) -> Value:
        """Return the value or operation of a node of Python's syntax tree."""
        column = self._get_column(node)
        if depth > MAX_DEPTH:
            raise ExpressionError(f"the expression has more than {MAX_DEPTH} nested operations", column)

        def build(name: str, *operands: ast.AST) -> Expression:
            converted = tuple(self._convert(operand, depth + 1) for operand in operands)
            return Expression(name, converted, self._make_span(node))

        match node:
            case ast.Constant():
                return self._convert_constant(node)
            case ast.Name() | ast.Attribute() | ast.Subscript():
                return self._convert_name(node)
            case ast.List(elts=elements) | ast.Tuple(elts=elements):
                constants = [self._convert(element, depth + 1) for element in elements]
                are_plain = [
                    isinstance(one, Constant) and not isinstance(one.value, list) for one in constants
                ]
                if not constants or not all(are_plain):
                    raise ExpressionError("a list may contain only numbers and texts", column)
                values = [one.value for one in constants if isinstance(one, Constant)]
                return Constant(
                    values, self._make_span(node), element_spans=tuple(one.span for one in constants)
                )
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._convert(operand, depth + 1)
            case ast.UnaryOp(op=op, operand=operand) if type(op) in SYMBOLS:
                return build(SYMBOLS[type(op)], operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in SYMBOLS:
                return build(SYMBOLS[type(op)], left, right)
            case ast.BoolOp(op=op, values=values):
                return build(SYMBOLS[type(op)], *values)
            case ast.Compare(left=left, ops=ops, comparators=others) if all(
                type(op) in SYMBOLS for op in ops
            ):
                pairs = zip((left, *others), ops, others, strict=False)
                comparisons = tuple(build(SYMBOLS[type(op)], one, other) for one, op, other in pairs)
                return (
                    comparisons[0]
                    if len(comparisons) == 1
                    else Expression("and", comparisons, self._make_span(node))
                )
            case ast.Call(func=ast.Name(name), args=arguments, keywords=[]) if name in FUNCTIONS:
                counts = (1, 1) if name in ("abs", "round") else (2, MAX_LENGTH)
                if not counts[0] <= len(arguments) <= counts[1]:
                    wanted = "one number" if counts[1] == 1 else "at least two numbers"
                    raise ExpressionError(f"{name} takes {wanted}, not {len(arguments)}", column)
                return build(name, *arguments)
        text = self._cut(node) or self._text
        raise ExpressionError(f'"{text}" is not allowed in an expression', column, _RULE)

    def _convert_constant(self, node: ast.Constant) -> Constant:
        column = self._get_column(node)
        match node.value:
            case str():
                # In the original text, no `_` replaces a `$`.
                return Constant(str(ast.literal_eval(self._cut(node))), self._make_span(node))
            case bool() as value:
                return Constant(value, self._make_span(node))
            case int() | float() as number if abs(number) <= MAX_NUMBER:
                return Constant(number, self._make_span(node))
            case int() | float():
                raise ExpressionError(f"a number is at most {MAX_NUMBER:g}", column)
        raise ExpressionError(f'"{self._cut(node)}" is not allowed in an expression', column, _RULE)

    def _convert_name(self, node: ast.AST) -> Value:
        """Return the reference or operation for `$name`, `$name.field`, `run.field` or `bin.NAME.count`."""
        parts: list[str] = []
        root = node
        while isinstance(root, ast.Attribute | ast.Subscript):
            if isinstance(root, ast.Attribute):
                parts.insert(0, root.attr)
            elif isinstance(root.slice, ast.Constant) and isinstance(root.slice.value, str):
                parts.insert(0, root.slice.value)
            else:
                break
            root = root.value
        text = self._cut(node)
        span = self._make_span(node)
        column = self._get_column(node)
        if not isinstance(root, ast.Name):
            raise ExpressionError(f'"{text}" is not allowed in an expression', column, _RULE)
        is_variable = self._text[self._get_column(root)] == "$"
        if "[" in text and (is_variable or root.id != "bin"):
            raise ExpressionError(f'"{text}" is not allowed in an expression', column, _RULE)
        hidden = [part for part in (*parts, "" if is_variable else root.id) if part.startswith("_")]
        if hidden:
            raise ExpressionError(f'"{text}" is not allowed: names do not begin with "_"', column, _RULE)
        match is_variable, root.id.removeprefix("_") if is_variable else root.id, parts:
            case True, name, [] | [_]:
                return Reference(name, span, "".join(parts))
            case False, "run", [str(name)]:
                if name in RUN_FIELDS:
                    return Expression("run", (Constant(name, span),), span)
                hint = suggest_choice(name, RUN_FIELDS, "Fields of run")
                raise ExpressionError(f'"run" has no field "{name}"', column, hint)
            case False, "bin", [str(name), "count"]:
                return Expression("bin", (Constant(name, span),), span)
            case False, "true" | "false" as word, []:
                return Constant(word == "true", span)
        if is_variable:
            raise ExpressionError(f'"{text}" has too many parts: a variable has one field', column)
        hint = f"For the variable, write ${text}."
        if not parts:
            hint = f'For the variable, write ${text}; for a text, "{text}".'
        elif root.id in ("run", "bin"):
            hint = _RULE
        if "bin." in self._text and "-" in self._text:
            hint = 'Write a name with a hyphen in brackets and quotes: bin["red-bin"].count.'
        raise ExpressionError(f'there is no value "{text}"', column, hint)

    def _get_column(self, node: ast.AST) -> int:
        """Return the column of a node, from 0; Python counts bytes."""
        return len(self._python_text.encode()[: getattr(node, "col_offset", 0)].decode(errors="ignore"))

    def _cut(self, node: ast.AST) -> str:
        """Return the text of a node."""
        end = getattr(node, "end_col_offset", 0) or 0
        return self._text[
            self._get_column(node) : len(self._python_text.encode()[:end].decode(errors="ignore"))
        ]

    def _make_span(self, node: ast.AST) -> Span:
        return self.locate(self._get_column(node), len(self._cut(node)))


@dataclass(frozen=True)
class Scope:
    """What an expression can read in a run.

    Attributes:
        variables: Variables of the run by name.
        ledger: Ledger of the run.
        clock: Clock of the run.
        local_values: Values of names that only the expression knows, for instance the candidate `target`.
    """

    variables: Mapping[str, object]
    ledger: Ledger
    clock: Clock
    local_values: Mapping[str, object] = field(default_factory=dict)

    def read(self, name: str, field_name: str) -> object:
        """Return the value of a variable, or of a field; for an item, the ledger knows the present fields.

        Raises:
            Fault: No node has written the variable yet.
        """
        names = {**self.variables, **self.local_values}
        if name not in names:
            raise Fault(f"an expression reads ${name}, which no node has written yet")
        return self.read_field(names[name], field_name) if field_name else names[name]

    def read_field(self, value: object, name: str) -> object:
        """Return a field of a value, as `executive.mission.ports.find_fields` declares it."""
        if name == "count" and isinstance(value, Sequence) and not isinstance(value, str):
            return len(value)
        owner = self.ledger.describe(value) if isinstance(value, str) else value
        if name in ("x", "y", "z") and hasattr(owner, "position"):
            return float(owner.position["xyz".index(name)])
        if name == "age" and hasattr(owner, "stamp"):
            return self.clock.now - owner.stamp
        if not is_dataclass(owner) or name not in {each.name for each in fields(owner)}:
            raise Fault(f"a {type(owner).__name__} has no field {name} that missions may read")
        return getattr(owner, name)

    def evaluate(self, value: Value) -> object:
        """Return the value of an expression, a reference or a constant.

        Raises:
            Fault: A number is larger than `MAX_NUMBER`, or a divisor is zero although the checks passed.
        """
        match value:
            case Constant(value=constant):
                return constant
            case Reference(name=name, field=field_name):
                return self.read(name, field_name)
            case Expression(operator="and" | "or" as name, operands=operands):
                results = map(self.evaluate, operands)
                return all(results) if name == "and" else any(results)
            case Expression():
                try:
                    result = self._apply(value.operator, list(map(self.evaluate, value.operands)))
                except (ArithmeticError, TypeError, ValueError) as error:
                    raise Fault(f"{value} has no value: {error}") from error
                if isinstance(result, int | float) and not abs(result) <= MAX_NUMBER:
                    raise Fault(f"{value} is larger than {MAX_NUMBER:g}")
                return result
        raise Fault("an invalid expression was evaluated")

    def describe(self, expression: Expression) -> list[str]:
        """Return the present value of each variable, counter and time in an expression: `$n = 3`."""
        texts = []
        for operand in expression.operands:
            if isinstance(operand, Expression) and operand.operator not in ("run", "bin"):
                texts += self.describe(operand)
            elif not isinstance(operand, Constant):
                value = self.evaluate(operand)
                texts.append(
                    f"{operand} = {value:.4g}" if isinstance(value, float) else f"{operand} = {value}"
                )
        return texts

    def _apply(self, name: str, operands: list[object]) -> object:
        """Return the result of an operation."""
        match name:
            case "value":
                return operands[0]
            case "text":
                return "".join(f"{one:.6g}" if isinstance(one, float) else str(one) for one in operands)
            case "not":
                return not operands[0]
            case "in" | "not in":
                return (operands[0] in cast("Sequence[object]", operands[1])) is (name == "in")
            case "run":
                return self.clock.now if operands[0] == "elapsed" else self._count(str(operands[0]))
            case "bin":
                return self.ledger.count_items("placed", None, str(operands[0]))
        if name in COMPARISONS:
            # The clock sums control periods, so that equal times may differ by rounding errors.
            operands = [round(one, 9) if isinstance(one, float) else one for one in operands]
        return {**COMPARISONS, **ARITHMETIC, **FUNCTIONS}[name](*operands)

    def _count(self, state: str) -> int:
        if state == "open":
            return sum(known.is_open for known in self.ledger.list_known_items())
        return self.ledger.count_items(state)

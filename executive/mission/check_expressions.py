"""Static types of expressions: type, unit and bounds of every operation, before the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast, get_args, get_origin

from executive.mission.analysis import CheckContext
from executive.mission.ports import describe_type, find_element_type, find_fields, is_assignable
from executive.skill import Param, Port
from executive.text.findings import Finding, Span, describe_value, make_error, suggest_choice
from executive.tree.expression import ARITHMETIC, COMPARISONS, RUN_FIELDS
from executive.tree.keys import Key
from executive.tree.specification import Constant, Expression, Reference, Value

MIN_DISTANCE = 0.001
"""Distance that a value must keep from a limit that it must exceed."""
ANY_UNIT = None
"""Unit of a number in an expression without a unit, which takes the unit of the other side."""


@dataclass(frozen=True)
class StaticValue:
    """What is known about a value before the run.

    Attributes:
        type: Type of the value; `Any` if it is unknown.
        refers_to: Kind of the names that a text contains, such as `class`, or "".
        unit: Unit of a number, "" for a count; None for a number that takes any unit.
        low: Smallest possible number.
        high: Largest possible number.
        constant: The constant, if the mission writes one here; otherwise None.
        choices: Values that a variable may have; None: any value of its type.
    """

    type: object = Any
    refers_to: str = ""
    unit: str | None = ""
    low: float = -math.inf
    high: float = math.inf
    constant: Constant | None = None
    choices: tuple[object, ...] | None = None

    @property
    def is_number(self) -> bool:
        """True for a number, or a value of an unknown type."""
        return self.type is Any or (self.type is not bool and is_assignable(self.type, float))

    def describe(self) -> str:
        """Return a description for a sentence: `a number in m`."""
        if self.refers_to:
            return f"the name of {'an' if self.refers_to[0] in 'aeiou' else 'a'} {self.refers_to}"
        if self.choices is not None:
            return " or ".join(map(str, self.choices))
        return describe_type(self.type) + (f" in {self.unit}" if self.unit and self.is_number else "")


ReadVariable = Callable[[str], Sequence[StaticValue]]
"""Function that returns what each writer of a variable may write; empty if no node writes the variable."""


class _Mistake(Exception):
    """A mistake in an expression."""

    def __init__(self, span: Span, message: str, hint: str = "", code: str = "expression") -> None:
        super().__init__(message)
        self.finding = make_error(span, code, message, hint)


def check_expression(
    context: CheckContext, name: str, declaration: Param | Port | Key, value: Expression, read: ReadVariable
) -> Iterator[Finding]:
    """Yield the first mistake in an expression for a param, port or key with the name `name`."""
    candidate = f".{declaration.candidate}" if isinstance(declaration, Param) else "."
    rule_type = _get_function_type(declaration.type) if isinstance(declaration, Param) else None

    def read_with_candidate(variable: str) -> Sequence[StaticValue]:
        if variable != candidate:
            return read(variable)
        (candidate_type,), _ = get_args(rule_type)
        return [StaticValue(candidate_type)]

    try:
        result = _Analysis(context, read_with_candidate, candidate).compute(value)
        if value.operator == "text":
            return
        if _is_constant(value):
            raise _Mistake(value.span, f"{value} has always the same value", "Write the value itself.")
        if result.type is bool and result.low == result.high and not _reads_param(value):
            word = "true" if result.low else "false"
            raise _Mistake(value.span, f"{value} is always {word}", "Compare with another value.")
        _check_result(name, declaration, value, result)
    except _Mistake as mistake:
        yield mistake.finding


def make_static(declaration: Param) -> StaticValue:
    """Return what the declaration of a param or variable states about its value.

    A number without a declared unit takes any unit.
    """
    low = -math.inf if declaration.ge is None else declaration.ge
    high = math.inf if declaration.le is None else declaration.le
    choices = None if declaration.refers_to else declaration.choices
    unit = declaration.unit or ANY_UNIT
    return StaticValue(declaration.type, declaration.refers_to, unit, low, high, choices=choices)


def _get_function_type(declared_type: object) -> object:
    """Return the function type of a param that may be None."""
    members = get_args(declared_type) if get_origin(declared_type) is not None else ()
    functions = [member for member in members if get_args(member)]
    return functions[0] if functions and not isinstance(members[0], list) else declared_type


def _is_constant(value: Value) -> bool:
    """Return True if a value reads nothing; a param may have another value in another run."""
    if isinstance(value, Expression):
        return value.operator not in ("run", "bin") and all(map(_is_constant, value.operands))
    return isinstance(value, Constant) and not value.origin


def _reads_param(value: Value) -> bool:
    """Return True if an expression contains the value of a param, which another run may change."""
    operands = value.operands if isinstance(value, Expression) else ()
    return (isinstance(value, Constant) and bool(value.origin)) or any(map(_reads_param, operands))


def _check_result(name: str, declaration: Param | Port | Key, value: Value, result: StaticValue) -> None:
    """Raise a mistake if a declaration does not accept the value."""
    expected = _make_expected(declaration)
    is_number_expected = expected.type in (int, float)
    is_accepted = (
        is_assignable(result.type, expected.type)
        and not (is_number_expected and result.type is bool)
        and (expected.refers_to in ("", result.refers_to) or result.type is Any)
        and (expected.choices is None or set(result.choices or (None,)) <= {*expected.choices})
    )
    if not is_accepted:
        hint = "Use // or round for a whole number." if expected.type is int and result.is_number else ""
        message = f"{name} takes {expected.describe()}, but {value} is {result.describe()}"
        raise _Mistake(value.span, message, hint, "port-type")
    if not result.is_number or result.type is Any:
        return
    if expected.unit is not ANY_UNIT and result.unit not in (expected.unit, ANY_UNIT):
        message = f"{name} is {_name_unit(expected.unit)}, but {value} is {_name_unit(result.unit)}"
        raise _Mistake(value.span, message)
    if result.low < expected.low or result.high > expected.high:
        allowed = _format_range(expected.low, expected.high)
        message = f"{name} must be {allowed}, but {value} may be {_format_range(result.low, result.high)}"
        limits = [f"max({expected.low:g}, …)"] if result.low < expected.low else []
        limits += [f"min({expected.high:g}, …)"] if result.high > expected.high else []
        is_declared = isinstance(value, Expression) and any(
            isinstance(one, Reference) for one in value.walk()
        )
        declare = ", or declare min and max of the variable" if is_declared else ""
        hint = f"Limit it with {' and '.join(limits)}{declare}."
        raise _Mistake(value.span, message, hint, "out-of-range")


def _make_expected(declaration: Param | Port | Key) -> StaticValue:
    """Return which values a declaration accepts."""
    if isinstance(declaration, Key):
        if not declaration.is_constant:
            return StaticValue(bool)
        marks = declaration.field.metadata
        bounds = [mark.ge for mark in marks if hasattr(mark, "ge")]
        bounds += [mark.gt + MIN_DISTANCE for mark in marks if hasattr(mark, "gt")]
        low = max(bounds, default=-math.inf)
        unit = "s" if "[s]" in (declaration.field.description or "") else ""
        return StaticValue(declaration.value_type, unit=unit, low=low)
    if isinstance(declaration, Port):
        return StaticValue(declaration.type, declaration.refers_to, ANY_UNIT)
    if declaration.candidate:
        return StaticValue(get_args(_get_function_type(declaration.type))[1], unit=ANY_UNIT)
    return make_static(declaration)


def _name_unit(unit: str | None) -> str:
    return f"in {unit}" if unit else "a number without unit"


def _format_range(low: float, high: float) -> str:
    if low == high:
        return f"{low:g}"
    if math.isinf(low) and math.isinf(high):
        return "any number"
    if math.isinf(high):
        return f"{low:g} or more"
    return f"{high:g} or less" if math.isinf(low) else f"{low:g} to {high:g}"


class _Analysis:
    """Computation of static values, with the variables that a node can read."""

    def __init__(self, context: CheckContext, read: ReadVariable, candidate: str = "") -> None:
        self._context = context
        self._read = read
        self._candidate = candidate

    def compute(self, value: Value) -> StaticValue:
        """Return what is known about a value.

        Raises:
            _Mistake: An operation is not possible.
        """
        match value:
            case Constant(value=constant):
                is_number = isinstance(constant, int | float) and not isinstance(constant, bool)
                limits = (-math.inf, math.inf)
                if isinstance(constant, int | float):
                    limits = (float(constant), float(constant))
                type_ = list[Any] if isinstance(constant, list) else type(constant)
                return StaticValue(type_, "", ANY_UNIT if is_number else "", *limits, value)
            case Reference():
                return self._compute_reference(value)
            case Expression(operator="run", operands=(Constant(value=str(name)),)):
                return StaticValue(float if RUN_FIELDS[name] else int, "", RUN_FIELDS[name], 0.0)
            case Expression(operator="bin", operands=(Constant(value=str(name)) as operand,)):
                bins = self._context.names_in_cell_by_kind.get("bin", [name])
                if name not in bins:
                    hint = suggest_choice(name, bins, "Bins of the cell")
                    raise _Mistake(operand.span, f'the cell has no bin "{name}"', hint, "unknown-bin")
                return StaticValue(int, "", "", 0.0)
            case Expression():
                return self._compute_operation(value, [self.compute(one) for one in value.operands])
        return StaticValue()

    def _compute_reference(self, reference: Reference) -> StaticValue:
        writers = self._read(reference.name)
        if reference.field:
            fields = [find_fields(writer.type, writer.refers_to).get(reference.field) for writer in writers]
            found = [field for field in fields if field is not None]
            # Another check reports a field that the value of a variable lacks.
            if reference.name == self._candidate and not found:
                names = find_fields(writers[0].type, "")
                message = f"{reference} has no such field"
                hint = suggest_choice(reference.field, names, "Fields")
                raise _Mistake(reference.span, message, hint, "unknown-field")
            # No field is a negative count or time.
            writers = [
                StaticValue(each.type, each.refers_to, each.unit, 0.0)
                if each.type is int or each.unit == "s"
                else StaticValue(each.type, each.refers_to, each.unit)
                for each in found
            ]
        if not writers:
            return StaticValue()
        first, *others = writers
        if any(
            (other.type, other.refers_to, other.unit) != (first.type, first.refers_to, first.unit)
            for other in others
        ):
            return StaticValue()
        return replace(first, low=min(one.low for one in writers), high=max(one.high for one in writers))

    def _compute_operation(self, expression: Expression, operands: list[StaticValue]) -> StaticValue:
        name = expression.operator
        pairs = list(zip(expression.operands, operands, strict=True))
        if name in ("value", "text"):
            return operands[0] if name == "value" else StaticValue(str)
        if name in ("and", "or", "not"):
            for operand, static in pairs:
                if static.type not in (bool, Any):
                    raise _Mistake(
                        operand.span, f"{name} needs true or false, but {operand} is {static.describe()}"
                    )
            return StaticValue(bool, low=0.0, high=1.0)
        if name in ("in", "not in"):
            return self._compare_with_list(expression, pairs)
        if name in COMPARISONS:
            return self._compare(expression, pairs)
        for operand, static in pairs:
            if not static.is_number:
                raise _Mistake(operand.span, f"{name} needs numbers, but {operand} is {static.describe()}")
        return self._calculate(expression, operands)

    def _compare(self, expression: Expression, pairs: list[tuple[Value, StaticValue]]) -> StaticValue:
        name = expression.operator
        (_, left), (_, right) = pairs
        is_equality = name in ("==", "!=")
        for operand, static in pairs:
            if static.type is not Any and not is_assignable(static.type, float | str | bool | None):
                message = f"{name} compares numbers and texts, but {operand} is {static.describe()}"
                raise _Mistake(operand.span, message)
        if Any not in (left.type, right.type) and not (left.is_number and right.is_number):
            if not (is_assignable(left.type, right.type) or is_assignable(right.type, left.type)):
                message = f"{expression} compares {left.describe()} with {right.describe()}"
                raise _Mistake(expression.span, message)
            if not is_equality:
                raise _Mistake(
                    expression.span, f"{name} compares numbers, but {pairs[0][0]} is {left.describe()}"
                )
        for one, other in ((left, right), (right, left)):
            self._check_name(one, other.constant)
        if left.refers_to and right.refers_to and left.refers_to != right.refers_to:
            message = f"{expression} compares {left.describe()} with {right.describe()}"
            raise _Mistake(expression.span, message)
        self._join_units(expression, left, right)
        low, high = 0.0, 1.0
        is_certain = left.is_number and right.is_number and Any not in (left.type, right.type)
        if is_certain and not is_equality:
            corners = [
                COMPARISONS[name](one, other)
                for one in (left.low, left.high)
                for other in (right.low, right.high)
            ]
            low, high = float(all(corners)), float(any(corners))
        elif is_certain and (left.high < right.low or right.high < left.low):
            low = high = float(name == "!=")
        return StaticValue(bool, low=low, high=high)

    def _compare_with_list(
        self, expression: Expression, pairs: list[tuple[Value, StaticValue]]
    ) -> StaticValue:
        (_, left), (operand, right) = pairs
        if right.type is not Any and find_element_type(right.type) is None:
            raise _Mistake(
                operand.span, f"{expression.operator} needs a list, but {operand} is {right.describe()}"
            )
        if right.constant is not None and isinstance(right.constant.value, list):
            for index, element in enumerate(right.constant.value):
                span = right.constant.get_element_span(index)
                self._check_name(left, Constant(element, span))
                if not is_assignable(type(element), left.type) and not (
                    left.is_number and not isinstance(element, str)
                ):
                    message = f"{pairs[0][0]} is {left.describe()} and never equals {describe_value(element)}"
                    raise _Mistake(span, message)
        return StaticValue(bool, low=0.0, high=1.0)

    def _check_name(self, value: StaticValue, constant: Constant | None) -> None:
        """Raise a mistake if a constant is not what the value that it is compared with may be."""
        if constant is not None and value.choices is not None and constant.value not in value.choices:
            message = f"the value is {value.describe()} and never equals {describe_value(constant.value)}"
            raise _Mistake(constant.span, message)
        names = self._context.names_in_cell_by_kind.get(value.refers_to)
        if names is None or constant is None or constant.value in ("", *names):
            return
        hint = suggest_choice(str(constant.value), names, f"Names of a {value.refers_to}")
        message = f'the cell has no {value.refers_to} "{constant.value}"'
        raise _Mistake(constant.span, message, hint, f"unknown-{value.refers_to}")

    def _join_units(self, expression: Expression, *values: StaticValue) -> str | None:
        """Return the unit of values that are added or compared."""
        units = {value.unit for value in values if value.is_number and value.type is not Any} - {ANY_UNIT}
        if len(units) > 1:
            names = " and ".join(f'"{unit}"' if unit else "no unit" for unit in sorted(units, key=str))
            raise _Mistake(expression.span, f"{expression} mixes values with {names}")
        return units.pop() if units else ANY_UNIT

    def _calculate(self, expression: Expression, operands: list[StaticValue]) -> StaticValue:
        name = expression.operator
        types = {operand.type for operand in operands}
        type_: object = Any if Any in types else int if types == {int} and name != "/" else float
        unit = self._compute_unit(expression, operands)
        divides = name in ("/", "//", "%") and operands[1] != StaticValue()
        if divides and operands[1].low <= 0 <= operands[1].high:
            hint = "Use max(1, …), or check the divisor with `if` and declare its min."
            raise _Mistake(
                expression.operands[1].span, f"{expression.operands[1]} may be 0, and divides here", hint
            )
        if name == "round":
            type_ = int
        lows, highs = [one.low for one in operands], [one.high for one in operands]
        low, high = _compute_bounds(name, lows, highs)
        if name == "%" and type_ is int:
            # The remainder of whole numbers is nearer to 0 than the divisor.
            low, high = min(low + 1, 0.0), max(high - 1, 0.0)
        return StaticValue(type_, "", unit, low, high)

    def _compute_unit(self, expression: Expression, operands: list[StaticValue]) -> str | None:
        name = expression.operator
        units = [operand.unit for operand in operands]
        if name not in ("*", "/", "//"):
            return self._join_units(expression, *operands)
        left, right = units
        if not right or (name == "*" and not left):
            return left or right if left or right else (ANY_UNIT if ANY_UNIT in units else "")
        if name != "*" and left == right:
            return ""
        raise _Mistake(
            expression.span, f"{expression} has a unit that missions do not know", "Divide equal units."
        )


def _compute_bounds(name: str, lows: list[float], highs: list[float]) -> tuple[float, float]:
    """Return the smallest and the largest result of an operation on numbers."""
    if name == "%":
        # The result has the sign of the divisor.
        return min(lows[1], 0.0), max(highs[1], 0.0)
    if name == "abs":
        return (
            0.0 if lows[0] <= 0 <= highs[0] else min(abs(lows[0]), abs(highs[0])),
            max(abs(lows[0]), abs(highs[0])),
        )
    if name in ("min", "max"):
        return (min(lows), min(highs)) if name == "min" else (max(lows), max(highs))
    if name == "negative":
        return -highs[0], -lows[0]
    if name == "round":
        low, high = (bound if math.isinf(bound) else float(round(bound)) for bound in (lows[0], highs[0]))
        return low, high
    if name in ("/", "//") and lows[1] <= 0 <= highs[1]:
        return -math.inf, math.inf
    corners = [_apply(name, one, other) for one in (lows[0], highs[0]) for other in (lows[1], highs[1])]
    return min(corners), max(corners)


def _apply(name: str, left: float, right: float) -> float:
    """Return the result of an operation on bounds; 0 for an undefined product such as 0 times infinity."""
    if name in ("/", "//") and math.isinf(left) and math.isinf(right):
        return 0.0
    if name == "//" and math.isinf(left):
        return math.copysign(math.inf, left * right)
    result = float(cast("float", ARITHMETIC[name](left, right)))
    return 0.0 if math.isnan(result) else result

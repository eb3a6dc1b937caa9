"""Expressions: what they accept, what they compute, and how they are written again."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.cell.objects import KnownItem, Target
from executive.errors import Fault
from executive.text.findings import NOWHERE, Finding
from executive.tree.expression import MAX_DEPTH, MAX_LENGTH, Scope, read_expression, read_template
from executive.tree.specification import Expression, InvalidValue

TARGET = Target("cube-1", "cube", np.array([0.5, -0.1, 0.025]), 0.9, 1, 0, 2.0)
ITEM = KnownItem("cube-1", "cube", "open", "", np.zeros(3), 3, 0, 0, 0)


@pytest.fixture
def scope() -> Scope:
    """The variables, counters and clock of a run."""
    counts = {"placed": 4, "rejected": 1}
    ledger: Any = SimpleNamespace(
        count_items=lambda state, _label=None, bin=None: 2 if bin else counts[state],
        list_known_items=lambda: [SimpleNamespace(is_open=True), SimpleNamespace(is_open=False)],
        describe=lambda _item: ITEM,
    )
    variables = {"n": 3, "target": TARGET, "items": ["cube-1", "cube-2"], "item": "cube-1", "done": True}
    clock: Any = SimpleNamespace(now=12.5)
    return Scope(variables, ledger, clock)


def read(text: str) -> Expression:
    """Return an expression without mistakes."""
    findings: list[Finding] = []
    value = read_expression(text, NOWHERE, findings)
    assert not findings, findings[0]
    assert isinstance(value, Expression)
    return value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("= $n + 1", 4), ("$n - 5 * 2", -7), ("($n - 5) * 2", -4), ("-$n", -3), ("+$n", 3), ("$n / 2", 1.5),
        ("$n // 2", 1), ("$n % 2", 1), ("abs(1 - $n)", 2), ("round($n / 2 + 0.1)", 2),
        ("min($n, 2, 9)", 2), ("max($n, 2)", 3), ("1 < $n < 5", True), ("1 < $n < 3", False),
        ("$n == 3 and not $done", False), ("$n != 3 or $done", True), ("$done == true", True),
        ("$target.label == 'cube'", True), ("$target.label in ['duck', \"cube\"]", True),
        ("'cube-2' in $items", True), ("$target.label not in ['duck']", True), ("$items.count >= 2", True),
        ("$target.x", 0.5), ("$target.y", -0.1), ("$target.z", 0.025), ("$target.age", 10.5),
        ("$item.attempts", 3), ("run.elapsed", 12.5), ("run.placed", 4), ("run.rejected", 1),
        ("run.open", 1), ("bin.red_bin.count", 2), ('bin["red-bin"].count + run.placed', 6),
        ("$n == 3 or $nothing > 2", True), ("'costs $5 {x}' == 'costs $5 {x}'", True),
    ],
)  # fmt: skip
def test_an_expression_has_the_value_of_its_operations(scope: Scope, text: str, value: object) -> None:
    result = scope.evaluate(read(text))
    assert (result, type(result)) == (pytest.approx(value), type(value))


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("$n+1", "$n + 1"), ("($n-5)*2", "($n - 5) * 2"), ("not $done", "not $done"),
        ("min($n,2)", "min($n, 2)"), ("-$n<run.placed", "-$n < run.placed"),
        ("$target.label=='cube'", '$target.label == "cube"'), ("bin['a-b'].count>1", "bin.a-b.count > 1"),
        ("1<$n<5", "(1 < $n) and ($n < 5)"),
    ],
)  # fmt: skip
def test_an_expression_is_written_with_brackets_around_inner_operations(text: str, written: str) -> None:
    assert str(read(text)) == written


def test_a_text_contains_the_values_of_the_expressions_in_braces(scope: Scope) -> None:
    findings: list[Finding] = []
    text = read_template("only {$items.count} after {run.elapsed} s", NOWHERE, findings)
    assert (scope.evaluate(text), findings) == ("only 2 after 12.5 s", [])


def test_times_are_equal_in_spite_of_rounding_errors_of_the_clock(scope: Scope) -> None:
    clock: Any = SimpleNamespace(now=sum([0.1] * 125))
    assert clock.now != 12.5
    assert Scope(scope.variables, scope.ledger, clock).evaluate(read("run.elapsed >= 12.5"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("$nothing + 1", "no node has written"),
        ("$target.omits_none", "no field"),
        ("1 / ($n - 3)", "has no value"),
        ("$n * 1e15", "larger"),
    ],
)
def test_a_value_that_the_checks_did_not_foresee_is_a_fault(scope: Scope, text: str, message: str) -> None:
    with pytest.raises(Fault, match=message):
        scope.evaluate(read(text))


NAMES = ["__import__", "open", "eval", "exec", "globals", "getattr", "print", "type", "vars", "dir"]
ATTRIBUTES = [
    "__class__", "_ledger", "__dict__", "mro", "count.real", "label.upper", "x.y.z", "__init__.__globals__",
]  # fmt: skip
OWNERS = ["$n", "run", "bin", "bin.a", "()", "'a'", "[1]"]
OTHERS = r"""
[x for x in $n] | {x for x in $n} | {1: 2} | {1, 2} | (x for x in $n) | lambda: 1 | lambda x: x + 1 | (n := 3)
await $n | yield | f'{$n}' | f'{run.placed}' | b'a' | ... | None | 1j | *$n | $n if 1 else 2 | 2 ** 9
$n ** $n
9**9**9**9 | 1 << 9 | $n & 1 | $n ^ 1 | ~$n | $n @ $n | $n is 3 | 1e999 | -1e16 + $n | abs() | abs(1, 2)
min(1)
min(*$n) | max($n, key=1) | round($n, 2) | sum($n) | min | abs | $n[0] | $n[0:1] | $n['x'] | bin[0].count
bin[$n].count | bin.count | bin.a.b.count | bin['__class__'] | run.__class__ | run.placed.real | _x | __x
$n.__class__ | $__n.__class__ | $n._x | $ | $$n | $1 | n | $n = 3 | $n == | == 3 | $n $n | $n; $n | import os
del $n | pass | return 3 | raise $n | @$n | (((( | )))) | $n + '\ | " | '
[$n] | [[1]] | [] | [1, run.placed] | () | [run] | # | # $n | = | !$n | $n ! 3 | $n <> 3 | $n && $n
$n ? 1 : 2 | $n++ | `$n` | \ | $n\ | 'a' 'b' + $n.x.y | run | bin | run.elapsed() | $n.count() | $n.x() | not
and | $n and | or $n | 1 + | * 3 | / | % | in [1] | $n in | $n not | $n not 3 | 1 2 | 1.2.3 | 1..2 | 0777
1__0
"""
HOSTILE = [
    *(
        f"{name}{arguments}"
        for name, arguments in itertools.product(NAMES, ["", "()", "('os')", ".x", "[0]"])
    ),
    *(f"{owner}.{name}" for owner, name in itertools.product(OWNERS, ATTRIBUTES) if owner + name != "$nmro"),
    *(f"{owner}.{name}()" for owner, name in itertools.product(["$n", "run", "'a'", "1.5"], ATTRIBUTES)),
    *(text.strip() for line in OTHERS.strip().splitlines() for text in line.split(" | ")),
    *(
        "",
        "   ",
        "$n | 1",
        "$n || $n",
        "$n\n+ 1; 2",
        "\x00",
        "$n + \x00",
        "9" * 30,
        "9" * 5000,
        "0x" + "f" * 20,
    ),
    *("(" * 300, "(" * 90 + "$n" + ")" * 90, f"{'-(' * (MAX_DEPTH + 1)}$n{')' * (MAX_DEPTH + 1)}"),
    *("not " * 40 + "$n", "-" * 40 + "$n", "$n + " * (MAX_LENGTH // 5) + "$n"),
]
"""Texts that are no expressions, or that would execute something."""


def test_there_are_200_hostile_texts() -> None:
    assert len(set(HOSTILE)) >= 200


@pytest.mark.parametrize("text", HOSTILE)
def test_a_hostile_text_is_an_error_and_is_not_evaluated(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Scope, "evaluate", lambda *_: pytest.fail("evaluated"))
    findings: list[Finding] = []
    value = read_expression(text, NOWHERE, findings)
    assert isinstance(value, InvalidValue)
    assert [finding.code for finding in findings] == ["expression"]

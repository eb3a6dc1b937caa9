"""Control nodes with short arguments; names of failures are pairs of source and reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import inf
from typing import Any

from hand_set_clock import Clock

from executive.events import Emit, discard_event
from executive.text.findings import NOWHERE
from executive.tree.blackboard import Blackboard, NodeContext
from executive.tree.decorators import Invert, Succeed, Timeout
from executive.tree.expression import read_expression
from executive.tree.loops import ForEach, Repeat, While
from executive.tree.parallel import Parallel
from executive.tree.retry import Backoff, Catch, Retry, TryCatch
from executive.tree.sequences import Fallback
from executive.tree.sequences import Sequence as SequenceNode
from executive.tree.specification import Reason, VariableName
from tests.node_behaviours import build, specify

Names = Iterable[tuple[str, str]]


def make_site(
    path: str = "node", label: str = "", emit: Emit = discard_event, clock: Any = None
) -> NodeContext:
    ledger: Any = None
    return NodeContext(path, clock or Clock(), ledger, Blackboard(), label, emit)


def names_of(pairs: Names) -> tuple[Reason, ...]:
    return tuple(Reason(*pair) for pair in pairs)


def sequence(site: NodeContext, children: Any) -> Any:
    return build(site, SequenceNode, do=children)


def fallback(site: NodeContext, children: Any) -> Any:
    return build(site, Fallback, do=children)


def parallel(site: NodeContext, children: Any, wait_for: Any = "all", halt: bool = False) -> Any:
    return build(site, Parallel, do=children, wait_for=wait_for, halt=halt)


def lead(site: NodeContext, children: Any) -> Any:
    return build(site, Parallel, do=children, wait_for="lead")


def make_backoff(first: float, factor: float = 1.0, max: float = inf) -> Backoff:
    return Backoff(first=first, factor=factor, max=max)


def retry(
    site: NodeContext,
    body: Any,
    attempts: int,
    on: Names = (),
    recover: Any = None,
    backoff: Any = None,
    clock: Any = None,
) -> Any:
    site = replace(site, clock=clock or site.clock)
    return build(site, Retry, attempts=attempts, on=names_of(on), recover=recover, backoff=backoff, do=body)


def repeat(site: NodeContext, body: Any, times: int | None = None, until: Names = (), **limits: float) -> Any:
    texts = [f"run.{name} >= {limit}" for name, limit in limits.items()]
    ends = (*names_of(until), *(read_expression(text, NOWHERE, []) for text in texts))
    return build(site, Repeat, times=times, until=ends, do=body)


def while_loop(site: NodeContext, condition: Any, body: Any) -> Any:
    return build(site, While, condition=condition, do=body)


def for_each(site: NodeContext, body: Any, blackboard: Blackboard, each: str, source: Any) -> Any:
    elements = VariableName(source) if isinstance(source, str) else tuple(source)
    site = replace(site, blackboard=blackboard)
    return build(site, ForEach, each=VariableName(each), in_=elements, do=body)


def try_catch(
    site: NodeContext, body: Any, handlers: Iterable[tuple[Names, Any]] = (), last: Any = None
) -> Any:
    catch = tuple(Catch(on=names_of(names), do=specify(do)) for names, do in handlers)
    return build(site, TryCatch, do=body, catch=catch, finally_=last)


def timeout(site: NodeContext, body: Any, seconds: float, clock: Any) -> Any:
    return build(replace(site, clock=clock), Timeout, seconds=seconds, do=body)


def invert(site: NodeContext, body: Any) -> Any:
    return build(site, Invert, do=body)


def succeed(site: NodeContext, body: Any = None) -> Any:
    return build(site, Succeed, do=body)

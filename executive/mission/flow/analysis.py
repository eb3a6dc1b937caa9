"""An abstract run of the tree over every way it can go, for the checks to ask about.

Every node is entered with what is true on all ways to it (`State`) and says how it may end (`Flow`).
Loops go round until nothing new turns up: variables can only become fewer and grips more, so they do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from executive.mission.findings import suggest
from executive.mission.flow.parallel import at_once
from executive.mission.flow.state import (
    ANYTHING,
    BEGINNING,
    UNKNOWN,
    Flow,
    Raise,
    State,
    joined,
    left_after,
    left_after_failure,
    required,
)
from executive.mission.model import nodes
from executive.mission.model.nodes import Node
from executive.mission.model.values import Literal, Match, Value
from executive.mission.model.wiring import wires
from executive.skill import Direction, Skill

HALT = "halt"
"""The key of `Skill.tool_left` for what the tool holds after a halt."""


class Analysis:
    """What can happen in a tree.

    Args:
        tree: The tree that runs, with paths.
        skills: Installed skills by name.

    Attributes:
        nodes: Every node by its path.
        entry: What is true where a node begins, by its path; a node that cannot be reached is not there.
        flows: How a node may end, by its path; the failures are those of every entry.
        bodies: What is true after the body of a `use` succeeded, by the path of the use.
        result: How the whole tree may end.
    """

    def __init__(self, tree: Node, skills: Mapping[str, type[Skill]]) -> None:
        self.nodes = {node.path: node for node in tree.walk()}
        self.entry: dict[str, State] = {}
        self.flows: dict[str, Flow] = {}
        self.bodies: dict[str, State | None] = {}
        self._skills = skills
        self._known: dict[tuple[str, State], Flow] = {}
        self.result = self._run(tree, BEGINNING)

    def skill(self, name: str) -> type[Skill] | None:
        """Return the skill of this name, or the one that was probably meant."""
        meant = name if name in self._skills else suggest(name, self._skills)
        return self._skills[meant] if meant else None

    def _run(self, node: Node, state: State) -> Flow:
        self.entry[node.path] = state.join(self.entry.get(node.path, state))
        key = node.path, state
        if key not in self._known:
            flow: Flow = getattr(self, f"_{node.word}")(node, state).labelled(node.label)
            self._known[key] = self.flows[node.path] = flow
        return self._known[key]

    def _skill(self, node: Any, state: State) -> Flow:
        skill = self.skill(node.skill)
        if skill is None:
            return Flow(UNKNOWN, {Raise(node.skill, ANYTHING, node.path): UNKNOWN}, UNKNOWN)
        before, after = skill.tool_state
        state = state.gripping(required(state.grips, before, node.path))
        outputs = [wire.variable for wire in wires(node, skill, Direction.OUT)]
        end = state.moved() if skill.moves else state
        success = end.writing(outputs).gripping(left_after(end.grips, after, node.path))

        def left(by: str) -> State:
            return end.gripping(left_after_failure(end.grips, skill.tool_left.get(by), node.path))

        failures = {Raise(node.skill, reason, node.path): left(reason) for reason in skill.reasons}
        return Flow(success, failures, left(HALT))

    def _sequence(self, node: Any, state: State) -> Flow:
        failures: dict[Raise, State] = {}
        halted = None
        here: State | None = state
        for step in node.steps:
            if here is None:
                break
            flow = self._run(step, here)
            failures.update(flow.failures)
            here, halted = flow.success, joined((halted, flow.halted))
        return Flow(here, failures, halted)

    def _fallback(self, node: Any, state: State) -> Flow:
        success = halted = None
        failures: Mapping[Raise, State] = {}
        here: State | None = state
        for choice in node.choices:
            if here is None:
                break
            flow = self._run(choice, here)
            success, halted = joined((success, flow.success)), joined((halted, flow.halted))
            failures = flow.failures
            here = joined(after.dealt_with(failure) for failure, after in failures.items())
        return Flow(success, failures, halted)

    def _parallel(self, node: Any, state: State) -> Flow:
        flows = [self._run(branch, state) for branch in node.branches]
        return at_once(flows, state, _constant(node.wait_for), _constant(node.halt) is True)

    def _retry(self, node: Any, state: State) -> Flow:
        recovery: list[Flow] = []
        waiting: State | None = None

        def again(body: Flow) -> State | None:
            nonlocal waiting
            recovery.clear()
            tried = [
                after.dealt_with(failure)
                for failure, after in body.failures.items()
                if _tried_again(node, failure)
            ]
            waiting = joined(tried) if _constant(node.attempts) != 1 else None
            if waiting is None or node.recover is None:
                return waiting
            recovery.append(self._run(node.recover, waiting))
            return recovery[0].success

        body, _ = self._round(node.do, state, again)
        given_up = joined(after for flow in recovery for after in flow.failures.values())
        failures = {
            failure: after.join(given_up or after) if _tried_again(node, failure) else after
            for failure, after in body.failures.items()
        }
        halted = joined((body.halted, *(flow.halted for flow in recovery), node.backoff and waiting))
        return Flow(body.success, failures, halted)

    def _repeat(self, node: Any, state: State) -> Flow:
        times = None if node.times is None else _constant(node.times)
        if times == 0:
            return Flow(state, {}, None)
        body, entry = self._round(node.do, state, lambda flow: None if times == 1 else flow.success)
        ended = [after for failure, after in body.failures.items() if failure.may_match(node.until)]
        success = joined((*ended, None if node.times is None else body.success))
        passed = {one: after for one, after in body.failures.items() if not one.must_match(node.until)}
        return Flow(success, passed, joined((body.halted, entry)))

    def _while(self, node: Any, state: State) -> Flow:
        rounds: list[Flow] = []

        def again(condition: Flow) -> State | None:
            rounds.clear()
            if condition.success is None:
                return None
            rounds.append(self._run(node.do, condition.success))
            return rounds[0].success

        condition, entry = self._round(node.condition, state, again)
        failures = {failure: after for flow in rounds for failure, after in flow.failures.items()}
        halted = joined((condition.halted, entry, *(flow.halted for flow in rounds)))
        return Flow(joined(condition.failures.values()), failures, halted)

    def _for_each(self, node: Any, state: State) -> Flow:
        elements, name = _constant(node.source), node.each.name
        if elements == []:
            return Flow(state, {}, None)
        body, entry = self._round(node.do, state.writing([name]), lambda flow: flow.success)
        success = joined((body.success, None if elements else state))
        failures = {failure: after.forgetting(name) for failure, after in body.failures.items()}
        # A round that takes no time is followed by a wait for the next tick.
        halted = joined((body.halted, entry))
        return Flow(success and success.forgetting(name), failures, halted and halted.forgetting(name))

    def _try(self, node: Any, state: State) -> Flow:
        body = self._run(node.do, state)
        success, halted = body.success, body.halted
        failures = dict(body.failures)
        earlier: list[Match] = []
        for catch in node.catches:
            caught = {
                failure: after
                for failure, after in body.failures.items()
                if failure.may_match(catch.on) and not failure.must_match(earlier)
            }
            earlier += catch.on
            entry = joined(after.dealt_with(failure) for failure, after in caught.items())
            if entry is None:
                continue
            for failure in caught:
                if failure.must_match(catch.on):
                    failures.pop(failure, None)
            handler = self._run(catch.do, entry)
            success, halted = joined((success, handler.success)), joined((halted, handler.halted))
            failures.update(handler.failures)
        flow = Flow(success, failures, halted)
        return flow if node.finish is None else self._finished(node.finish, flow)

    def _finished(self, finish: Node, flow: Flow) -> Flow:
        """Return the flow of a `try` whose `finally` runs after each of its ends."""
        success, halted = None, flow.halted
        failures: dict[Raise, State] = {}
        if flow.success is not None:
            end = self._run(finish, flow.success)
            success, halted = end.success, joined((halted, end.halted))
            failures.update(end.failures)
        for failure, after in flow.failures.items():
            end = self._run(finish, after)
            halted = joined((halted, end.halted))
            failures[failure] = joined((end.success, *end.failures.values())) or after
        return Flow(success, failures, halted)

    def _timeout(self, node: Any, state: State) -> Flow:
        body = self._run(node.do, state)
        failures = dict(body.failures)
        if body.halted is not None:
            failures[Raise("timeout", "timeout", node.path)] = body.halted
        return Flow(body.success, failures, body.halted)

    def _invert(self, node: Any, state: State) -> Flow:
        body = self._run(node.do, state)
        inverted = Raise("invert", "inverted", node.path)
        failures = {} if body.success is None else {inverted: body.success}
        return Flow(joined(body.failures.values()), failures, body.halted)

    def _succeed(self, node: Any, state: State) -> Flow:
        if node.do is None:
            return Flow(state, {}, None)
        body = self._run(node.do, state)
        return Flow(joined((body.success, *body.failures.values())), {}, body.halted)

    def _unknown(self, node: Any, state: State) -> Flow:
        del state  # Whatever stands around the parts, it is not what the author meant.
        for part in node.parts:
            self._run(part, UNKNOWN)
        return _anything(node)

    def _use(self, node: Any, state: State) -> Flow:
        if node.body is None:
            return _anything(node)
        flow = self._run(node.body, state)
        # One use may be entered in several states: in a finally, in a loop.
        self.bodies[node.path] = joined((self.bodies.get(node.path), flow.success))
        # A promise that is not kept is told there, not wherever somebody relies on it.
        promised = flow.success and flow.success.writing(node.promised)
        return replace(flow, success=promised)

    def _round(self, node: Node, state: State, again: Callable[[Flow], State | None]) -> tuple[Flow, State]:
        """Return the flow of a node that is entered anew in the state `again` tells, and what it is then."""
        entry = state
        while True:
            flow = self._run(node, entry)
            widened = entry.join(again(flow) or entry)
            if widened == entry:
                return flow, entry
            entry = widened


def _anything(node: Node) -> Flow:
    return Flow(UNKNOWN, {Raise(ANYTHING, ANYTHING, node.path): UNKNOWN}, UNKNOWN)


def _tried_again(node: nodes.RetryNode, failure: Raise) -> bool:
    return not node.on or failure.may_match(node.on)


def _constant(value: Value) -> Any:
    """Return the value if it is known, else None."""
    return value.value if isinstance(value, Literal) else None

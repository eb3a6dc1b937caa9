"""Behaviours of py_trees as skills: their life, their failures and faults, their ports."""

from __future__ import annotations

from typing import Any

import foreign
import pytest
from py_trees import behaviours, timers
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status

from executive.behaviours.behaviour_skill import RunBlackboard, make_behaviour_skill
from executive.cells.fake.cell import FakeCell
from executive.errors import Fault, InputError
from executive.skill import Direction
from executive.testing.conformance import list_conformance_checks
from executive.testing.run_skill import SkillResult, run_skill


@pytest.fixture(autouse=True)
def calls() -> list[str]:
    foreign.Logged.calls.clear()
    foreign.TwoArms.stopped.clear()
    return foreign.Logged.calls


def run(behaviour: type[Behaviour], fake: FakeCell, halt_at: int | None = None, **values: Any) -> SkillResult:
    skill = make_behaviour_skill(behaviour.__name__, behaviour)
    return run_skill(skill, fake, inputs=values, halt_at=halt_at)


def test_a_behaviour_lives_as_py_trees_promises(fake: FakeCell, calls: list[str]) -> None:
    assert run(foreign.Logged, fake).status == "SUCCESS"
    assert calls == [
        "init", "setup", "initialise", "update", "update", "terminate RUNNING to SUCCESS", "shutdown",
    ]  # fmt: skip


def test_every_start_creates_the_behaviour_anew(fake: FakeCell, calls: list[str]) -> None:
    run(foreign.Logged, fake)
    first = list(calls)
    calls.clear()
    run(foreign.Logged, fake)
    assert calls == first


def test_a_halt_stops_the_behaviour_once(fake: FakeCell, calls: list[str]) -> None:
    assert run(foreign.Logged, fake, halt_at=1).status == "HALTED"
    assert calls[-2:] == ["terminate RUNNING to INVALID", "shutdown"]
    assert sum(call.startswith("terminate") for call in calls) == 1


def test_the_feedback_message_explains_the_failure(fake: FakeCell) -> None:
    result = run(foreign.Logged, fake, last="FAILURE")
    assert (result.status, result.reason, result.message) == ("FAILURE", "failed", "ticked 2 times")


def test_a_failure_without_feedback_is_explained_by_the_node_below(fake: FakeCell) -> None:
    assert run(foreign.Quiet, fake).message == "the child: failure"
    assert run(foreign.Denied, fake).message == "success -> failure"
    queue = run(behaviours.StatusQueue, fake, queue=["FAILURE"], eventually=None)
    assert queue.message == "it has no feedback message"


@pytest.mark.parametrize("method", ["init", "setup", "initialise", "update", "shutdown"])
def test_an_exception_is_no_failure(method: str, fake: FakeCell, calls: list[str]) -> None:
    with pytest.raises(RuntimeError, match=f"broken {method}"):
        run(foreign.Logged, fake, broken=method)
    assert ("shutdown" in calls) == (method != "init")


def test_an_exception_while_it_is_halted_is_a_fault(fake: FakeCell) -> None:
    with pytest.raises(Fault, match="RuntimeError while it was halted: broken terminate"):
        run(foreign.Logged, fake, broken="terminate", halt_at=1)


def test_a_halt_stops_every_node_below_even_if_some_cannot_stop(fake: FakeCell) -> None:
    with pytest.raises(Fault, match="left does not stop"):
        run(foreign.TwoArms, fake, halt_at=1)
    assert foreign.TwoArms.stopped == ["left", "left", "right"]


def test_no_status_is_a_fault(fake: FakeCell) -> None:
    with pytest.raises(Fault, match="its status is INVALID after a tick"):
        run(foreign.Odd, fake)


def test_a_decorator_with_its_child_is_one_leaf(fake: FakeCell) -> None:
    skill = make_behaviour_skill("Never", foreign.Never)
    assert run_skill(skill, fake, halt_at=5).status == "HALTED"
    assert run_skill(skill, fake, max_ticks=5).status == "RUNNING"


def test_the_arguments_become_params_without_the_name() -> None:
    params = make_behaviour_skill("Primer", foreign.Primer).params
    assert list(params) == ["coats", "colour", "then", "stroke"]
    assert [params[name].is_required for name in params] == [False, True, False, False]
    assert params["stroke"].default == 0.1
    assert params["colour"].doc == "colour of the paint, which dries"


def test_data_on_the_blackboard_stay_in_their_run() -> None:
    first, second = FakeCell(), FakeCell()
    before = dict(Blackboard.storage), len(Blackboard.clients)
    for fake, most in ((first, 1), (second, 1)):
        assert run(foreign.Counter, fake, most=most).status == "SUCCESS"
    assert run(foreign.Counter, first, most=1).message == "count is 2"
    assert (dict(Blackboard.storage), len(Blackboard.clients)) == before


def test_two_interleaved_runs_do_not_see_each_other() -> None:
    skill = make_behaviour_skill("Waiting", behaviours.WaitForBlackboardVariable)
    cells = [FakeCell(), FakeCell()]
    waiting = [iter(skill(variable_name="count").run(cell.cell) or ()) for cell in cells]
    for steps in waiting * 2:
        next(steps)
    run(foreign.Counter, cells[0])
    assert next(waiting[0], "ended") == "ended"
    assert next(waiting[1], "ended") is None
    waiting[1].close()  # type: ignore[attr-defined]


def test_ports_become_inputs_and_outputs() -> None:
    ports = make_behaviour_skill("Double", foreign.Double).ports
    assert {name: port.direction for name, port in ports.items()} == {
        "number": Direction.IN, "offset": Direction.IN, "note": Direction.IN,
        "doubled": Direction.OUT, "remark": Direction.OUT,
    }  # fmt: skip
    assert [name for name, port in ports.items() if port.is_required] == ["number"]
    assert ports["number"].doc == "number to double"
    assert (ports["doubled"].type, ports["remark"].type) == (float, str | None)


def test_inputs_are_connected_and_outputs_are_read(fake: FakeCell) -> None:
    assert run(foreign.Double, fake, number=2.0, note="hm").outputs == {"doubled": 4.5, "remark": "note: hm"}
    # py_trees refuses an integer for a float, and None.
    assert run(foreign.Double, fake, number=2, offset=1.0, note=None).outputs["doubled"] == 5.0


def test_a_required_output_without_a_value_is_a_fault(fake: FakeCell) -> None:
    with pytest.raises(Fault, match="it succeeded without setting its output doubled"):
        run(foreign.Double, fake, number=-1.0)


def test_the_values_of_ports_do_not_remain(fake: FakeCell) -> None:
    run(foreign.Double, fake, number=1.0)
    assert RunBlackboard(fake.cell.clock).storage == {}


@pytest.mark.parametrize(
    ("behaviour", "problem"),
    [
        (foreign.Abstract, "is abstract: it has no method update, or does not declare its ports"),
        (foreign.NeedsChild, 'needs the argument "child", and no mission can contain a value of its type'),
        (foreign.Reserved, 'has an argument or port with the reserved name "run"'),
        (foreign.SameName, 'has an argument and a port with the same name "number"; rename one of them'),
        (foreign.Undeclared, "does not declare its ports"),
        (behaviours.CheckBlackboardVariableValue, 'needs the argument "check"'),
    ],
)
def test_a_behaviour_that_no_mission_can_use_is_refused(behaviour: type[Behaviour], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        make_behaviour_skill(behaviour.__name__, behaviour)


@pytest.mark.parametrize(
    ("behaviour", "senses"),
    [(behaviours.TickCounter, False), (behaviours.ProbabilisticBehaviour, True), (timers.Timer, True)],
)
def test_only_known_behaviours_get_no_new_information(behaviour: type[Behaviour], senses: bool) -> None:
    assert make_behaviour_skill(behaviour.__name__, behaviour).senses == senses


def test_a_skill_is_made_once() -> None:
    assert make_behaviour_skill("A", foreign.Logged) is make_behaviour_skill("A", foreign.Logged)
    assert Status.SUCCESS.name in str(make_behaviour_skill("Logged", foreign.Logged).params["last"].default)


@pytest.mark.parametrize(
    ("behaviour", "values"),
    [
        (foreign.Double, {"number": 2.0}),
        (behaviours.TickCounter, {"duration": 3, "completion_status": "SUCCESS"}),
    ],
)
def test_a_behaviour_conforms_to_the_rules_of_skills(
    behaviour: type[Behaviour], values: dict[str, object]
) -> None:
    skill = make_behaviour_skill(behaviour.__name__, behaviour)
    for check in list_conformance_checks(skill, lambda scene: values):
        check()

"""Behaviours of py_trees as skills: their life, their failures and faults, their ports and blackboards."""

from __future__ import annotations

from typing import Any

import foreign
import pytest
from py_trees import behaviours, timers
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.decorators import Inverter

from executive.behaviours import RunBlackboard, make_behaviour_skill
from executive.errors import Fault, InputError
from executive.skill import Direction
from executive.testing.fake_cell import FakeCell
from executive.testing.run_skill import SkillResult, run_skill


@pytest.fixture(autouse=True)
def calls() -> list[str]:
    foreign.Logged.calls.clear()
    foreign.TwoArms.stopped.clear()
    return foreign.Logged.calls


def run(behaviour: type[Behaviour], fake: FakeCell, halt_at: int | None = None, **values: Any) -> SkillResult:
    skill = make_behaviour_skill(behaviour.__name__, behaviour)
    return run_skill(skill, fake, inputs=values, halt_at=halt_at)


def test_every_start_creates_the_behaviour_anew(fake: FakeCell, calls: list[str]) -> None:
    assert run(foreign.Logged, fake).status == run(foreign.Logged, fake).status == "SUCCESS"
    life = ["init", "setup", "initialise", "update", "update", "terminate RUNNING to SUCCESS", "shutdown"]
    assert calls == life * 2


def test_a_halt_stops_the_behaviour_once(fake: FakeCell, calls: list[str]) -> None:
    assert run(foreign.Logged, fake, halt_at=1).status == "HALTED"
    assert calls[-2:] == ["terminate RUNNING to INVALID", "shutdown"]
    assert sum(call.startswith("terminate") for call in calls) == 1


@pytest.mark.parametrize(
    ("behaviour", "values", "message"),
    [
        (foreign.Logged, {"last": "FAILURE"}, "ticked 2 times"),
        (foreign.Quiet, {}, "the child: failure"),
        (behaviours.StatusQueue, {"queue": ["FAILURE"], "eventually": None}, "it has no feedback message"),
    ],
)
def test_the_feedback_message_explains_the_failure(
    behaviour: type[Behaviour], values: dict[str, Any], message: str, fake: FakeCell
) -> None:
    result = run(behaviour, fake, **values)
    assert (result.status, result.reason, result.message) == ("FAILURE", "failed", message)


@pytest.mark.parametrize("method", ["init", "setup", "update", "shutdown"])
def test_an_exception_is_no_failure(method: str, fake: FakeCell, calls: list[str]) -> None:
    with pytest.raises(RuntimeError, match=f"broken {method}"):
        run(foreign.Logged, fake, broken=method)
    assert ("shutdown" in calls) == (method != "init")


def test_a_halt_stops_every_node_below_even_if_some_cannot_stop(fake: FakeCell) -> None:
    with pytest.raises(Fault, match="RuntimeError while it was halted: left does not stop"):
        run(foreign.TwoArms, fake, halt_at=1)
    assert foreign.TwoArms.stopped == ["left", "left", "right"]


def test_no_status_is_a_fault(fake: FakeCell) -> None:
    with pytest.raises(Fault, match="its status is INVALID after a tick"):
        run(foreign.Odd, fake)


def test_the_arguments_become_params_without_the_name() -> None:
    params = make_behaviour_skill("Primer", foreign.Primer).params
    assert list(params) == ["coats", "colour", "then", "stroke"]
    assert [params[name].is_required for name in params] == [False, True, False, False]
    logged = make_behaviour_skill("Logged", foreign.Logged)
    assert (params["stroke"].default, logged.params["last"].default) == (0.1, "SUCCESS")
    assert make_behaviour_skill("Logged", foreign.Logged) is logged


def test_only_known_behaviours_get_no_new_information() -> None:
    types = (behaviours.TickCounter, behaviours.ProbabilisticBehaviour, timers.Timer)
    assert [make_behaviour_skill("A", each).senses for each in types] == [False, True, True]


def test_data_on_the_blackboard_stay_in_their_run() -> None:
    skill = make_behaviour_skill("Waiting", behaviours.WaitForBlackboardVariable)
    cells = [FakeCell(), FakeCell()]
    before = dict(Blackboard.storage), len(Blackboard.clients)
    waiting = [iter(skill(variable_name="count").run(cell.cell) or ()) for cell in cells]
    for steps in waiting * 2:
        next(steps)
    assert run(foreign.Counter, cells[0], most=1).status == "SUCCESS"
    assert (next(waiting[0], "ended"), next(waiting[1], "ended")) == ("ended", None)
    waiting[1].close()  # type: ignore[attr-defined]
    assert run(foreign.Counter, cells[0], most=1).message == "count is 2"
    assert (dict(Blackboard.storage), len(Blackboard.clients)) == before


def test_ports_become_inputs_and_outputs(fake: FakeCell) -> None:
    ports = make_behaviour_skill("Double", foreign.Double).ports
    assert {name: port.direction for name, port in ports.items()} == {
        "number": Direction.IN, "offset": Direction.IN, "note": Direction.IN,
        "doubled": Direction.OUT, "remark": Direction.OUT,
    }  # fmt: skip
    assert [name for name, port in ports.items() if port.is_required] == ["number"]
    assert ports["number"].doc == "number to double"
    assert (ports["doubled"].type, ports["remark"].type) == (float, str | None)
    assert run(foreign.Double, fake, number=2.0, note="hm").outputs == {"doubled": 4.5, "remark": "note: hm"}
    # py_trees refuses an integer for a float, and None.
    assert run(foreign.Double, fake, number=2, offset=1.0, note=None).outputs["doubled"] == 5.0
    assert RunBlackboard(fake.cell.clock).storage == {}
    with pytest.raises(Fault, match="it succeeded without setting its output doubled"):
        run(foreign.Double, fake, number=-1.0)


@pytest.mark.parametrize(
    ("behaviour", "problem"),
    [
        (Behaviour, "is abstract: it has no method update, or does not declare its ports"),
        (Inverter, 'needs the argument "child", and no mission can contain a value of its type'),
        (foreign.Reserved, 'has an argument or port with the reserved name "run"'),
        (foreign.Secretive, r"cannot be a skill: Secretive writes \$doubled, and declares is_condition"),
    ],
)
def test_a_behaviour_that_no_mission_can_use_is_refused(behaviour: type[Behaviour], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        make_behaviour_skill(behaviour.__name__, behaviour)

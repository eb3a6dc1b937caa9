"""What the check knows of a mission, held against what happens in a run of it."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.common import Status

from executive.events import NodeStarted, RunEnded, TimedEvent
from executive.mission.flow_analysis import FlowAnalysis
from executive.mission.load import LoadedMission
from executive.mission.model.nodes import SkillNode
from executive.run.run import Run
from executive.skill import EMPTY, HOLDING, Skill
from executive.tree.blackboard import Blackboard
from tests.mission.unkind_cell import UnkindCell


class Witness:
    """Watches a run for what the check has promised of it, and remembers what was otherwise.

    Args:
        loaded: The mission.
        skills: Installed skills by name.
        scope: The variables of the run.

    Attributes:
        cell: The cell of the run, once there is one.
    """

    def __init__(self, loaded: LoadedMission, skills: Mapping[str, type[Skill]], scope: Blackboard) -> None:
        self._flow = FlowAnalysis(loaded.tree, skills)
        self._endings = {
            (f"{ending.source}.{ending.reason}", ending.node) for ending in loaded.unhandled_failures
        }
        self._skills = {
            node.path: skills[node.skill] for node in loaded.tree.walk() if isinstance(node, SkillNode)
        }
        self._scope = scope
        self._broken: list[str] = []
        self.cell: UnkindCell | None = None

    def __call__(self, timed: TimedEvent) -> None:
        if self.cell is None or not isinstance(timed.event, NodeStarted):
            return
        path = timed.event.node
        entry = self._flow.entry_states.get(path)
        if entry is None:
            self._broken.append(f"{path} runs, which the check says it never does")
        elif missing := [f"${name}" for name in entry.written_variables or () if name not in self._scope]:
            self._broken.append(
                f"{path} begins without {', '.join(missing)}, which the check says are written"
            )
        before = self._skills[path].tool_state[0] if path in self._skills else None
        if before is EMPTY and self.cell.tool.holding:
            self._broken.append(f"{path} needs an empty tool and has none")
        if before is HOLDING and not self.cell.tool.holding and not self.cell.has_dropped:
            self._broken.append(f"{path} needs something in the tool and has nothing")

    def problems(self, run: Run, outcome: RunEnded) -> list[str]:
        """Return everything in the run and its outcome that must not be."""
        assert self.cell is not None
        success, found = self._flow.root_flow.success, list(dict.fromkeys(self._broken))
        status, reason, node = outcome.status, outcome.reason, outcome.node
        if status == "FAULT":
            found.append(f"fault in {node}: {outcome.message}")
        if status == "FAILURE" and node and (reason, node) not in self._endings:
            found.append(f"it ends with {reason} of {node}, which the check does not list")
        if status == "SUCCESS" and success is None:
            found.append("it succeeds, which the check says it never does")
        if (
            status == "SUCCESS"
            and success
            and not success.find_tool_state(HOLDING)
            and self.cell.tool.holding
        ):
            found.append("it ends well with something in the tool, of which the check does not warn")
        running = [behaviour for behaviour in run.root.iterate() if behaviour.status is Status.RUNNING]
        return found + [f"{behaviour.name} still runs" for behaviour in running]

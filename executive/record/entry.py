"""Events in the form of journal format 1, for observers that are not converted to typed events yet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from executive import events
from executive.cell.frame import FrameTaken
from executive.events import TimedEvent

_KINDS = {
    events.RunStarted: "run", events.NodeStarted: "status", events.NodeEnded: "status",
    events.BranchChosen: "choice", events.ItemChanged: "item", events.FrameSearched: "look",
    events.TargetSelected: "decision", events.ToolCommanded: "intent", events.MotionPlanned: "plan",
    events.InputRead: "sense", events.OperatorAsked: "asking", events.RequestGiven: "request",
    events.RunHalted: "halt", events.RunResumed: "resume", events.FaultInjected: "disturbance",
    events.FaultRaised: "fault", events.RunEnded: "end", FrameTaken: "frame",
}  # fmt: skip


@dataclass(frozen=True)
class OldEvent:
    """An event with a kind and plain data."""

    kind: str
    tick: int
    clock: float
    data: dict[str, Any]


def old_event(timed: TimedEvent) -> OldEvent:
    """Return an event with its kind and data of format 1."""
    event = timed.event
    data = dict(vars(event))
    if isinstance(event, events.NodeStarted | events.NodeEnded):
        data["status"] = data.get("status", "RUNNING")
        is_skill = bool(data.pop("skill"))
        data = {key: value for key, value in data.items() if is_skill or key not in ("item", "outputs")}
        if is_skill:
            data.pop("origin", None)
            data = {"reason": "", "message": ""} | data
            if data.get("outputs") is None:
                data.pop("outputs", None)
        elif not data.get("reason"):
            data = {key: value for key, value in data.items() if key not in ("reason", "message", "origin")}
    elif isinstance(event, events.FrameSearched):
        data |= {key: [vars(one) for one in data[key]] for key in ("found", "unsure")}
    elif isinstance(event, events.FaultInjected):
        data["what"] = data.pop("name")
    elif isinstance(event, FrameTaken):
        data = {"frame_object": event.frame}
    return OldEvent(_KINDS[type(event)], timed.tick, timed.clock, data)


def old_entry(timed: TimedEvent) -> dict[str, Any]:
    """Return an event as an entry of a journal of format 1."""
    old = old_event(timed)
    return {"tick": old.tick, "clock": old.clock, "kind": old.kind, **old.data}

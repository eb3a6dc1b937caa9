"""Events of a run: one frozen dataclass per kind of event.

The parts of a run emit events; observers (journal, trace, pictures, views) receive each event with its time.
The journal contains one JSON object per event; the keys of the object are the fields of the event class.
"""

from executive.events.cell_events import (
    DetectedObject,
    FaultInjected,
    FrameSearched,
    InputRead,
    ItemChanged,
    MotionPlanned,
    TargetSelected,
    ToolCommanded,
)
from executive.events.event import Emit, Event, Observer, TimedEvent, discard_event
from executive.events.run_events import (
    JOURNAL_FORMAT,
    BranchChosen,
    FaultRaised,
    NodeEnded,
    NodeStarted,
    OperatorAsked,
    RequestGiven,
    RunEnded,
    RunHalted,
    RunResumed,
    RunStarted,
)

__all__ = [
    "JOURNAL_FORMAT",
    "BranchChosen",
    "DetectedObject",
    "Emit",
    "Event",
    "FaultInjected",
    "FaultRaised",
    "FrameSearched",
    "InputRead",
    "ItemChanged",
    "MotionPlanned",
    "NodeEnded",
    "NodeStarted",
    "Observer",
    "OperatorAsked",
    "RequestGiven",
    "RunEnded",
    "RunHalted",
    "RunResumed",
    "RunStarted",
    "TargetSelected",
    "TimedEvent",
    "ToolCommanded",
    "discard_event",
]

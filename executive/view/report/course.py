"""What every node of a run did, and when, as its journal tells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Entry = Mapping[str, Any]


@dataclass(frozen=True)
class Span:
    """One time that a node ran.

    Attributes:
        node: Its path.
        began, ended: On the run's clock [s].
        status: How it ended: `SUCCESS`, `FAILURE`, `INVALID`; `RUNNING` where the record ends before it did.
        reason, message: Why it failed.
        item: What a skill was about, or "".
    """

    node: str
    began: float
    ended: float
    status: str
    reason: str = ""
    message: str = ""
    item: str = ""


@dataclass(frozen=True)
class Tally:
    """What became of all the times that one node ran.

    Attributes:
        ran: How often it was started.
        succeeded, failed, halted: How often it ended so.
        status: How it ended last.
        said: Why it failed last: reason and sentence; "" where it never did.
    """

    ran: int
    succeeded: int
    failed: int
    halted: int
    status: str
    said: str

    @property
    def counts(self) -> str:
        """The numbers in a few words: `3 done, 1 failed`."""
        ended = self.succeeded + self.failed + self.halted
        told = (
            (self.succeeded, "done"), (self.failed, "failed"), (self.halted, "halted"),
            (self.ran - ended, "under way"),
        )  # fmt: skip
        return ", ".join(f"{number} {word}" for number, word in told if number)


def spans(entries: Iterable[Entry]) -> list[Span]:
    """Return every time that a node ran, in the order in which they began."""
    begun: dict[str, tuple[int, Entry]] = {}
    done: list[tuple[int, Span]] = []
    now = 0.0

    def end(node: str, last: Entry) -> None:
        order, first = begun.pop(node)
        item = str(last.get("item") or first.get("item") or "")
        why = str(last.get("reason") or ""), str(last.get("message") or "")
        done.append((order, Span(node, first["clock"], last["clock"], last["status"], *why, item)))

    for order, entry in enumerate(entries):
        now = entry["clock"]
        if entry["kind"] != "status":
            continue
        node = entry["node"]
        running = entry["status"] == "RUNNING"
        if running and node in begun:
            # A run that was taken up again begins anew what was under way.
            end(node, {**entry, "status": "INVALID"})
        if running:
            begun[node] = order, entry
        elif node in begun:
            end(node, entry)
    for node in list(begun):
        end(node, {"clock": now, "status": "RUNNING"})
    return [span for _, span in sorted(done, key=lambda pair: pair[0])]


def tallies(course: Sequence[Span]) -> dict[str, Tally]:
    """Return what became of each node that ran, by its path."""
    by_node: dict[str, list[Span]] = {}
    for span in course:
        by_node.setdefault(span.node, []).append(span)
    return {node: _tally(ran) for node, ran in by_node.items()}


def _tally(ran: Sequence[Span]) -> Tally:
    ends = [span.status for span in ran]
    said = [": ".join(filter(None, (span.reason, span.message))) for span in ran if span.status == "FAILURE"]
    return Tally(
        len(ran), ends.count("SUCCESS"), ends.count("FAILURE"), ends.count("INVALID"),
        ends[-1], said[-1] if said else "",
    )  # fmt: skip

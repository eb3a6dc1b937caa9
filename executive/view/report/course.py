"""Activations of every node of a run, with their times, from its journal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Entry = Mapping[str, Any]

_WORDS = {"SUCCESS": "done", "FAILURE": "failed", "INVALID": "halted", "RUNNING": "under way"}


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


def by_node(course: Iterable[Span]) -> dict[str, list[Span]]:
    """Return every time that a node ran, by its path."""
    found: dict[str, list[Span]] = {}
    for span in course:
        found.setdefault(span.node, []).append(span)
    return found


def counts(ran: Iterable[Span]) -> str:
    """Return how often nodes ended in which way, in a few words: `3 done, 1 failed`."""
    ends = Counter(span.status for span in ran)
    return ", ".join(f"{ends[status]} {word}" for status, word in _WORDS.items() if ends[status])


def last_failure(ran: Sequence[Span]) -> str:
    """Return why the last of these failed that did: reason and sentence; "" where none did."""
    failed = next((span for span in reversed(ran) if span.status == "FAILURE"), None)
    return ": ".join(filter(None, (failed.reason, failed.message))) if failed else ""

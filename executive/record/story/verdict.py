"""What ended a run, in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from executive.mission.model import nodes
from executive.record.story.case import Case
from executive.record.story.chain import attempts

MOST = 5
"""Items that a sentence names one by one."""


def verdict(case: Case) -> str:
    """Return what failed, on what, how often it was tried, and why."""
    return _VERDICTS[case.outcome.status](case)


def listed(names: Sequence[str]) -> str:
    """Return names in a sentence, of many only the first."""
    more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return ", ".join(names[:MOST]) + more


def _failure(case: Case) -> str:
    outcome = case.outcome
    if case.lost:
        were = "object was" if len(case.lost) == 1 else "objects were"
        return f"{len(case.lost)} {were} lost: {listed(list(case.lost))}"
    if not case.links:
        return outcome.message
    if case.is_skill:
        reason = outcome.reason.rpartition(".")[2]
        return f"{case.named(outcome.node)} failed ({reason}){_tried(case)}: {outcome.message}"
    return f"{case.links[-1].name}{_tried(case)}: {outcome.message}{_during(case)}"


def _fault(case: Case) -> str:
    return case.outcome.message


def _halt(case: Case) -> str:
    if case.course.asking:
        return f"{case.outcome.message} while the operator was asked"
    return f"{case.outcome.message}{_during(case)}"


def _during(case: Case) -> str:
    running = " and ".join(map(case.named, case.running))
    return f" during {running}" if running else ""


def _tried(case: Case) -> str:
    """Return how often it was tried, as the innermost retry counted; "" for the first time."""
    retry = next((link for link in reversed(case.links) if isinstance(link.node, nodes.RetryNode)), None)
    if retry is None:
        return ""
    attempt, most = attempts(retry)
    if attempt == 1:
        return ""
    return f" on the last of {most} attempts" if attempt == most else f" on attempt {attempt} of {most}"


_VERDICTS: Mapping[str, Callable[[Case], str]] = {"FAILURE": _failure, "FAULT": _fault, "HALTED": _halt}

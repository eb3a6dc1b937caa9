"""End of a run: its status, and the problems found at its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from executive.cell.workcell import Accounts
from executive.errors import ExecutiveError, Fault
from executive.ledger.accounts import is_balanced
from executive.tree.failure import Failure


@dataclass(frozen=True)
class LoopEnd:
    """End of the tick loop; see `RunEnded`.

    Attributes:
        traceback: Traceback of the exception that caused a fault, or "".
    """

    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    traceback: str = ""


HALTED = LoopEnd("HALTED", "halted", "halted by the user")
"""End of a run that a person halted."""


def end_of_tree(failure: Failure | None) -> LoopEnd:
    """Return the end of a run whose tree failed, or succeeded (None), before the check of the items."""
    if failure is None:
        return LoopEnd("SUCCESS")
    return LoopEnd("FAILURE", str(failure), failure.message, failure.path)


def collect_problems(action: Callable[[], None]) -> list[str]:
    """Call one part of the end of a run, and return its exception as text, so that the other parts follow."""
    try:
        action()
    except Exception as error:
        return [str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"]
    return []


def judge_items(accounts: Accounts) -> LoopEnd:
    """Return the end of a run whose tree succeeded; lost or rejected items change its status."""
    items = accounts.summaries()
    lost = [item.item for item in items if item.state == "lost"]
    if lost:
        message = f"{len(lost)} object(s) were lost and not found again: {', '.join(lost)}"
        return LoopEnd("FAILURE", "lost", message)
    rejected = [f"{item.item} ({item.why})" for item in items if item.state == "rejected"]
    if rejected:
        message = f"{len(rejected)} object(s) were not sorted: {', '.join(rejected)}"
        return LoopEnd("INCOMPLETE", "rejected", message)
    return LoopEnd("SUCCESS")


def close_accounts(accounts: Accounts, *, completed: bool) -> None:
    """Let the ledger decide the final state of each item, and check the balance.

    Raises:
        Fault: The number of seen items is not the sum of the placed, rejected, skipped and lost ones.
    """
    accounts.close(completed=completed)
    counts = accounts.count_states()
    if not is_balanced(counts):
        listed = ", ".join(f"{number} {state}" for state, number in counts.items())
        raise Fault(
            f"the books do not balance: {listed}; seen must be what was placed, rejected, skipped and lost"
        )

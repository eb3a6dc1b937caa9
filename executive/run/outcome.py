"""End of a run: end of the tick loop, check of the items, and collection of exception messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from executive.cell.workcell import Accounts
from executive.errors import ExecutiveError, Fault
from executive.ledger.outcomes import is_balanced
from executive.tree.failure import Failure


@dataclass(frozen=True)
class LoopEnd:
    """End of the tick loop of a run.

    Attributes:
        status: Status of the run, before the check of its items.
        reason: Reason of the failure, for instance `Transit.dropped`; "" on success.
        message: Sentence that explains the status, or "".
        node: Path of the node that determined the status, or "".
        traceback: Traceback of the exception that caused a fault, or "".
    """

    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    traceback: str = ""


HALTED = LoopEnd("HALTED", "halted", "halted by the user")
"""End of a tick loop that was halted by a person or by a signal."""


def make_loop_end(failure: Failure | None) -> LoopEnd:
    """Return the end of the tick loop; `failure` is the failure of the tree, or None after its success."""
    return LoopEnd("FAILURE", str(failure), failure.message, failure.path) if failure else LoopEnd("SUCCESS")


def catch_problems(action: Callable[[], None]) -> list[str]:
    """Call `action`; return a list with the message of its exception, or an empty list."""
    try:
        action()
    except Exception as error:
        return [str(error) if isinstance(error, ExecutiveError) else f"{type(error).__name__}: {error}"]
    return []


def check_items(accounts: Accounts) -> LoopEnd:
    """Return the end of a run whose tree succeeded, from the states of its items.

    The status is FAILURE if items were lost, else INCOMPLETE if items were rejected, else SUCCESS.
    """
    items = accounts.list_items()
    if lost := [item.item for item in items if item.state == "lost"]:
        message = f"{len(lost)} object(s) were lost and not found again: {', '.join(lost)}"
        return LoopEnd("FAILURE", "lost", message)
    if rejected := [f"{item.item} ({item.reason})" for item in items if item.state == "rejected"]:
        message = f"{len(rejected)} object(s) were not sorted: {', '.join(rejected)}"
        return LoopEnd("INCOMPLETE", "rejected", message)
    return LoopEnd("SUCCESS")


def finalize_items(accounts: Accounts, has_tree_succeeded: bool) -> None:
    """Let the ledger set the final state of each item, and check the sum of the counts.

    Raises:
        Fault: The number of seen items is not the sum of the placed, rejected, skipped and lost items.
    """
    accounts.set_final_states(completed=has_tree_succeeded)
    counts = accounts.count_states()
    if not is_balanced(counts):
        text = ", ".join(f"{count} {state}" for state, count in counts.items())
        raise Fault(
            f"the item counts are inconsistent: {text}; seen must be placed + rejected + skipped + lost"
        )

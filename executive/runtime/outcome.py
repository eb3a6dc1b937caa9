"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Ending:
    """How the tick loop ended; see `Outcome`.

    Attributes:
        traceback: Of the exception behind a fault, or "".
    """

    status: str
    reason: str = ""
    message: str = ""
    node: str = ""
    traceback: str = ""


HALTED = Ending("HALTED", "halted", "halted by the user")
"""Somebody wanted the run to end."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `FAULT` or `HALTED`.
        reason: What failed, for instance `Transit.dropped`; "" on success.
        message: One sentence with numbers.
        node: Path of the deciding node, or "".
        holds: What the tool holds now that the arm is at rest: an item, `something` that nobody knows, or "".
        ticks: Control steps taken.
        robot_time: Time on the run's clock [s].
    """

    status: str
    reason: str
    message: str
    node: str
    holds: str
    ticks: int
    robot_time: float

"""Exit codes of the command line."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of a command; a command that executes a run returns the code of the status of the run."""

    SUCCESS = 0
    FAILURE = 1  # also if the ledger differs from the true state of the simulator
    INVALID_INPUT = 2
    FAULT = 3
    INCOMPLETE = 4
    HALTED = 130

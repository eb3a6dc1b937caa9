"""Exit codes of the command line."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of a command; members with the name of a run's status are the codes of that status."""

    SUCCESS = 0
    FAILURE = 1  # also if the audit disagrees with the ledger
    INVALID_INPUT = 2
    FAULT = 3
    INCOMPLETE = 4
    HALTED = 130

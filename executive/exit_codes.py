"""Exit codes of the command line."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit code of a command; a run with the status FAILURE, for instance, ends with the code FAILURE."""

    SUCCESS = 0
    FAILURE = 1  # also used if the audit of the simulator disagrees with the ledger
    INVALID_INPUT = 2
    FAULT = 3
    INCOMPLETE = 4
    HALTED = 130

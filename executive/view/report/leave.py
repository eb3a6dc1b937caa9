"""The report that a run leaves beside its record."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from executive.errors import ExecutiveError
from executive.view.report.page import write_report


def leave_report(result: Mapping[str, Any]) -> tuple[str, str]:
    """Write the report of a run that has just ended; return its file, or "" and why there is none.

    Whatever goes wrong with it, the run ended as it did.
    """
    try:
        return str(write_report(Path(result["run"]))), ""
    except ExecutiveError as error:
        return "", f"no report was written: {error}"
    except Exception as error:
        return "", (
            f"no report was written: {type(error).__name__}: {error}; "
            f"`executive --debug report {result.get('run', 'RUN')}` shows where"
        )

"""Whether this Python can run the project."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator

from executive.cli.doctor.finding import Finding

FIRST, LAST = (3, 10), (3, 11)
"""Oldest and newest Python that everything needed has wheels for."""


def python(version: tuple[int, ...] = sys.version_info[:3]) -> Iterator[Finding]:
    """Yield which Python this is."""
    told = f"{'.'.join(map(str, version))} on {platform.system()} {platform.machine()}"
    if FIRST <= version[:2] <= LAST:
        yield Finding("ok", "python", told)
    else:
        yield Finding(
            "problem", "python", f"{told} has no pybullet wheel",
            "use 3.10 or 3.11 (uv takes 3.11 by itself)",
        )  # fmt: skip

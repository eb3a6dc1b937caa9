"""Whether there is one OpenCV only."""

from __future__ import annotations

from collections.abc import Iterator

from executive.cli.doctor.finding import Finding
from executive.cli.doctor.packages import Version
from executive.runtime.versions import installed

OPENCV = (
    "opencv-python",
    "opencv-contrib-python",
    "opencv-python-headless",
    "opencv-contrib-python-headless",
)
"""Packages that bring a `cv2`, each overwriting the others'."""


def opencv(version: Version = installed) -> Iterator[Finding]:
    """Yield which packages bring a `cv2`, unless none does: then one is missing."""
    present = [f"{name} {version(name)}" for name in OPENCV if version(name)]
    if len(present) == 1:
        yield Finding("ok", "opencv", f"{present[0]} alone brings a `cv2`")
    elif present:
        yield Finding(
            "problem", "opencv",
            f"{len(present)} packages bring a `cv2` and overwrite each other ({', '.join(present)})",
            "run `uv sync --reinstall`, which leaves opencv-python-headless alone",
        )  # fmt: skip

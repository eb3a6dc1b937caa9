"""`executive doctor`: say whether this installation can work, and what to do where it cannot."""

from __future__ import annotations

import os
import platform
import re
import sys
from importlib import metadata

import click

OPENCV = (
    "opencv-python",
    "opencv-contrib-python",
    "opencv-python-headless",
    "opencv-contrib-python-headless",
)


@click.command(name="doctor")
@click.pass_context
def command(ctx: click.Context) -> None:
    """Check Python, the packages this project needs, and OpenCV; exit code 1 if something is wrong."""
    from executive.vision.detectors.roboflow.key import VARIABLE

    problems = [*_python(), *_packages(), *_opencv()]
    # Whether, never what: this is printed where others may read it.
    is_set = bool(os.environ.get(VARIABLE))
    click.echo(f"{VARIABLE} is {'set' if is_set else 'not set; models that Roboflow hosts want it'}")
    for problem in problems:
        click.echo(f"problem: {problem}")
    click.echo("all is well" if not problems else f"{len(problems)} problem(s)")
    ctx.exit(1 if problems else 0)


def _python() -> list[str]:
    version = sys.version_info
    click.echo(f"python {platform.python_version()} on {platform.system()} {platform.machine()}")
    if (3, 10) <= version[:2] <= (3, 11):
        return []
    return [
        f"Python {version[0]}.{version[1]} has no pybullet wheel; use 3.10 or 3.11 (uv takes 3.11 by itself)"
    ]


def _packages() -> list[str]:
    """Compare what is installed with what this project asks for by name."""
    try:
        needed = metadata.requires("executive") or []
    except metadata.PackageNotFoundError:
        return ["executive itself is not installed; run `uv sync` in its folder"]
    problems = []
    for requirement in needed:
        if "extra ==" in requirement:
            continue
        name = re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]
        try:
            click.echo(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            problems.append(f"{name} is missing; run `uv sync`")
    return problems


def _opencv() -> list[str]:
    """Find OpenCV distributions that overwrite each other's `cv2`."""
    present = []
    for name in OPENCV:
        try:
            present.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            continue
    if len(present) <= 1:
        return []
    return [
        f"{len(present)} packages bring a `cv2` and overwrite each other ({', '.join(present)}); "
        "run `uv sync --reinstall`, which leaves opencv-python-headless alone"
    ]

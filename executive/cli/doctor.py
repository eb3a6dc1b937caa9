"""`executive doctor`: checks of this installation, with a fix for each problem.

Each check imports its packages itself, so that a missing package affects only this check.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from typing import NamedTuple

import click

from executive.cli.options import json_option
from executive.cli.streams import keep_stdout_clean, print_result
from executive.errors import ExitCode, InputError


class CheckResult(NamedTuple):
    """Result of one check.

    Attributes:
        status: `ok`, `note` (an optional feature cannot be used), or `problem` (missions cannot be run).
        subject: Name of the checked part of the installation.
        message: State of the checked part, and the action that solves a problem.
    """

    status: str
    subject: str
    message: str


@click.command(name="doctor")
@json_option
def doctor_command(as_json: bool) -> ExitCode:
    """Check this installation.

    Checks Python, display, key of Roboflow, packages, plugins and simulator. Exit code 1 if a problem
    prevents runs. A note concerns an optional feature.
    """
    with keep_stdout_clean():
        results = list(run_checks())
    lines = [f"{status:7}  {subject:9}  {message}" for status, subject, message in results]
    print_result([result._asdict() for result in results], "\n".join(lines), as_json=as_json)
    return ExitCode.FAILURE if any(result.status == "problem" for result in results) else ExitCode.SUCCESS


def run_checks() -> Iterator[CheckResult]:
    """Run every check and yield its results; a check whose packages are missing yields a problem."""
    for check in (check_system, check_packages, check_plugins, check_simulator):
        try:
            yield from check()
        except (ImportError, InputError) as error:
            yield CheckResult("problem", check.__name__.removeprefix("check_"), str(error))


def check_system() -> Iterator[CheckResult]:
    """State the version of Python, and check the environment variables; the API key is not shown."""
    from executive.perception.detectors.roboflow.inference_process import KEY_VARIABLE

    yield CheckResult("ok", "python", f"{platform.python_version()} on {platform.platform()}")
    for variable, purpose in (("DISPLAY", "--gui"), (KEY_VARIABLE, "models that Roboflow hosts")):
        if not os.environ.get(variable):
            yield CheckResult("note", "variable", f"{variable} is not set; it is only for {purpose}")


def check_packages() -> Iterator[CheckResult]:
    """Check the required packages, the packages that provide `cv2`, and the extras."""
    from importlib.metadata import packages_distributions

    from executive.plugins import DISTRIBUTION, find_version, list_requirements

    opencv_packages = sorted(set(packages_distributions().get("cv2", ())))
    if len(opencv_packages) > 1:
        fix = "uninstall them, then install opencv-python-headless"
        yield CheckResult("problem", "opencv", f"{' and '.join(opencv_packages)} overwrite each other; {fix}")
    for extra in ("", "view", "cluster", "train"):
        names = list_requirements(extra) or (DISTRIBUTION,)
        if missing := ", ".join(name for name in names if not find_version(name)):
            # The guides install the extra `view`.
            message = f"not installed: {missing}; run `uv sync --extra {extra or 'view'}`"
            yield CheckResult("note" if extra else "problem", extra or "packages", message)


def check_plugins() -> Iterator[CheckResult]:
    """Load all installed skills, kinds of cells, kinds of detectors and solvers of arms."""
    from executive.behaviours import load_skills
    from executive.cell.devices import DRIVER_GROUP
    from executive.cell.tools import load_tool_models
    from executive.motion.joints import IK_SOLVER_GROUP
    from executive.perception.detectors.detector_registry import find_detector_kinds
    from executive.plugins import list_entries

    drivers = list_entries(DRIVER_GROUP, "driver")
    solvers = list_entries(IK_SOLVER_GROUP, "solver")
    for entry in (*drivers.values(), *find_detector_kinds().values(), *solvers.values()):
        entry.load()
    load_tool_models()
    yield CheckResult("ok", "plugins", f"{len(load_skills())} skills")


def check_simulator() -> Iterator[CheckResult]:
    """Load a simulated cell."""
    from executive.drivers.sim.world import World
    from executive.mission.cell_file import load_cell
    from executive.text.yaml_files import get_shipped_folder

    World(load_cell(get_shipped_folder() / "cells" / "overhead.yaml"))
    yield CheckResult("ok", "simulator", "loads the cell overhead")

"""`executive doctor`: checks of this installation, with a fix for each problem.

Each check imports its packages itself, so that a missing package affects only this check.
"""

from __future__ import annotations

import os
import platform
import statistics
import sys
import timeit
from collections.abc import Iterator
from typing import NamedTuple

import click

from executive.cli.options import json_option
from executive.cli.streams import keep_stdout_clean, print_json
from executive.errors import InputError
from executive.exit_codes import ExitCode

MIN_PYTHON, MAX_PYTHON = (3, 10), (3, 11)
"""Oldest and newest Python version for which every required package has wheels."""
EXTRAS = {
    "view": "watch a run in the browser",
    "cluster": "run a sweep on several computers",
    "train": "train a detector of your own",
}
"""Purpose of each extra of this project (an optional group of packages), by the name of the extra."""
FRAME_COUNT = 5
"""Number of timed frames; the slower first frame of a process is not timed."""
FRAME_SIZE = (640, 480)
"""Width and height of a frame [pixel]."""
SERVER_TIMEOUT = 3.0
"""Time after which a server counts as unreachable [s]."""


class CheckResult(NamedTuple):
    """Result of one check.

    Attributes:
        status: `ok`, `note` (an optional feature cannot be used), or `problem` (missions cannot be run).
        subject: Name of the checked part of the installation.
        message: State of the checked part.
        fix: Command or other action that solves the problem, or "".
    """

    status: str
    subject: str
    message: str
    fix: str = ""


@click.command(name="doctor")
@json_option
def command(as_json: bool) -> ExitCode:
    """Check this installation.

    Checks Python, packages, plugins, renderer, display and the server of Roboflow. Exit code 1 if a
    problem prevents runs. A note concerns an optional feature that cannot be used.
    """
    with keep_stdout_clean():
        results = list(run_checks())
    problem_count = sum(result.status == "problem" for result in results)
    if as_json:
        print_json([result._asdict() for result in results])
    else:
        width = max(len(result.subject) for result in results)
        for status, subject, message, fix in results:
            click.echo(f"{status:7}  {subject:{width}}  {'; '.join(filter(None, (message, fix)))}")
        click.echo(f"{problem_count or 'no'} problem{'' if problem_count == 1 else 's'}")
    return ExitCode.FAILURE if problem_count else ExitCode.SUCCESS


def run_checks() -> Iterator[CheckResult]:
    """Run every check and yield its results; a check whose packages are missing yields a problem."""
    for check in (check_system, check_packages, check_plugins, check_renderer, check_roboflow):
        subject = check.__name__.removeprefix("check_")
        try:
            yield from check()
        except InputError as error:
            yield CheckResult("problem", subject, str(error))
        except ImportError as error:
            yield CheckResult("problem", subject, f"cannot be checked: {error}", "run `uv sync`")


def check_system(version: tuple[int, ...] = sys.version_info[:3]) -> Iterator[CheckResult]:
    """Check the version of Python, and whether there is a display for --gui."""
    python = f"{'.'.join(map(str, version))} on {platform.system()} {platform.machine()}"
    is_supported = MIN_PYTHON <= version[:2] <= MAX_PYTHON
    fix = "use Python 3.10 or 3.11 (uv installs 3.11)"
    yield _make_result(is_supported, "python", python, "problem", f"{python} has no pybullet wheel", fix)
    display = os.environ.get("DISPLAY")
    message = f"DISPLAY is {display}; --gui opens the window of the simulator there"
    fix = "run without --gui; the terminal, --view and the report also show a run"
    yield _make_result(bool(display), "display", message, "note", "DISPLAY is not set", fix)


def check_packages() -> Iterator[CheckResult]:
    """Check the required packages, the packages that provide `cv2`, the extras, and the video encoder."""
    from importlib.metadata import packages_distributions

    from executive.run.versions import DISTRIBUTION, find_installer, find_version, list_requirements

    requirements = list_requirements()
    missing_packages = [name for name in (DISTRIBUTION, *requirements) if not find_version(name)]
    for name in missing_packages:
        yield CheckResult("problem", "packages", f"{name} is missing", "run `uv sync`")
    if not missing_packages:
        message = f"{DISTRIBUTION} {find_version(DISTRIBUTION)} and its {len(requirements)} required packages"
        yield CheckResult("ok", "packages", message)
    if packages := sorted(set(packages_distributions().get("cv2", ()))):
        opencv = ", ".join(f"{name} {find_version(name)}" for name in packages)
        fix = "run `uv sync --reinstall`, which removes all but opencv-python-headless"
        if find_installer(DISTRIBUTION) == "pip":
            fix = f"run `pip uninstall -y {' '.join(packages)}`, then `pip install opencv-python-headless`"
        ok_message = f"{opencv} is the only package that provides `cv2`"
        message = f"{len(packages)} packages provide `cv2` and overwrite each other ({opencv})"
        yield _make_result(len(packages) == 1, "opencv", ok_message, "problem", message, fix)
    for extra, purpose in EXTRAS.items():
        version_by_package = {name: find_version(name) for name in list_requirements(extra)}
        missing = ", ".join(name for name, version in version_by_package.items() if not version)
        versions = ", ".join(f"{name} {version}" for name, version in version_by_package.items())
        fix = f"to {purpose}, run `uv sync --extra {extra}`"
        yield _make_result(not missing, extra, versions, "note", f"not installed: {missing}", fix)
    if av_version := find_version("av"):
        yield CheckResult("ok", "film", f"av {av_version} encodes videos; the program ffmpeg is not needed")


def check_plugins() -> Iterator[CheckResult]:
    """Load all installed skills, kinds of cells and kinds of detectors."""
    from executive.perception.detectors import detector_registry
    from executive.plugins import CELL_KIND_GROUP, find_project, list_entries, load_skills

    skills, project = load_skills(), find_project()
    kinds, detectors = list_entries(CELL_KIND_GROUP, "kind of cell"), detector_registry.find_detector_kinds()
    for entry in (*kinds.values(), *detectors.values()):
        entry.load()
    message = f"{len(skills)} skills, {len(kinds)} kinds of cells, {len(detectors)} kinds of detectors"
    origin = f", including those of {project.file}" if project else ""
    yield CheckResult("ok", "plugins", f"{message}{origin}")


def check_renderer() -> Iterator[CheckResult]:
    """Measure the median time in which TinyRenderer renders a frame of the cell overhead."""
    from executive.cells.sim.camera import get_camera_pose
    from executive.cells.sim.renderer import CELL_LIGHT, render
    from executive.cells.sim.world import World
    from executive.cli.cells import load_cells
    from executive.perception.camera_model import compute_calibration

    config = load_cells(("overhead",))["overhead"]
    camera = next(iter(config.cameras.values()))
    world = World(config)
    matrix, _ = compute_calibration(camera)
    arguments = (world, matrix, get_camera_pose(world, camera), (0, 0, *FRAME_SIZE), CELL_LIGHT)
    times = timeit.repeat(lambda: render(*arguments), number=1, repeat=1 + FRAME_COUNT)
    duration = statistics.median(times[1:])
    message = f"TinyRenderer, on the CPU: {1000 * duration:.0f} ms for 640x480 pixels of the cell overhead"
    yield CheckResult("ok", "renderer", message)


def check_roboflow() -> Iterator[CheckResult]:
    """Check whether an API key is set, without showing the key, and whether Roboflow's server answers."""
    from executive.perception.detectors.roboflow.detector import HOSTED_URL
    from executive.perception.detectors.roboflow.inference_process import KEY_VARIABLE, ApiKey

    fix, is_set = "set it to use models that Roboflow hosts", ApiKey(os.environ).is_set
    yield _make_result(is_set, "key", f"{KEY_VARIABLE} is set", "note", f"{KEY_VARIABLE} is not set", fix)
    message = f"{HOSTED_URL} does not answer within {SERVER_TIMEOUT:.0f} s"
    fix = "check the network; only models that Roboflow hosts need it"
    yield _make_result(is_reachable(HOSTED_URL), "roboflow", f"{HOSTED_URL} answers", "note", message, fix)


def _make_result(
    is_ok: bool, subject: str, ok_message: str, failure_status: str, failure_message: str, fix: str
) -> CheckResult:
    """Return a result with the status `ok`, or with the failure status, the failure message and the fix."""
    if is_ok:
        return CheckResult("ok", subject, ok_message)
    return CheckResult(failure_status, subject, failure_message, fix)


def is_reachable(address: str, timeout: float = SERVER_TIMEOUT) -> bool:
    """Return True if a server answers within `timeout` [s]; an HTTP error is also an answer."""
    import urllib.error
    import urllib.request

    try:
        urllib.request.urlopen(address, timeout=timeout).close()
    except OSError as error:
        return isinstance(error, urllib.error.HTTPError)
    return True

"""Commands for the first steps: `doctor` checks the installation, and `init` creates a project.

Each check imports its packages itself, so that a missing package affects only this check.
"""

from __future__ import annotations

import keyword
import os
import platform
import re
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from executive.cli import shared
from executive.errors import ExitCode, InputError, explain_os_errors

if TYPE_CHECKING:
    from executive.cell.arm_config import ArmFile
    from executive.cell.config import CellConfig

TEMPLATE = Path(__file__).parent / "template"
"""Folder with the template of every file of a project."""
MISSION_TEMPLATE = TEMPLATE.with_name("template_from")
"""Folder with the template of every file of a project with a shipped mission."""
SUFFIX = ".jinja"
"""Suffix of every template file, so that tools do not treat the templates as code of this project."""
PACKAGE = "package"
"""Name of the folder in `TEMPLATE` that is renamed to the name of the package."""
MISSION = "mission.yaml"
"""Name of the file in `MISSION_TEMPLATE` that is renamed to the name of the mission."""
FOLDERS = ("cells", "runs", "tests")
"""Folders beside the package in a project; a package must not have one of these names."""

_NAME_PATTERN = re.compile(r"[a-z]([a-z0-9_]*[a-z0-9])?")
"""Pattern of package names that are also valid names of distributions."""
_NAME_ADVICE = "give another name with --name"


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
@shared.json_option
def doctor_command(as_json: bool) -> ExitCode:
    """Check this installation.

    Checks Python, display, key of Roboflow, packages, plugins and simulator. Exit code 1 if a problem
    prevents runs. A note concerns an optional feature.
    """
    with shared.keep_stdout_clean():
        results = list(run_checks())
    lines = [f"{status:7}  {subject:9}  {message}" for status, subject, message in results]
    shared.print_result([result._asdict() for result in results], "\n".join(lines), as_json=as_json)
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
    for extra in ("", "arms", "view", "cluster", "train"):
        names = list_requirements(extra) or (DISTRIBUTION,)
        if missing := ", ".join(name for name in names if not find_version(name)):
            # The guides install the extra `view`.
            message = f"not installed: {missing}; run `uv sync --extra {extra or 'view'}`"
            yield CheckResult("note" if extra else "problem", extra or "packages", message)


def check_plugins() -> Iterator[CheckResult]:
    """Load all installed skills, drivers, kinds of detectors and solvers of arms."""
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
    # The class of each skill is imported at the access to its name.
    yield CheckResult("ok", "plugins", f"{len(dict(load_skills()))} skills")


def check_simulator() -> Iterator[CheckResult]:
    """Load a simulated cell."""
    from executive.drivers.sim.world import World
    from executive.mission.cell_file import load_cell
    from executive.text.files import get_shipped_folder

    World(load_cell(get_shipped_folder() / "cells" / "overhead.yaml"))
    yield CheckResult("ok", "simulator", "loads the cell overhead")


LAYOUTS: tuple[Mapping[str, Any], ...] = (
    {
        "table": {"x": [0.42, 0.64], "y": [-0.22, 0.22], "objects": [4, 5]},
        "bin_x": 0.24,
        "bin_y": 0.48,
        "bin_size": [0.24, 0.30, 0.06],
    },
    {
        "table": {"x": [0.42, 0.62], "y": [-0.13, 0.13], "objects": [3, 4]},
        "bin_x": 0.30,
        "bin_y": 0.31,
        "bin_size": [0.20, 0.26, 0.06],
    },
)
"""Workspace and bins of a new project; the second layout is for small arms."""


def write_project(
    folder: Path, package: str, layout: Mapping[str, Any] = LAYOUTS[0], arm: Mapping[str, str] | None = None,
    source: Path = TEMPLATE,
) -> list[str]:  # fmt: skip
    """Create a project in an empty or new folder; return the file paths, relative to the folder.

    Args:
        folder: The folder.
        package: Name of the Python package.
        layout: Workspace and bins of the cell, or other values of the templates.
        arm: Name and sections of the arm in the cell file; None: the arm of the base.
        source: Folder of the templates.

    Raises:
        InputError: The folder is not empty, is a file, or cannot be written.
    """
    # This import takes 0.06 s, which `executive --help` must not take.
    from jinja2 import Environment, StrictUndefined

    advice = "name a folder that is empty or does not exist"
    if folder.is_file():
        raise InputError(f'"{folder}" is a file; {advice}')
    entries = sorted(os.listdir(folder)) if folder.exists() else []
    if entries:
        more_text = f" and {len(entries) - 1} more" if entries[1:] else ""
        raise InputError(f'the folder "{folder}" is not empty: it contains {entries[0]}{more_text}; {advice}')
    # The files are code and YAML, in which HTML escapes would be wrong.
    templates = Environment(autoescape=False, undefined=StrictUndefined, keep_trailing_newline=True)
    new_names = {PACKAGE: package, MISSION: f"{layout.get('mission')}.yaml"}
    names = []
    for template in sorted(source.rglob(f"*{SUFFIX}")):
        parts = template.relative_to(source).with_suffix("").parts
        name = PurePosixPath(*(new_names.get(part, part) for part in parts))
        text = templates.from_string(template.read_text(encoding="utf-8")).render(
            name=package, arm=arm, **layout
        )
        path = folder / name
        with explain_os_errors(InputError, f"{path} cannot be written", "name a writable folder"):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        names.append(str(name))
    return names


def _write_project_from(folder: Path, package: str, name: str) -> list[str]:
    """Create a project with a shipped mission, and workspace and bins of its cell; return the file paths.

    Raises:
        InputError: There is no such mission, or the project cannot be written.
    """
    from executive.text.files import get_shipped_folder, list_shipped_missions
    from executive.text.findings import suggest_choice

    if name not in (names := list_shipped_missions()):
        raise InputError(f'there is no shipped mission "{name}". {suggest_choice(name, names, "There are")}')

    def read(file: Path) -> tuple[str, dict[str, str]]:
        """Return the text of a shipped file, and the text of each of its sections by key."""
        text = file.read_text(encoding="utf-8")
        return text, {part[1]: part[0].strip() for part in re.finditer(r"(?m)^(\w+):.*\n(?:[ #].+\n)*", text)}

    folder_of_cells = get_shipped_folder() / "cells"
    text, head = read(get_shipped_folder() / f"{name}.yaml")
    cell = base = Path(head["cell"].partition(": ")[2]).stem
    sections: dict[str, str] = {}
    while base:
        _, found = read(folder_of_cells / f"{base}.yaml")
        sections = found | sections
        base = Path(found.get("base", "").partition(": ")[2]).stem
    values = {
        "mission": name, "description": head["description"].removeprefix("description: "), "cell": cell,
        "sections": "\n\n".join(sections[key] for key in ("table", "bins")),
        "mission_text": text.strip().replace(head["cell"], "cell: cells/table.yaml"),
    }  # fmt: skip
    return write_project(folder, package, values, source=MISSION_TEMPLATE)


def _write_project_with_arm(folder: Path, package: str, urdf: str, flange: str) -> list[str]:
    """Create a project whose cell has the arm of a URDF; return the file paths, relative to the folder.

    Raises:
        InputError: The executive cannot move the arm, or the project cannot be written.
    """
    import yaml

    from executive.arms.urdf import find_model
    from executive.cli.arm import dump_yaml, read_arm
    from executive.physics.model_files import list_arm_files
    from executive.plugins import PACKAGE_PREFIX

    arm, text = read_arm(urdf, flange)
    layout, config = _choose_layout(arm)
    sections: dict[str, Any] = {
        "arm": {
            "file": f"arms/{arm.arm}.yaml",
            "base": config.arm.base.model_dump(mode="json"),
            "poses_deg": {name: [*pose] for name, pose in config.arm.poses_deg.items()},
        },
        "motion": {"descent_speed": config.motion.descent_speed},
    }
    model_files = list_arm_files(arm)
    files = write_project(folder, package, layout, {"name": arm.arm, "sections": dump_yaml(sections)})
    arms = folder / "cells" / "arms"
    with explain_os_errors(InputError, f"{arms} cannot be written", "name a writable folder"):
        arms.mkdir(parents=True)
        if not urdf.startswith(PACKAGE_PREFIX):
            model = find_model(arm.urdf)
            root = Path(os.path.commonpath([file.parent for file in model_files]))
            for file in model_files:
                copy = arms / root.name / file.relative_to(root)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, copy)
            files.append(f"cells/arms/{root.name} ({len(model_files)} file(s))")
            content = yaml.safe_load(text)
            text = dump_yaml(
                {**content, "urdf": str(PurePosixPath(root.name, *model.relative_to(root).parts))}
            )
        (arms / f"{arm.arm}.yaml").write_text(text, encoding="utf-8")
    return [*files, f"cells/arms/{arm.arm}.yaml"]


def _choose_layout(arm: ArmFile) -> tuple[Mapping[str, Any], CellConfig]:
    """Return the first layout in which an arm can work, and the cell with the arm there.

    Raises:
        InputError: The arm does not reach a place of each layout, or the check of the cell finds an error.
    """
    from executive.cell.arm_config import BaseConfig
    from executive.cell.config import BinConfig, TableConfig
    from executive.mission.cell_file import load_cell
    from executive.motion.joints import build_planning_kinematics
    from executive.motion.reach import find_fitting_speed, measure_reach
    from executive.station.arm_report import find_blocked_motions, place_arm, report_arm
    from executive.station.check import load_checker
    from executive.text.files import find_cell

    path = find_cell("overhead")
    cell = load_cell(path)
    for layout in LAYOUTS:
        y = layout["bin_y"]
        bins = {
            name: BinConfig(position=(layout["bin_x"], sign * y, 0.0), size=layout["bin_size"])
            for name, sign in {"block_bin": -1, "duck_bin": 1}.items()
        }
        config = cell.model_copy(update={"table": TableConfig(**layout["table"]), "bins": bins})
        config = place_arm(config, arm, BaseConfig())
        reach = measure_reach(config, build_planning_kinematics(config))
        report = report_arm(place_arm(config, arm, reach.best_base))
        missing = [f"{1 - value:.0%} of {name}" for name, value in reach.best_fractions.items() if value < 1]
        problems = [f"it does not reach {', '.join(missing)}"] if missing else [*report.problems]
        if not problems:
            # The cell also looks from `aside`.
            poses_deg = {"aside": report.poses_deg["home"], **report.poses_deg}
            arm_config = report.config.arm.model_copy(update={"poses_deg": poses_deg})
            config = report.config.model_copy(update={"arm": arm_config})
            motion = config.motion.model_copy(update={"descent_speed": find_fitting_speed(config)})
            config = config.model_copy(update={"motion": motion})
            problems = [message for _, message in load_checker(config.kind).check(config, path.parent)]
            problems = problems or [*find_blocked_motions(config)]
        if not problems:
            return layout, config
    advice = "start with `executive init` without --urdf, and change table, bins and arm in its cell"
    raise InputError(f"the arm {arm.arm} cannot work in the cell of a new project: {problems[0]}; {advice}")


def make_package_name(folder: Path) -> str:
    """Return a package name made from the name of a folder: `blue_table` for `Blue-Table`.

    Raises:
        InputError: The name is invalid or in use.
    """
    folder_name = folder.resolve().name
    return check_package_name(re.sub(r"[-. ]", "_", folder_name).lower(), f'the folder "{folder_name}"')


def check_package_name(name: str, source: str) -> str:
    """Return a package name if it is valid and not in use.

    Args:
        name: Name of the package.
        source: Origin of the name, for the error message.

    Raises:
        InputError: The name is invalid or in use.
    """
    if _NAME_PATTERN.fullmatch(name) is None:
        rule = 'starts with a letter, continues with letters, digits and "_", and does not end with "_"'
        raise InputError(f"{source} is not a valid package name: a package name {rule}; {_NAME_ADVICE}")
    if conflict := _find_conflict(name):
        raise InputError(f'a package cannot be called "{name}": {conflict}; {_NAME_ADVICE}')
    return name


def _find_conflict(name: str) -> str:
    """Return the reason why a name cannot be used for a package, or ""."""
    if keyword.iskeyword(name):
        return "it is a Python keyword"
    if name in FOLDERS:
        return "the project has another folder of this name"
    spec = find_spec(name)
    # A folder without `__init__.py`, which may be the folder of the new project, has no origin.
    if spec is not None and spec.origin is not None:
        return f"a module of this name is already installed: {spec.origin}"
    return ""


@click.command(name="init")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--name", help="Name of the Python package; by default derived from the name of DIR.")
@click.option("--urdf", default="", help="URDF of the arm of the project; by default, the arm is an iiwa.")
@click.option("--flange", default="", help="Link of the URDF at the flange; by default, one is proposed.")
@click.option(
    "--from", "mission", default="", help="Shipped mission that the project contains, to change it."
)
def init_command(folder: Path, name: str | None, urdf: str, flange: str, mission: str) -> None:
    """Create a project with a mission, a cell and a skill.

    The mission can be run at once, and the skill has tests. The folder DIR must be empty or must not exist.
    The project need not be installed: commands that are run in DIR find its skills. With --urdf, the project
    contains a copy of the model, an arm file, and a cell with this arm. With --from, the project contains a
    shipped mission, and a cell with its workspace and bins.
    """
    package = make_package_name(folder) if name is None else check_package_name(name, f'--name "{name}"')
    if flange and not urdf:
        raise InputError("--flange names a link of a URDF; name the URDF with --urdf")
    if urdf and mission:
        raise InputError("--urdf and --from exclude each other; omit one of them")
    if mission:
        files = _write_project_from(folder, package, mission)
    elif urdf:
        with shared.keep_stdout_clean():
            files = _write_project_with_arm(folder, package, urdf, flange)
    else:
        files = write_project(folder, package)
    click.echo(f"{folder}: {', '.join(files)}")
    # `uv run executive init` activates the virtual environment only for this command.
    click.echo(f"Type, after `. {shlex.quote(str(Path(sys.prefix) / 'bin' / 'activate'))}`:")
    change_folder = "" if folder.resolve() == Path.cwd() else f"cd {shlex.quote(str(folder))} && "
    mission_file = next(file for file in files if file.endswith(".yaml") and "/" not in file)
    click.echo(f"  {change_folder}executive run {mission_file}")
    click.echo("  pytest")

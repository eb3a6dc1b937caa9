"""Run directory: names of its files, creation, atomic writing, search, and the recorded mission."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated

import yaml
from pydantic import ConfigDict, FailFast, TypeAdapter, ValidationError

from executive.behaviours import Skills
from executive.cell.arm_config import DEFAULT_ARM_FILE
from executive.cell.config import CellConfig
from executive.cell.devices import find_driver_options
from executive.errors import InputError, explain_os_errors
from executive.events import JOURNAL_FORMAT, RunStarted
from executive.mission.cell_file import CellFile
from executive.mission.load import LoadedMission, load_mission
from executive.mission.outline import OutlineNode
from executive.text.files import MAX_RECORD_SIZE, get_shipped_folder, read_file, read_source
from executive.text.findings import Source
from executive.text.yaml_files import load_yaml

FOLDER_ADVICE = "name another folder with --runs DIR"
"""Advice if a run directory cannot be made or written."""
LATEST_LINK = "latest"
"""Name of the link to the last run directory."""
_NODES_ADAPTER = TypeAdapter(
    Annotated[list[OutlineNode], FailFast()], config=ConfigDict(ser_json_inf_nan="strings")
)
"""Encoder and decoder of `tree.json`."""


class RunDirectory:
    """Directory of one run.

    Attributes:
        path: `RUNS/<YYYY-MM-DD>/<HH-MM-SS>_<mission>_s<seed>`.
        journal: File with the recorded events, one JSON object per line.
        world_log: File from which a simulated world can be rebuilt at any control step.
        tree: File with the outline of the behaviour tree.
        report: HTML page that explains the run.
        result: File with the output of `executive run --json`.
        pictures: Folder with pictures of selections and failures.
        libraries: Folder with the libraries of the mission, in which a library may have any name.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tree = path / "tree.json"
        self.report = path / "report.html"
        self.libraries = path / "libraries"
        # A skill may change the working directory while these files are written.
        folder = path.absolute()
        self.journal = folder / "journal.jsonl"
        self.world_log = folder / "world.log"
        self.result = folder / "result.json"
        self.pictures = folder / "frames"

    def save_inputs(self, texts: Mapping[str, str], libraries: Mapping[str, str]) -> None:
        """Write and sync the inputs of the run, and let the link `runs/latest` point to this directory.

        Args:
            texts: Text of each input file, by the name of the file.
            libraries: Text of each library, by the path of the library relative to the mission.

        Raises:
            InputError: A file cannot be written; each existing file is complete.
        """
        with explain_os_errors(InputError, f'cannot write to the run directory "{self.path}"', FOLDER_ADVICE):
            paths = {self.libraries / name: text for name, text in libraries.items()}
            paths |= {self.path / name: text for name, text in texts.items()}
            for path, text in paths.items():
                path.parent.mkdir(parents=True, exist_ok=True)
                write_atomically(path, text)
        runs = self.path.parents[1]
        link = runs / LATEST_LINK
        temporary_link = runs / f".latest-{os.getpid()}"
        # An error is ignored: a run needs no link, and some file systems do not support links. But the link
        # to an earlier run must not remain.
        try:
            temporary_link.unlink(missing_ok=True)
            temporary_link.symlink_to(self.path.relative_to(runs), target_is_directory=True)
            temporary_link.replace(link)
        except OSError:
            for path in (temporary_link, link):
                with contextlib.suppress(OSError):
                    path.unlink()


def make_dated_folder(runs: Path, name: str, start_time: datetime) -> Path:
    """Make and return the folder `runs/<YYYY-MM-DD>/<HH-MM-SS>_<name>`.

    If the folder exists already, the new folder gets the suffix `-2`, `-3`, ....

    Raises:
        InputError: The folder cannot be made.
    """
    day = runs / start_time.strftime("%Y-%m-%d")
    with explain_os_errors(InputError, f'cannot make a run directory below "{runs}"', FOLDER_ADVICE):
        day.mkdir(parents=True, exist_ok=True)
        return make_unique_folder(day, f"{start_time.strftime('%H-%M-%S')}_{name}")


def find_run(name: str, runs: Path) -> Path:
    """Return the run directory at the path `name`, or at the path `name` below `runs`.

    The name `latest` is a link to the last run directory below `runs`.

    Raises:
        InputError: There is no such run directory.
    """
    for path in (Path(name), runs / name):
        if name == LATEST_LINK and not path.is_symlink():
            continue
        # Path.is_file raises an error for a name that is too long.
        if os.path.isfile(path / "journal.jsonl"):
            return path.resolve()
    run_paths = sorted((path.parent for path in runs.glob("*/*/journal.jsonl")), reverse=True)
    hint = f"the last runs there: {', '.join(str(path.relative_to(runs)) for path in run_paths[:3])}"
    if not run_paths:
        hint = "it contains no run at all; name the folder of the runs with --runs DIR"
    problem = f'"{name}" is no run directory, and "{runs}" contains no run directory of this name'
    raise InputError(f"{problem}; {hint}")


def make_unique_folder(day: Path, name: str) -> Path:
    """Make and return the folder `day/name`, or the first of `day/name-2`, `-3`, ... that does not exist."""
    number = 1
    while True:
        path = day / (name if number == 1 else f"{name}-{number}")
        try:
            path.mkdir()
            return path
        except FileExistsError:
            number += 1


@contextlib.contextmanager
def replace_atomically(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file that replaces `path` after the `with` block.

    After an exception in the block, the temporary file is removed.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    temporary_path = path.with_name(f".{path.name}.part")
    try:
        temporary_path.touch()
        yield temporary_path
        temporary_path.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary_path.unlink()
        raise


def write_atomically(path: Path, text: str) -> None:
    """Replace the content of the file `path` by `text`, and sync the file to the disk.

    Raises:
        OSError: The file cannot be written; `path` is unchanged.
    """
    with replace_atomically(path) as temporary_path, temporary_path.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def read_mission_of_run(
    path: Path, start: RunStarted, skills: Skills, mission: Path | None = None
) -> LoadedMission:
    """Return the mission of a run directory, with the params and the cell of the run.

    Args:
        path: The run directory.
        start: Event of the start of the run.
        skills: Installed skills by name.
        mission: Mission file that replaces the recorded mission, or None.

    Raises:
        MissionError: The mission has errors, for instance because installed skills have changed.
        InputError: A file in the directory cannot be read, or an earlier version recorded the run.
    """
    if start.format != JOURNAL_FORMAT:
        limits = f"its journal has format {start.format} instead of {JOURNAL_FORMAT}"
        advice = "it can be reported, but neither replayed nor resumed; run the mission again"
        raise InputError(f'an earlier version recorded the run in "{path}", and {limits}; {advice}')
    # The recorded cell file already contains the overrides of the cell.
    overrides = {key: text for key, text in start.overrides.items() if not key.startswith("cell.")}
    cell_path = Path(start.base) / "cell.yaml"
    recorded_cell = CellFile(cell_path, read_cell(path), Source(str(cell_path), ""))
    libraries = RunDirectory(path).libraries
    # Earlier versions stored the libraries beside the mission.
    library_folder = libraries if mission is None and libraries.is_dir() else None
    mission = mission or path / "mission.yaml"
    return load_mission(
        mission, skills, overrides, replacing_cell=recorded_cell, library_folder=library_folder
    )


def read_cell(path: Path) -> CellConfig:
    """Return the content of the cell file in the run directory `path`.

    Raises:
        InputError: The cell file cannot be read.
    """
    try:
        content = load_yaml(read_source(path / "cell.yaml"))
        # Earlier records contain only model, limits and poses of their arm, which was always the default arm,
        # or a key that no longer exists.
        is_old = "flange" not in content["arm"]
        default_arm = load_yaml(read_source(get_shipped_folder() / DEFAULT_ARM_FILE)) if is_old else {}
        arm = {key: value for key, value in {**default_arm, **content["arm"]}.items() if key != "simulation"}
        return CellConfig(**{**content, "arm": arm})
    except ValidationError as error:
        texts = (each["msg"].removeprefix("Value error, ") for each in error.errors())
        keys = (".".join(map(str, each["loc"])) for each in error.errors())
        problems = "; ".join(map(": ".join, zip(keys, texts, strict=True)))
        advice = "install the packages that the run used"
        raise InputError(
            f'the cell file in the run directory "{path}" is invalid: {problems}; {advice}'
        ) from error
    except (ValueError, TypeError, KeyError, yaml.YAMLError) as error:
        raise InputError(f'cannot read the cell file in the run directory "{path}": {error}') from error


def find_recorded_options(path: Path) -> dict[str, str]:
    """Return the options of the driver whose files are in the run directory `path`, by name.

    There are none if the cell file cannot be read, or its driver is not installed.
    """
    options: dict[str, str] = {}
    with contextlib.suppress(InputError):
        for name, kind in find_driver_options(read_cell(path).kind).items():
            if kind == "file" and (file := path / f"{name}.yaml").is_file():
                options[name] = str(file)
    return options


def format_tree(nodes: Sequence[OutlineNode]) -> str:
    """Return an outline as the text of `tree.json`; values that JSON cannot represent become strings."""
    return _NODES_ADAPTER.dump_json(list(nodes), by_alias=True, fallback=str, indent=1).decode() + "\n"


def read_tree(path: Path) -> list[OutlineNode]:
    """Return the outline of the tree of a run from its file `tree.json`.

    Raises:
        InputError: The file cannot be read or contains no outline.
    """
    try:
        return _NODES_ADAPTER.validate_json(read_file(path, MAX_RECORD_SIZE))
    except ValidationError as error:
        raise InputError(f'"{path}" contains no tree of a run: {error.errors()[0]["msg"].lower()}') from error

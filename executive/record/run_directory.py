"""Directory of a run: its name, the files from which the run can be repeated, and the search for it."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from executive.errors import InputError, describe_os_error
from executive.record.atomic_file import write_atomically

LATEST = "latest"
"""Name of the link to the last run directory."""
SCENE = "scene.yaml"
"""Name of the copy of the scene file."""
NO_SPACE_ERRORS = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Error numbers of a full disk, an exceeded quota and a file that is too large."""
_USE_OTHER_FOLDER = "name another place with --runs DIR"


class RunDirectory:
    """Directory of one run.

    Attributes:
        path: `RUNS/<YYYY-MM-DD>/<HH-MM-SS>_<mission>_s<seed>`.
        journal: File with the recorded events, one JSON object per line.
        world_log: File from which the last state of a simulated world can be rebuilt.
        tree: File with the outline of the built tree.
        report: HTML page that explains the run.
        result: File with the output of `executive run --json`.
        pictures: Folder with pictures of selections and failures.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.journal = path / "journal.jsonl"
        self.world_log = path / "world.log"
        self.tree = path / "tree.json"
        self.report = path / "report.html"
        self.result = path / "result.json"
        self.pictures = path / "frames"

    @property
    def scene(self) -> Path | None:
        """Copy of the scene file, or None if the run had none."""
        path = self.path / SCENE
        return path if path.is_file() else None

    @staticmethod
    def create(runs: Path, *, mission: str, seed: int, started: datetime) -> RunDirectory:
        """Make a directory below `runs`, named by the time `started`, and return the directory.

        Further runs that start in the same second get the suffix `-2`, `-3`, ....

        Raises:
            InputError: The directory cannot be made.
        """
        day = runs / started.strftime("%Y-%m-%d")
        name = f"{started.strftime('%H-%M-%S')}_{mission}_s{seed}"
        with convert_os_errors(f'make a run directory below "{runs}"'):
            day.mkdir(parents=True, exist_ok=True)
            path = _make_unique(day, name)
        return RunDirectory(path)

    def save_inputs(
        self,
        *,
        mission: str,
        params: Mapping[str, object],
        cell: Mapping[str, object],
        tree: str = "",
        libraries: Mapping[str, str] | None = None,
        scene: str = "",
    ) -> None:
        """Write and sync the inputs of the run, and let the link `runs/latest` point to this directory.

        Args:
            mission: Text of the mission file.
            params: Resolved params, as values that YAML can represent exactly.
            cell: Content of the cell file, as values that YAML can represent exactly.
            tree: Text of `tree.json`, or "".
            libraries: Text of each library, by its path relative to the mission.
            scene: Text of the scene file, or "".

        Raises:
            InputError: A file cannot be written; no file is incomplete.
        """
        with convert_os_errors(f'write to the run directory "{self.path}"'):
            # Libraries are written first and must not replace files of the record.
            for reference, text in (libraries or {}).items():
                library = self.path / reference
                if library not in (self.journal, self.result) and self.pictures not in library.parents:
                    library.parent.mkdir(parents=True, exist_ok=True)
                    write_atomically(library, text)
            write_atomically(self.path / "mission.yaml", mission)
            for name, content in (("params.yaml", params), ("cell.yaml", cell)):
                text = yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True)
                write_atomically(self.path / name, text)
            if tree:
                write_atomically(self.tree, tree)
            if scene:
                write_atomically(self.path / SCENE, scene)
        _point_latest(self.path.parents[1], self.path)


def check_runs_folder(runs: Path) -> None:
    """Make the folder `runs` if it does not exist, and check that directories can be made in it.

    Raises:
        InputError: No directory can be made.
    """
    with convert_os_errors(f'make a run directory below "{runs}"'):
        runs.mkdir(parents=True, exist_ok=True)
        # The permissions do not show whether the file system is read-only.
        with TemporaryDirectory(prefix=".try-", dir=runs):
            pass


@contextlib.contextmanager
def convert_os_errors(action: str, advice: str = _USE_OTHER_FOLDER) -> Iterator[None]:
    """Raise an OSError of the block as an InputError that names the failed action and ends with advice."""
    try:
        yield
    except OSError as error:
        space = "free some space or " if error.errno in NO_SPACE_ERRORS else ""
        raise InputError(f"cannot {action}: {describe_os_error(error)}; {space}{advice}") from error


def find_run(name: str, runs: Path) -> Path:
    """Return a run directory by its path, by its path below `runs`, or the last one by the name `latest`.

    Raises:
        InputError: There is no run directory of this name.
    """
    for path in (Path(name), runs / name):
        # Path.is_file raises an error for a name that is too long.
        if os.path.isfile(path / "journal.jsonl"):
            return path.resolve()
    known = sorted((path.parent for path in runs.glob("*/*/journal.jsonl")), reverse=True)
    hint = f"the last ones there: {', '.join(str(path.relative_to(runs)) for path in known[:3])}"
    raise InputError(
        f'"{name}" is no run directory, nor is there one of that name below "{runs}"; '
        f"{hint if known else 'there is none at all; say where they are with --runs DIR'}"
    )


def _make_unique(day: Path, name: str) -> Path:
    """Make and return `day/name`, or the first free `day/name-2`, `-3`, ...; safe between processes."""
    number = 1
    while True:
        path = day / (name if number == 1 else f"{name}-{number}")
        try:
            path.mkdir()
            return path
        except FileExistsError:
            number += 1


def _point_latest(runs: Path, path: Path) -> None:
    """Replace the link `runs/latest` by a link to `path`, atomically."""
    link = runs / f".latest-{os.getpid()}"
    # A run needs no link, and some file systems do not support links.
    with contextlib.suppress(OSError):
        link.symlink_to(path.relative_to(runs), target_is_directory=True)
        link.replace(runs / LATEST)

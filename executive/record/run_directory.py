"""Directory of a run: named by the wall clock, filled with what is needed to repeat the run."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from executive.errors import InputError, reason_of
from executive.record.whole_file import write_whole

NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""What the system says where more space would help."""
SCENE = "scene.yaml"
_ELSEWHERE = "name another place with --runs DIR"
"""Name of the copy of the scene file."""


class RunDirectory:
    """Directory of one run.

    Attributes:
        path: `RUNS/<YYYY-MM-DD>/<HH-MM-SS>_<mission>_s<seed>`.
        journal: File with everything that happened, one JSON object per line.
        world: File from which a simulated world can be rebuilt as the run left it.
        tree: File with the tree as it was built.
        report: File with the page that explains the run.
        result: File with the object that `executive run --json` prints.
        frames: Folder of the camera images behind the decisions.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.journal = path / "journal.jsonl"
        self.world = path / "world.log"
        self.tree = path / "tree.json"
        self.report = path / "report.html"
        self.result = path / "result.json"
        self.frames = path / "frames"

    @property
    def scene(self) -> Path | None:
        """Copy of the scene file, or None if the run had none."""
        path = self.path / SCENE
        return path if path.is_file() else None

    @staticmethod
    def create(runs: Path, *, mission: str, seed: int, started: datetime) -> RunDirectory:
        """Make a new directory below `runs` and return it.

        `started` only names it. A second run in the same second gets the suffix `-2`, a third `-3`.

        Raises:
            InputError: `runs` cannot be written to.
        """
        day = runs / started.strftime("%Y-%m-%d")
        name = f"{started.strftime('%H-%M-%S')}_{mission}_s{seed}"
        with refusing(f'make a run directory below "{runs}"'):
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
        """Write the mission's text as it was read, the params as they were resolved, and the cell.

        `tree` is the text of `tree.json` and `scene` that of `scene.yaml`, "" for none. The text of every
        library goes where the mission looks for it, beside the mission. All of it is on the disk before the
        run begins; then `runs/latest` points at this directory. Params and cell are of values that YAML
        knows, and are kept to the last digit: the run may be repeated with them.

        Raises:
            InputError: The directory cannot be written to; no file in it is half-written.
        """
        with refusing(f'write to the run directory "{self.path}"'):
            # First, and under no name of the record's own.
            for reference, text in (libraries or {}).items():
                library = self.path / reference
                if library not in (self.journal, self.result) and self.frames not in library.parents:
                    library.parent.mkdir(parents=True, exist_ok=True)
                    write_whole(library, text)
            write_whole(self.path / "mission.yaml", mission)
            for name, content in (("params.yaml", params), ("cell.yaml", cell)):
                text = yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True)
                write_whole(self.path / name, text)
            if tree:
                write_whole(self.tree, tree)
            if scene:
                write_whole(self.path / SCENE, scene)
        _point_latest(self.path.parents[1], self.path)


def check_place(runs: Path) -> None:
    """Make `runs` if need be, and see that something can be made in it.

    Raises:
        InputError: Nothing can.
    """
    with refusing(f'make a run directory below "{runs}"'):
        runs.mkdir(parents=True, exist_ok=True)
        # Trying tells more than the permissions do: the whole file system may be read-only.
        with TemporaryDirectory(prefix=".try-", dir=runs):
            pass


@contextlib.contextmanager
def refusing(what: str, instead: str = _ELSEWHERE) -> Iterator[None]:
    """Raise what the file system refuses as an InputError: what was tried, and what to do instead."""
    try:
        yield
    except OSError as error:
        raise refused(what, error, instead) from error


def refused(what: str, error: OSError, instead: str = _ELSEWHERE) -> InputError:
    """Return the sentence for an act that the file system refused, with what to do instead."""
    space = "free some space or " if error.errno in NO_ROOM else ""
    return InputError(f"cannot {what}: {reason_of(error)}; {space}{instead}")


def _make_unique(day: Path, name: str) -> Path:
    """Make and return `day/name`, or the first free `day/name-2`, `-3`, ...; safe between processes."""
    number = 1
    while True:
        path = day / (name if number == 1 else f"{name}-{number}")
        try:
            path.mkdir()
        except FileExistsError:
            number += 1
        else:
            return path


def _point_latest(runs: Path, path: Path) -> None:
    """Make `runs/latest` a link to `path`, in one step, so that no reader finds it missing."""
    fresh = runs / f".latest-{os.getpid()}"
    # The link is a convenience: a file system without links must not cost the run.
    with contextlib.suppress(OSError):
        fresh.symlink_to(path.relative_to(runs), target_is_directory=True)
        fresh.replace(runs / "latest")

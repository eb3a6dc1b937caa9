"""Process of a worker that executes jobs in the folder of an unpacked bundle; it may crash with a run.

The process reads pickled pairs of function and job from stdin until the worker ends, and writes a pickled
`JobOutput` for each.
"""

from __future__ import annotations

import io
import os
import pickle
import shutil
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from executive.campaign.cluster.bundle import make_relative
from executive.campaign.cluster.returned_run import RECORD_ADAPTER, JobOutput
from executive.campaign.results.rows import RunRecord
from executive.campaign.sweep import SweepJob


def main() -> None:
    """Execute calls from stdin; the argument is the folder of the unpacked bundle."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # Libraries write to stdout.
    while True:
        try:
            run_job, job = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(_execute(run_job, job, Path(sys.argv[1])), output)
        output.flush()


def _execute(run_job: Callable[[SweepJob], RunRecord], job: SweepJob, root: Path) -> JobOutput:
    """Execute a job whose absolute paths are changed to paths below `root`."""
    settings = job.settings
    settings = replace(
        settings,
        mission=str(_move_below(root, Path(settings.mission))),
        scene=settings.scene and _move_below(root, settings.scene),
    )
    job = replace(job, settings=settings, runs_folder=_move_below(root, job.runs_folder))
    try:
        record = run_job(job)
    except Exception as error:
        return JobOutput(str(root), error=f"{type(error).__name__}: {error}")
    content = _zip_and_delete(Path(record.run.run)) if record.run.run else b""
    return JobOutput(str(root), RECORD_ADAPTER.dump_json(record).decode(), run_directory=content)


def _move_below(root: Path, path: Path) -> Path:
    """Return an absolute path below `root` instead; a relative path is unchanged."""
    return root / make_relative(path) if path.is_absolute() else path


def _zip_and_delete(folder: Path) -> bytes:
    """Return the files of a folder as a zip file, and delete the folder."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(folder))
    shutil.rmtree(folder)
    return buffer.getvalue()


if __name__ == "__main__":
    main()

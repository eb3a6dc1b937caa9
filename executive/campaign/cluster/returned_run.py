"""Run directory that a worker returns: packing on the worker, and unpacking on the client."""

from __future__ import annotations

import io
import shutil
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

from executive.campaign.results.rows import RunRecord
from executive.record.run_directory import convert_os_errors, make_unique_folder

TEXT_SUFFIXES = (".html", ".json", ".jsonl", ".yaml")
"""Suffixes of the files that may contain paths."""


@dataclass(frozen=True)
class ReturnedRun:
    """A run that a worker returns.

    Attributes:
        root: Folder of the unpacked bundle on the worker. A path on the worker is `root` followed by the path
            on the client.
        record: Record of the run.
        run_directory: Zip file with the files of the run directory; empty if there is no run directory.
    """

    root: str
    record: RunRecord
    run_directory: bytes


def pack_run(record: RunRecord, root: Path) -> ReturnedRun:
    """Return a run, and delete its run directory on the worker."""
    content = b""
    if record.run.run_directory:
        archive = Path(shutil.make_archive(record.run.run_directory, "zip", record.run.run_directory))
        content = archive.read_bytes()
        archive.unlink()
        shutil.rmtree(record.run.run_directory)
    return ReturnedRun(str(root), record, content)


def unpack_run(returned: ReturnedRun) -> RunRecord:
    """Write the run directory, and return the record; both contain the paths on the client.

    Raises:
        InputError: A file cannot be written.
    """
    run = returned.record.run
    message = run.message.replace(returned.root, "")
    path = Path(run.run_directory.replace(returned.root, ""))
    if run.run_directory:
        folder = path
        with convert_os_errors(f'write the run directory "{folder}"'):
            folder.parent.mkdir(parents=True, exist_ok=True)
            # Runs of two workers may have the same name.
            path = make_unique_folder(folder.parent, folder.name)
            with zipfile.ZipFile(io.BytesIO(returned.run_directory)) as archive:
                archive.extractall(path)
            for file in (file for file in path.rglob("*") if file.suffix in TEXT_SUFFIXES):
                content = file.read_bytes().replace(returned.root.encode(), b"")
                file.write_bytes(content.replace(bytes(folder), bytes(path)))
        message = message.replace(str(folder), str(path))
    directory = str(path) if run.run_directory else ""
    return replace(returned.record, run=replace(run, message=message, run_directory=directory))

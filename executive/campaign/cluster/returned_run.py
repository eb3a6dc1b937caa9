"""Run directory that a worker returns: packing on the worker, and unpacking on the client."""

from __future__ import annotations

import io
import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from executive.campaign.results.rows import RunRecord
from executive.record.run_directory import convert_os_errors, make_unique_folder

TEXT_SUFFIXES = (".html", ".json", ".jsonl", ".yaml")
"""Suffixes of the files that may contain paths."""
_RECORD_ADAPTER = TypeAdapter(RunRecord)
"""Encoder and decoder of the record of a run; JSON represents each floating-point number exactly."""


@dataclass(frozen=True)
class ReturnedRun:
    """A run that a worker returns.

    Attributes:
        root: Folder of the unpacked bundle on the worker. A path on the worker is `root` followed by the path
            on the client.
        record: Record of the run as JSON.
        run_directory: Zip file with the files of the run directory; empty if there is no run directory.
    """

    root: str
    record: str
    run_directory: bytes


def pack_run(record: RunRecord, root: Path) -> ReturnedRun:
    """Return a run, and delete its run directory on the worker."""
    content = b""
    if record.run.run_directory:
        archive = Path(shutil.make_archive(record.run.run_directory, "zip", record.run.run_directory))
        content = archive.read_bytes()
        archive.unlink()
        shutil.rmtree(record.run.run_directory)
    return ReturnedRun(str(root), _RECORD_ADAPTER.dump_json(record).decode(), content)


def unpack_run(returned: ReturnedRun) -> RunRecord:
    """Write the run directory, and return the record; both contain the paths on the client.

    Raises:
        InputError: A file cannot be written.
    """
    text = returned.record.replace(returned.root, "")
    record = _RECORD_ADAPTER.validate_json(text)
    if not record.run.run_directory:
        return record
    folder = Path(record.run.run_directory)
    with convert_os_errors(f'write the run directory "{folder}"'):
        folder.parent.mkdir(parents=True, exist_ok=True)
        # Runs of two workers may have the same name.
        path = make_unique_folder(folder.parent, folder.name)
        with zipfile.ZipFile(io.BytesIO(returned.run_directory)) as archive:
            archive.extractall(path)
        for file in (file for file in path.rglob("*") if file.suffix in TEXT_SUFFIXES):
            content = file.read_bytes().replace(returned.root.encode(), b"")
            file.write_bytes(content.replace(bytes(folder), bytes(path)))
    return _RECORD_ADAPTER.validate_json(text.replace(str(folder), str(path)))

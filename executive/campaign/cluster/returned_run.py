"""Run directory that a worker returned: the files are unpacked with the paths of this computer."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from executive.campaign.results.rows import RunRecord
from executive.record.run_directory import convert_os_errors, make_unique_folder

TEXT_SUFFIXES = (".html", ".json", ".jsonl", ".yaml")
"""Suffixes of the files that may contain paths."""
RECORD_ADAPTER = TypeAdapter(RunRecord)
"""Encoder and decoder of the record of a run; JSON represents each floating-point number exactly."""


@dataclass(frozen=True)
class JobOutput:
    """Output of a job.

    Attributes:
        root: Folder of the bundle on the worker; the output contains absolute paths below this folder.
        record: Record of the run as JSON; "" after an exception.
        error: Message of the exception, or "".
        run_directory: Zip file with the files of the run directory; empty if there is no run directory.
    """

    root: str
    record: str = ""
    error: str = ""
    run_directory: bytes = b""


def unpack_returned_run(output: JobOutput) -> RunRecord:
    """Write the run directory of a job, and return the record of the run with the path of the directory.

    Raises:
        InputError: A file cannot be written.
    """
    # Below the folder of the bundle, a worker has the paths of this computer.
    text = output.record.replace(output.root, "")
    record = RECORD_ADAPTER.validate_json(text)
    if not record.run.run:
        return record
    folder = Path(record.run.run)
    with convert_os_errors(f'write the run directory "{folder}"'):
        folder.parent.mkdir(parents=True, exist_ok=True)
        # Runs of two workers may have the same name.
        path = make_unique_folder(folder.parent, folder.name)
        with zipfile.ZipFile(io.BytesIO(output.run_directory)) as archive:
            archive.extractall(path)
        for file in (file for file in path.rglob("*") if file.suffix in TEXT_SUFFIXES):
            content = file.read_bytes().replace(output.root.encode(), b"")
            file.write_bytes(content.replace(bytes(folder), bytes(path)))
    return RECORD_ADAPTER.validate_json(text.replace(str(folder), str(path)))

"""Log file from which the world of an interrupted run can be rebuilt."""

from __future__ import annotations

import os
from pathlib import Path

from executive.errors import Fault, InputError, describe_os_error, explain_os_errors


class LogFile:
    """A file without a write buffer, so that a killed process loses no written data.

    Args:
        path: Path of the file; None: all data are discarded.
        content_name: Name of the content, for the message of a fault.
        length: Length to which an existing file is truncated [byte], or None to keep its content.

    Raises:
        InputError: The file cannot be opened.
    """

    def __init__(self, path: Path | None, content_name: str, length: int | None = None) -> None:
        self._path, self._content_name = path, content_name
        self._has_content = bool(length)
        self._file: int | None = None
        if path is None:
            return
        with explain_os_errors(InputError, f'cannot write "{path}"'):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            if length is not None:
                os.ftruncate(self._file, length)

    def write(self, data: bytes, offset: int) -> None:
        """Write all data at an offset in the file [byte]; do nothing if the file is closed.

        Raises:
            InputError: The disk does not accept the first data.
            Fault: The disk does not accept later data. Later calls do nothing, so that the run can still
                bring the arm to rest.
        """
        try:
            while data and self._file is not None:
                byte_count = os.pwrite(self._file, data, offset)
                data, offset = data[byte_count:], offset + byte_count
        except OSError as error:
            self.close()
            error_class = Fault if self._has_content else InputError
            raise error_class(
                f'{self._content_name} "{self._path}" cannot be written: {describe_os_error(error)}; '
                "the run stops, because without this file it could not be resumed after an interruption"
            ) from error
        self._has_content = True

    def close(self) -> None:
        """Close the file; do nothing if it is closed."""
        if self._file is not None:
            file, self._file = self._file, None
            os.close(file)

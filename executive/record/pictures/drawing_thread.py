"""Thread that draws pictures during a run."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from pathlib import Path

import cv2

from executive.errors import ExecutiveError, explain_os_errors
from executive.record.atomic_file import replace_atomically
from executive.record.pictures.draw import draw_picture
from executive.record.pictures.picture_content import PictureContent

MAX_QUEUED_PICTURES = 64
"""Maximum number of queued pictures, of about 1.2 MB each; further pictures are not drawn."""

CLOSE_TIMEOUT = 30.0
"""Maximum time for which the end of a run waits for queued pictures [s]."""

JPEG_QUALITY = 80
"""Quality of the JPEG files, 0 to 100; a picture with a width of 640 pixels has 40 to 50 kB."""


class PictureDrawer:
    """Draws pictures to files in a folder, in a thread that needs 8 ms per picture."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="pictures")
        # Any first task starts the thread; the first picture would start it during a control step.
        self._thread.submit(int)
        self._futures: list[Future[None]] = []
        self.problem = ""
        """Message about missing pictures, or ""."""

    def queue(self, name: str, content: PictureContent) -> bool:
        """Queue a picture for the file `name` in the folder; return False if the queue is full."""
        if sum(not future.done() for future in self._futures) >= MAX_QUEUED_PICTURES:
            return False
        self._futures.append(self._thread.submit(self._save, self._folder / name, content))
        return True

    def close(self, *, wait: bool = True) -> None:
        """Draw all queued pictures; if `wait` is False, only the current picture is finished."""
        unfinished = wait_for(self._futures, CLOSE_TIMEOUT).not_done if wait else set()
        if unfinished:
            self.problem = f"{len(unfinished)} pictures were not drawn within {CLOSE_TIMEOUT:.0f} s"
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _save(self, path: Path, content: PictureContent) -> None:
        try:
            save_picture(path, content)
        except Exception as error:
            # Only the text of the first error is stored: an exception would keep all images in memory.
            self.problem = self.problem or f"not every picture was drawn: {error}"


def save_picture(path: Path, content: PictureContent) -> None:
    """Draw a picture to a file; the suffix of the file determines the image format.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExecutiveError(f'cannot make the folder "{path.parent}": {error.strerror}') from error
    image_bgr = cv2.cvtColor(draw_picture(content), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(path.suffix, image_bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    with (
        explain_os_errors(ExecutiveError, f'cannot write the picture "{path}"'),
        replace_atomically(path) as temporary_file,
    ):
        temporary_file.write_bytes(data.tobytes())

"""Thread that draws pictures during a run."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from pathlib import Path

from executive.errors import ExecutiveError, explain_os_errors
from executive.record.atomic_file import replace_atomically
from executive.record.pictures.draw import draw
from executive.record.pictures.scene import PictureScene

MAX_WAITING = 64
"""Maximum number of queued pictures [about 1.2 MB each]; further pictures are dropped."""

CLOSE_TIMEOUT = 30.0
"""Time after the end of a run after which queued pictures are dropped [s]."""

QUALITY = 80
"""Quality of the JPEG files, 0 to 100; a picture of 640 pixels width has 40 to 50 kB."""


class Drawer:
    """Draws scenes to files of a folder in one thread [8 ms each], which starts with the first scene."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="pictures")
        self._pictures: list[Future[None]] = []
        self.problem = ""
        """Reason for which pictures are missing, or "" if none is."""

    def draw(self, name: str, scene: PictureScene) -> bool:
        """Queue a scene for the file `name` of the folder; return False if the queue is full."""
        if sum(not picture.done() for picture in self._pictures) >= MAX_WAITING:
            return False
        self._pictures.append(self._thread.submit(self._save, self._folder / name, scene))
        return True

    def close(self, *, wait: bool = True) -> None:
        """Finish the queued pictures; if `wait` is False, finish only the current picture."""
        unfinished = wait_for(self._pictures, CLOSE_TIMEOUT).not_done if wait else set()
        if unfinished:
            self.problem = f"{len(unfinished)} pictures were not drawn within {CLOSE_TIMEOUT:.0f} s"
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _save(self, path: Path, scene: PictureScene) -> None:
        """Save a picture, and store the text of the first error; an exception would keep its scene."""
        try:
            save(path, scene)
        except Exception as error:
            self.problem = self.problem or f"not every picture was drawn: {error}"


def save(path: Path, scene: PictureScene) -> None:
    """Draw a scene to a file, whose suffix determines the image format.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    import cv2

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExecutiveError(f'cannot make the folder "{path.parent}": {error.strerror}') from error
    image = cv2.cvtColor(draw(scene), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(path.suffix, image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    with (
        explain_os_errors(ExecutiveError, f'cannot write the picture "{path}"'),
        replace_atomically(path) as part,
    ):
        part.write_bytes(data.tobytes())

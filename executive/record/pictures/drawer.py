"""Thread that draws pictures beside a run."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from executive.errors import ExecutiveError
from executive.record.pictures.draw import draw
from executive.record.pictures.scene import Scene

MAX_WAITING = 64
"""Pictures that may wait for the thread [about 1.2 MB each]; beyond that they are dropped."""

QUALITY = 80
"""Quality of the JPEG files, 0 to 100: a 640 pixel wide picture takes 40 to 50 kB."""


class Drawer:
    """Draws scenes to files of a folder in one thread [8 ms each], which starts with the first scene."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="pictures")
        self._pictures: list[Future[None]] = []
        self.problem = ""
        """Reason for which pictures are missing, or "" if none is."""

    def draw(self, name: str, scene: Scene) -> bool:
        """Have `scene` drawn to the file `name` of the folder; False if too many wait already."""
        if sum(not picture.done() for picture in self._pictures) >= MAX_WAITING:
            return False
        self._pictures.append(self._thread.submit(save, self._folder / name, scene))
        return True

    def close(self) -> None:
        """Return once every picture is drawn; `problem` says if some are not."""
        self._thread.shutdown()
        errors = [error for picture in self._pictures if (error := picture.exception()) is not None]
        if errors:
            self.problem = f"not every picture was drawn: {errors[0]}"


def save(path: Path, scene: Scene) -> None:
    """Draw `scene` and write the file; its ending says the format.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    import cv2

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExecutiveError(f'cannot make the folder "{path.parent}": {error.strerror}') from error
    image = cv2.cvtColor(draw(scene), cv2.COLOR_RGB2BGR)
    if not cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY]):
        raise ExecutiveError(f'cannot write the picture "{path}"')

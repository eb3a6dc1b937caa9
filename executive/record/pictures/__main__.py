"""The program that draws: it takes scenes from its standard input, pickled one after another."""

from __future__ import annotations

import os
import pickle
import sys
from pathlib import Path

from executive.errors import ExecutiveError
from executive.record.pictures.draw import draw
from executive.record.pictures.scene import Scene

QUALITY = 80
"""Of the JPEG files, 0 to 100: a 640 pixel wide picture takes 40 to 50 kB."""


def save(path: Path, scene: Scene) -> None:
    """Draw `scene` and write the file; its ending says the format.

    Raises:
        ExecutiveError: The file cannot be written.
    """
    import cv2

    image = cv2.cvtColor(draw(scene), cv2.COLOR_RGB2BGR)
    if not cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY]):
        raise ExecutiveError(f'cannot write the picture "{path}"')


def main() -> None:
    """Draw every picture that arrives."""
    os.nice(5)  # The tick loop goes first.
    while True:
        try:
            path, scene = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        save(path, scene)


if __name__ == "__main__":
    main()

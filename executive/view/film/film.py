"""Film of a recorded run: the rebuilt world, and beside it the decisions of the tree."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from pathlib import Path

from PIL import Image

from executive.cells.sim.shots import Shoot, count_steps, take_pictures
from executive.cells.sim.viewpoint import overview
from executive.view.film.course import FilmCourse
from executive.view.film.formats import Format
from executive.view.film.page import SCENE_SIZE, draw_ending, draw_page
from executive.view.film.source import FilmSource

VISIBLE_AREA = (24, 76, 776, 644)
"""Left, top, right and bottom of the part of the image with arm, workspace and bins [pixel]."""
END_DURATION = 2.0
"""Time for which the last frame is shown [s]."""

Progress = Callable[[int, int], None]
"""Callback with the number of complete frames and of all frames."""


def film(
    source: FilmSource, file: Path, format: Format, *, speed: float, workers: int, progress: Progress
) -> int:
    """Write the film of a run, and return the number of frames.

    Args:
        source: The record of the run.
        file: File of the film.
        format: Format of the film.
        speed: Seconds on the robot's clock per second of the film.
        workers: Number of rendering processes.
        progress: Receives the number of complete frames and of all frames.
    """
    steps_per_frame = speed / format.rate / source.start.step
    steps = select_steps(count_steps(source.directory.world), steps_per_frame)
    end_frames = round(END_DURATION * format.rate)

    def report_progress() -> Generator[Image.Image, None, None]:
        for done, page in enumerate(pages, start=1):
            progress(done, len(steps) + end_frames)
            yield page

    with closing(_draw_frames(source, steps, end_frames, speed, workers)) as pages:
        format.write(file, report_progress(), format.rate)
    return len(steps) + end_frames


def select_steps(steps: int, steps_per_frame: float) -> list[int]:
    """Return the control steps of the frames: every `steps_per_frame`, from the first to the last."""
    return [
        min(round(frame * steps_per_frame), steps) for frame in range(math.ceil(steps / steps_per_frame) + 1)
    ]


def _draw_frames(
    source: FilmSource, steps: Sequence[int], end_frames: int, speed: float, workers: int
) -> Generator[Image.Image, None, None]:
    """Yield the frames of a film: a page per control step, and then `end_frames` pages with the result."""
    start, directory = source.start, source.directory
    note = f"seed {start.seed} · cell {source.config.cell}" + (f" · {speed:g}x speed" if speed != 1 else "")
    length = steps[-1] * start.step
    course = FilmCourse(source.events, source.nodes, list(directory.frames.glob("*.jpg")))
    view = overview(source.config, SCENE_SIZE, VISIBLE_AREA)
    shoot = Shoot(source.config, start.seed, directory.world, view, directory.scene)
    with closing(take_pictures(shoot, steps, workers)) as pictures:
        for step, picture in zip(steps, pictures, strict=True):
            course.go_to(step, step * start.step)
            yield draw_page(source, picture, course, note, length)
    last = draw_ending(draw_page(source, picture, course, note, length, caption=False), source.result)
    for _ in range(end_frames):
        yield last

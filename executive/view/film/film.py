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
from executive.view.film.page import STAGE, draw_ending, draw_page
from executive.view.film.source import FilmSource

SHOWN = (24, 76, 776, 644)
"""Part of the picture that arm, workspace and bins fill; texts stand around it [pixel]."""
HOLD = 2.0
"""Time for which the end is shown [s]."""

Progress = Callable[[int, int], None]
"""Takes the number of frames that are done, and of all frames."""


def film(
    source: FilmSource, file: Path, format: Format, *, speed: float, workers: int, progress: Progress
) -> int:
    """Film a run, and return the number of frames.

    Args:
        source: The record of the run.
        file: File of the film.
        format: Format of the film.
        speed: Seconds on the robot's clock per second of the film.
        workers: Processes that take the pictures.
        progress: Takes the number of frames that are done, and of all frames.
    """
    each = speed / format.rate / source.start.step
    steps = shown_steps(count_steps(source.directory.world), each)
    held = round(HOLD * format.rate)

    def counted() -> Generator[Image.Image, None, None]:
        for done, page in enumerate(pages, start=1):
            progress(done, len(steps) + held)
            yield page

    with closing(_pages(source, steps, held, speed, workers)) as pages:
        format.write(file, counted(), format.rate)
    return len(steps) + held


def shown_steps(steps: int, each: float) -> list[int]:
    """Return the control steps of a run that are shown: every so many, from the first to the last."""
    return [min(round(frame * each), steps) for frame in range(math.ceil(steps / each) + 1)]


def _pages(
    source: FilmSource, steps: Sequence[int], held: int, speed: float, workers: int
) -> Generator[Image.Image, None, None]:
    """Yield the frames of a film: a page for each of these control steps, and the last one for a while."""
    start, directory = source.start, source.directory
    note = f"seed {start.seed} · cell {source.config.cell}" + (f" · {speed:g}x speed" if speed != 1 else "")
    length = steps[-1] * start.step
    course = FilmCourse(source.events, source.nodes, list(directory.frames.glob("*.jpg")))
    view = overview(source.config, STAGE, SHOWN)
    shoot = Shoot(source.config, start.seed, directory.world, view, directory.scene)
    with closing(take_pictures(shoot, steps, workers)) as pictures:
        for step, picture in zip(steps, pictures, strict=True):
            course.go_to(step, step * start.step)
            yield draw_page(source, picture, course, note, length)
    last = draw_ending(draw_page(source, picture, course, note, length, caption=False), source.result)
    for _ in range(held):
        yield last

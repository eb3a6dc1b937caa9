"""Film of a recorded run: the simulated world, and beside it the decisions of the tree."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from pathlib import Path

from PIL import Image

from executive.cells.sim.pictures import PictureSource, count_steps, render_pictures
from executive.cells.sim.viewpoint import compute_viewpoint
from executive.view.film.film_source import FilmSource
from executive.view.film.formats import FilmFormat
from executive.view.film.page import SCENE_SIZE, draw_frame, draw_result
from executive.view.film.run_state import FilmRunState

CELL_BOX = (24, 76, 776, 644)
"""Left, top, right and bottom of the box in the image in which arm, workspace and bins appear [pixel]."""
END_DURATION = 2.0
"""Time for which the film shows the result of the run at its end [s]."""

Progress = Callable[[int, int], None]
"""Callback that receives the number of complete frames and the number of all frames."""


def write_film(
    source: FilmSource, file: Path, format: FilmFormat, *, speed: float, workers: int, progress: Progress
) -> int:
    """Write the film of a run, and return the number of frames.

    Args:
        source: The record of the run.
        file: File of the film.
        format: Format of the film.
        speed: Seconds on the robot's clock per second of the film.
        workers: Number of rendering processes.
        progress: Callback that receives the number of complete frames and the number of all frames.
    """
    steps_per_frame = speed / format.frame_rate / source.start.step
    steps = select_steps(count_steps(source.directory.world_log), steps_per_frame)
    end_frame_count = round(END_DURATION * format.frame_rate)

    def iterate_with_progress() -> Generator[Image.Image, None, None]:
        for done, frame in enumerate(frames, start=1):
            progress(done, len(steps) + end_frame_count)
            yield frame

    with closing(_draw_frames(source, steps, end_frame_count, speed, workers)) as frames:
        format.write(file, iterate_with_progress(), format.frame_rate)
    return len(steps) + end_frame_count


def select_steps(step_count: int, steps_per_frame: float) -> list[int]:
    """Return the control steps of the frames: every `steps_per_frame`, from the first step to the last."""
    frame_count = math.ceil(step_count / steps_per_frame) + 1
    return [min(round(frame * steps_per_frame), step_count) for frame in range(frame_count)]


def _draw_frames(
    source: FilmSource, steps: Sequence[int], end_frame_count: int, speed: float, workers: int
) -> Generator[Image.Image, None, None]:
    """Yield the frames of a film: one per step in `steps`, then `end_frame_count` with the result."""
    start, directory = source.start, source.directory
    speed_text = f" · {speed:g}x speed" if speed != 1 else ""
    subtitle = f"seed {start.seed} · cell {source.config.cell}{speed_text}"
    duration = steps[-1] * start.step
    state = FilmRunState(source.events, source.nodes, list(directory.pictures.glob("*.jpg")))
    view = compute_viewpoint(source.config, SCENE_SIZE, CELL_BOX)
    picture_source = PictureSource(source.config, start.seed, directory.world_log, view, directory.scene)
    with closing(render_pictures(picture_source, steps, workers)) as pictures:
        for step, picture in zip(steps, pictures, strict=True):
            state.advance_to(step, step * start.step)
            yield draw_frame(source, picture, state, subtitle, duration)
    last_frame = draw_result(
        draw_frame(source, picture, state, subtitle, duration, has_caption=False), source.result
    )
    yield from [last_frame] * end_frame_count

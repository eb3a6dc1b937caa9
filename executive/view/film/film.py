"""Film (video) of a recorded run: simulated world at the left, decisions of the tree at the right."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

from PIL import Image

from executive.cells.sim.pictures import PictureSource, compute_viewpoint, count_steps, render_pictures
from executive.view.film.formats import FilmFormat
from executive.view.film.page import SCENE_SIZE, add_result, draw_frame
from executive.view.film.run_state import FilmRunState, FilmSource

CELL_BOX = (24, 76, 776, 644)
"""Region of the image that shows arm, workspace and bins: left, top, right and bottom [pixel]."""
RESULT_DISPLAY_TIME = 2.0
"""Time for which the last frames of a film show the result of the run [s]."""


def write_film(
    source: FilmSource, file: Path, film_format: FilmFormat, speed: float, workers: int,
    progress: Callable[[int, int], None],
) -> int:  # fmt: skip
    """Write the film of a run, and return the number of frames.

    Args:
        source: Record of the run.
        file: File of the film.
        film_format: File format of the film.
        speed: Seconds on the robot's clock per second of the film.
        workers: Number of rendering processes.
        progress: Callback that receives the number of written frames and the number of all frames.
    """
    steps_per_frame = speed / film_format.frame_rate / source.start.step  # `start.step` is a duration.
    steps = select_steps(count_steps(source.directory.world_log), steps_per_frame)
    result_frame_count = round(RESULT_DISPLAY_TIME * film_format.frame_rate)
    frame_count = len(steps) + result_frame_count

    def iterate_with_progress(frames: Iterable[Image.Image]) -> Iterator[Image.Image]:
        for number, frame in enumerate(frames, start=1):
            progress(number, frame_count)
            yield frame

    with closing(_draw_frames(source, steps, result_frame_count, speed, workers)) as frames:
        film_format.write(file, iterate_with_progress(frames), film_format.frame_rate)
    return frame_count


def select_steps(step_count: int, steps_per_frame: float) -> list[int]:
    """Return the control steps of the frames: the multiples of `steps_per_frame`, and the last step."""
    frame_count = math.ceil(step_count / steps_per_frame) + 1
    return [min(round(frame * steps_per_frame), step_count) for frame in range(frame_count)]


def _draw_frames(
    source: FilmSource, steps: Sequence[int], result_frame_count: int, speed: float, workers: int
) -> Generator[Image.Image, None, None]:
    """Yield the frames of a film: a frame per step in `steps`, then `result_frame_count` result frames."""
    start, directory = source.start, source.directory
    speed_text = f" · {speed:g}x speed" if speed != 1 else ""
    subtitle = f"seed {start.seed} · cell {source.config.cell}{speed_text}"
    duration = steps[-1] * start.step
    state = FilmRunState(source.events, source.nodes, list(directory.pictures.glob("*.jpg")))
    viewpoint = compute_viewpoint(source.config, SCENE_SIZE, CELL_BOX)
    picture_source = PictureSource(source.config, start.seed, directory.world_log, viewpoint, directory.scene)
    with closing(render_pictures(picture_source, steps, workers)) as pictures:
        for step, picture in zip(steps, pictures, strict=True):
            state.advance_to(step, step * start.step)
            yield draw_frame(source, picture, state, subtitle, duration)
    last_frame = draw_frame(source, picture, state, subtitle, duration, has_caption=False)
    yield from [add_result(last_frame, source.outcome)] * result_frame_count

"""Video of a recorded run: the simulated world beside the last picture of the camera, and a line of text."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import av
import cv2
import numpy as np
import PIL.Image

from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.drivers.sim.camera import Image, Light, render
from executive.drivers.sim.driver import WorldRebuilder
from executive.drivers.sim.spawn import build_world_of_run
from executive.drivers.world_log import RUN_STEP, read_commands
from executive.errors import InputError, explain_os_errors
from executive.geometry import Array, Pose
from executive.perception.camera_model import compute_camera_matrix, compute_look_at_pose
from executive.record.journal import find_run_start, read_journal
from executive.record.picture_recorder import split_picture_name
from executive.record.run_directory import RunDirectory, find_recorded_options, read_cell, replace_atomically
from executive.record.timeline import Timeline, get_skill_name
from executive.run.replay import InputLog

FRAME_RATE = 10
"""Frames per second of a video."""
GIF_SPEED = 2.0
"""Seconds on the clock of the run per second of a GIF; an MP4 file shows the run at its own speed."""
END_FRAME_COUNT = 20
"""Number of frames that show the end of the run."""
PICTURE_SIZE = (640, 504)
"""Width and height of the picture of the world, and maximum size of the picture of the camera [pixel]."""
TEXT_HEIGHT = 36
"""Height of the line of text below the pictures [pixel]."""
CAMERA_DIRECTION = (0.7, -0.53, 0.48)
"""Direction from the cell to the camera: in front of the arm, to the right, and above."""
FIELD_OF_VIEW_DEG = 33.0
"""Vertical field of view of the camera [degree]; a small value reduces perspective distortion."""
ARM_HEIGHT = 0.8
"""Height of the arm above its base for the choice of the viewpoint [m]."""


def write_video(path: Path, file: Path) -> None:
    """Write the video of the run in the directory `path` to a .mp4 or .gif file; the run may be interrupted.

    Raises:
        InputError: A part of the record is missing or damaged, or the file cannot be written.
    """
    with (
        explain_os_errors(InputError, f'cannot write the video "{file}"'),
        replace_atomically(file) as partial_file,
    ):
        if file.suffix.lower() == ".gif":
            _write_gif(partial_file, _draw_frames(RunDirectory(path), GIF_SPEED / FRAME_RATE))
        else:
            _write_mp4(partial_file, _draw_frames(RunDirectory(path), 1 / FRAME_RATE))


def _draw_frames(directory: RunDirectory, period: float) -> Iterator[Image]:
    """Yield the frames of a video; successive frames differ by `period` on the clock of the run [s]."""
    events = list(read_journal(directory.journal))
    start = find_run_start(events, directory.path, "there is nothing to show")
    later_events = deque(InputLog(events).events)
    later_files = deque(sorted(directory.pictures.glob("*.jpg")))
    timeline = Timeline(has_history=False)
    camera_picture = np.zeros((*PICTURE_SIZE[::-1], 3), np.uint8)
    for step_count, world_picture in _render_pictures(directory, start.seed, max(1, round(period / STEP))):
        time = step_count * STEP
        tick = round(time / start.step)
        while later_events and later_events[0].tick <= tick:
            timeline(later_events.popleft())
        while later_files and split_picture_name(later_files[0])[0] <= tick:
            camera_picture = _read_picture(later_files.popleft())
        text_line = np.zeros((TEXT_HEIGHT, 2 * PICTURE_SIZE[0], 3), np.uint8)
        text = f"{time:.1f} s   {_describe_state(timeline)}"
        cv2.putText(text_line, text, (12, 25), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 255, 255), 1, cv2.LINE_AA)
        frame = np.vstack([np.hstack([world_picture, camera_picture]), text_line])
        yield frame
    yield from itertools.repeat(frame, END_FRAME_COUNT)


def _read_picture(file: Path) -> Image:
    """Return the picture in a file, scaled to fit into `PICTURE_SIZE`; black if it is unreadable."""
    picture = np.zeros((*PICTURE_SIZE[::-1], 3), np.uint8)
    if (saved_picture := cv2.imread(str(file), cv2.IMREAD_COLOR_RGB)) is not None:
        scale = min(np.divide(PICTURE_SIZE[::-1], saved_picture.shape[:2]))
        scaled_picture = cv2.resize(saved_picture, None, fx=scale, fy=scale)
        picture[: scaled_picture.shape[0], : scaled_picture.shape[1]] = scaled_picture
    return picture


def _describe_state(timeline: Timeline) -> str:
    """Return the running skills with their items; after the run, its end."""
    if timeline.ended is not None:
        return f"{timeline.ended.status} {timeline.ended.message}"
    running = [activation for activation in timeline.find_running_activations() if activation.skill]
    return " + ".join(f"{get_skill_name(each.node)} {each.item}" for each in running)


def _render_pictures(
    directory: RunDirectory, seed: int, steps_per_picture: int
) -> Iterator[tuple[int, Image]]:
    """Yield pictures of the world after every `steps_per_picture` physics steps, from the start to the end.

    The number of physics steps up to each picture precedes the picture.
    """
    config = read_cell(directory.path)
    viewpoint = _compute_viewpoint(config)
    world, _ = build_world_of_run(config, seed, find_recorded_options(directory.path))
    try:
        rebuilder = WorldRebuilder(world, config.tool.build_sim(world))
        for command in read_commands(directory.world_log):
            if command.kind == RUN_STEP and rebuilder.step_count % steps_per_picture == 0:
                yield rebuilder.step_count, render(world, *viewpoint, (0, 0, *PICTURE_SIZE), Light()).image
            rebuilder.execute(command)
        yield rebuilder.step_count, render(world, *viewpoint, (0, 0, *PICTURE_SIZE), Light()).image
    finally:
        world.close()


def _compute_viewpoint(config: CellConfig) -> tuple[Array, Pose]:
    """Return the matrix and the pose of a camera whose picture contains arm, table and bins of a cell."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, ARM_HEIGHT)]
    points += itertools.product(config.table.x, config.table.y, (0.0,))
    for bin in config.bins.values():
        corners = itertools.product((-0.5, 0.5), (-0.5, 0.5), (1.0,))
        points += [tuple(np.add(bin.position, np.multiply(bin.size, corner))) for corner in corners]
    centre = (np.min(points, axis=0) + np.max(points, axis=0)) / 2
    R_WC = compute_look_at_pose(CAMERA_DIRECTION, (0, 0, 0), (0, 0, 1)).rotation
    matrix = compute_camera_matrix(*PICTURE_SIZE, FIELD_OF_VIEW_DEG)
    offsets = (np.array(points) - centre) @ R_WC
    # At the distance d, the camera sees a point if |x| <= (z + d) max_slope, and likewise for y.
    max_slopes = matrix[:2, 2] / matrix[[0, 1], [0, 1]]
    distance = np.max(np.abs(offsets[:, :2]) / max_slopes - offsets[:, 2:])
    return matrix, Pose(R_WC, centre - distance * R_WC[:, 2])


def _write_mp4(file: Path, frames: Iterator[Image]) -> None:
    with av.open(str(file), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", FRAME_RATE, {"crf": "20"})
        stream.pix_fmt = "yuv420p"
        stream.width = 2 * PICTURE_SIZE[0]
        stream.height = PICTURE_SIZE[1] + TEXT_HEIGHT
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode(None))


def _write_gif(file: Path, frames: Iterator[Image]) -> None:
    """Write frames as an endlessly repeated GIF of half the size, with the colours of the first frame."""
    images = (PIL.Image.fromarray(frame).reduce(2) for frame in frames)
    first = next(images).quantize()
    others = (image.quantize(palette=first, dither=PIL.Image.Dither.NONE) for image in images)
    first.save(file, "GIF", save_all=True, append_images=others, duration=1000 // FRAME_RATE, loop=0)

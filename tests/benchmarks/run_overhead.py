"""Wall time of a recorded run compared with a bare PyBullet loop.

The bare loop executes the same physics steps and motor commands, renders a full image for each frame, and
searches this image as often as the run did. It has no tree, no planner, no record, and no tool.
"""

from __future__ import annotations

import tempfile
import time
from collections import Counter, defaultdict
from contextlib import closing
from pathlib import Path

import pybullet

from executive.campaign.mission_under_test import MissionUnderTest
from executive.cell.frame import FrameCaptured
from executive.cells.sim.camera import get_camera_pose
from executive.cells.sim.command_log import IDLE_STEP, JOINT_TARGETS, RUN_STEP, read_commands
from executive.cells.sim.renderer import CELL_LIGHT, render
from executive.cells.sim.spawn import build_initial_world
from executive.events import FrameSearched, TimedEvent
from executive.perception.camera_model import compute_calibration
from executive.perception.detectors.embedded import LABELS_PATH, MODEL_PATH
from executive.perception.detectors.onnx_model import OnnxModel, read_labels
from executive.perception.detectors.views import list_regions
from executive.record.recorded_run import make_run_directory
from executive.record.recorder import Recorder
from executive.run.assembly import RunOptions, assemble
from tests.benchmarks.report import Figures, describe, run_command

MAX_RATIO = 1.5
"""Limit of the wall time of the run, relative to the bare loop."""


class TimedRecorder:
    """Recorder of a run that counts the frames and measures its own time.

    Attributes:
        recording_time: Time in which the tick loop waited for the recorder [s].
        frame_counts: Number of frames by control step.
        views: Views that a detector searched, by the number of the frame.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self.recording_time = 0.0
        self.frame_counts: Counter[int] = Counter()
        self.views: dict[int, list[str]] = defaultdict(list)

    def __call__(self, timed: TimedEvent) -> None:
        start_time = time.perf_counter()
        self._recorder(timed)
        self.recording_time += time.perf_counter() - start_time
        if isinstance(timed.event, FrameCaptured):
            self.frame_counts[timed.tick] += 1
        elif isinstance(timed.event, FrameSearched):
            self.views[timed.event.frame].append(timed.event.view)


def measure(subject: MissionUnderTest) -> Figures:
    """Measure the wall time of a recorded run of MISSION, relative to a bare PyBullet loop."""
    options = RunOptions(subject.seed, subject.requests, make_cell=subject.make_cell)
    with tempfile.TemporaryDirectory() as folder:
        run = assemble(subject.loaded, options)
        with closing(run):
            directory = make_run_directory(run, subject.loaded, options, Path(folder))
            start_time = time.perf_counter()
            with closing(Recorder(directory)) as recorder:
                timed_recorder = TimedRecorder(recorder)
                run.add_recorder(timed_recorder)
                status = run.execute().status
            run_time = time.perf_counter() - start_time
        bare_time = _measure_bare_loop(subject, directory.world_log, timed_recorder)
    return {
        **describe(subject),
        "frames": timed_recorder.frame_counts.total(),
        "run_s": run_time,
        "recorder_percent": 100 * timed_recorder.recording_time / run_time,
        "bare_loop_s": bare_time,
        "ratio": run_time / bare_time,
        "problems": [f"the run ended with {status}"] if status != "SUCCESS" else [],
        "allowed_ratio": MAX_RATIO,
    }


def _measure_bare_loop(subject: MissionUnderTest, log: Path, frames: TimedRecorder) -> float:
    """Return the wall time of the bare loop [s], without the time to build the world."""
    config = subject.loaded.cell_config
    world, commands = build_initial_world(config, subject.seed), list(read_commands(log))
    client, arm, joint_count = world.client, world.arm, world.robot.joint_count
    camera, model = next(iter(config.cameras.values())), OnnxModel(MODEL_PATH, read_labels(LABELS_PATH))
    size, matrix = (camera.width, camera.height), compute_calibration(camera)[0]
    frame_numbers = iter(range(1, frames.frame_counts.total() + 1))

    def capture_and_detect() -> None:
        image = render(world, matrix, get_camera_pose(world, camera), (0, 0, *size), CELL_LIGHT).image
        for view in frames.views[next(frame_numbers)]:
            for left, top, right, bottom in list_regions(view, camera.table_view, size):
                model.detect(image[top:bottom, left:right], 0.5)

    step, start_time = 0, time.perf_counter()
    for command in commands:
        if command.kind == JOINT_TARGETS:
            client.setJointMotorControlArray(
                arm, range(joint_count), pybullet.POSITION_CONTROL, targetPositions=command.numbers[1:],
                forces=world.robot.max_torques, positionGains=[1.0] * joint_count,
            )  # fmt: skip
        elif command.kind in (RUN_STEP, IDLE_STEP):
            client.stepSimulation()
            step += command.kind == RUN_STEP
            for _ in range(frames.frame_counts[step] if command.kind == RUN_STEP else 0):
                capture_and_detect()
    bare_time = time.perf_counter() - start_time
    world.close()
    return bare_time


if __name__ == "__main__":
    run_command(measure)

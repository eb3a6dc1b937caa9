"""Yaws of objects, measured in rendered images of a camera, compared with the true yaws.

Each image shows a scene with which a run begins, with the image noise of the cell file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import closing

import numpy as np

from executive.cell.config import CellConfig
from executive.cell.devices import TrueObject
from executive.cell.frame import Detection, Detections, Frame, assume_rates
from executive.drivers.sim.camera import CELL_LIGHT, add_depth_noise, add_noise, get_camera_pose, render
from executive.drivers.sim.models import compute_bounding_box, load_mesh
from executive.drivers.sim.spawn import spawn_objects
from executive.drivers.sim.world import World
from executive.geometry import Yaw
from executive.perception.camera_model import compute_calibration, project
from executive.perception.localization import CellLocalizer
from executive.text.files import find_cell
from executive.training.evaluate import EvaluatedDetector
from tests.benchmarks.report import Figures, run_command, show_progress

BOX_STD = 0.6
"""Standard deviation of the sides of true boxes with errors [pixel]."""
MAX_BOX_ERROR = 4.0
"""Maximum difference between the sides of a detected box and those of the true box of its object [pixel]."""
LIMITS = {"cube": (0.5, 2.0), "duck": (3.0, 6.0)}
"""Limits of the median and of the 95th percentile of the error in the cell `overhead`, by class [degree]."""

TrueBoxes = Sequence[tuple[TrueObject, Detection]]
"""Objects of a scene with their true boxes."""
Comparison = tuple[float, Yaw | None]
"""True yaw of an object [rad], and its measured yaw."""


def measure(cell: CellConfig, images: int = 140, seed: int = 0, true_boxes: bool = False) -> Figures:
    """Measure the yaws of the objects of CELL in the boxes of its detector.

    With `--true-boxes`, the boxes are the true ones with random errors. A problem is an error above the limit
    of its class.
    """
    name, section = next(iter(cell.detectors.items()))
    camera = next(iter(cell.cameras.values()))
    classes = cell.build_classes()
    localizer = CellLocalizer(cell.localization, classes, measures_yaw=True)
    comparisons: dict[str, list[Comparison]] = {label: [] for label in classes if classes[label].yaw_symmetry}
    folder = find_cell(cell.cell).parent
    with (
        closing(World(cell)) as world,
        closing(EvaluatedDetector(cell.detectors, name, base=folder, camera=camera)) as detector,
    ):
        for number in show_progress(range(images), "measuring"):
            rng = np.random.default_rng([seed, number])
            frame, objects = render_scene(world, cell, rng)
            if true_boxes:
                found = [detection.shift(*rng.normal(0, BOX_STD, 2)) for _, detection in objects]
            else:
                found = [each for each in detector.detect(frame)[0] if each.confidence >= section.threshold]
            area = camera.get_view_box("table")
            rates = assume_rates(section.threshold, "")
            look = Detections(name, tuple(found), rates, frame=frame, view="table", area=area)
            for label, comparison in compare(look, objects, localizer):
                if label in comparisons:
                    comparisons[label].append(comparison)
    limits = LIMITS if cell.cell == "overhead" else {}
    rows = [
        describe_class(label, each, limits.get(label, (math.inf, math.inf)))
        for label, each in comparisons.items()
        if each
    ]
    problems = [f"{row['class']}: {row['limits']}" for row in rows if row["limits"]]
    return {"cell": cell.cell, "seed": seed, "images": images, "classes": rows, "problems": problems}


def render_scene(world: World, cell: CellConfig, rng: np.random.Generator) -> tuple[Frame, TrueBoxes]:
    """Put new objects on the table, and return an image of them, and the objects with their boxes."""
    camera_name, camera = next(iter(cell.cameras.items()))
    q = np.radians(cell.arm.poses_deg[camera.scan_poses[0]])
    for body in tuple(world.labels):
        world.remove_object(body)
    world.set_joint_positions(q)
    bodies = spawn_objects(world, int(rng.integers(2**32)))
    world.set_joint_positions(q)  # The arm may have sagged.
    matrix, _ = compute_calibration(camera)
    X_WC = get_camera_pose(world, camera)
    rendered = render(world, matrix, X_WC, (0, 0, camera.width, camera.height), CELL_LIGHT)
    image = add_noise(rendered.image, camera.noise, rng)
    depth = add_depth_noise(rendered.depth, camera.depth, rng) if camera.depth else None
    visible = np.ones(image.shape[:2], bool)
    frame = Frame(1, camera_name, image, depth, matrix, X_WC, 0.0, visible, 0)
    objects = []
    for body in bodies:
        true_object = world.describe_object(body)
        vertices = true_object.X_WO.apply(load_mesh(world.models[body]).vertices)
        box = compute_bounding_box(project(matrix, X_WC, vertices))
        objects.append((true_object, Detection(true_object.label, 1.0, box)))
    return frame, objects


def compare(
    look: Detections, objects: TrueBoxes, localizer: CellLocalizer
) -> Iterator[tuple[str, Comparison]]:
    """Yield the label and the true and measured yaw of each object with a detection of its class."""
    for observation in localizer.localize(look):
        detection = observation.detection
        candidates = [
            true_object
            for true_object, true_detection in objects
            if true_object.label == detection.label
            and np.abs(np.subtract(true_detection.box, detection.box)).max() <= MAX_BOX_ERROR
        ]
        # Of a stack of two objects of a class, the image shows the upper one.
        if candidates:
            rotation = max(candidates, key=lambda each: each.position[2]).X_WO.rotation
            yield detection.label, (math.atan2(rotation[1, 0], rotation[0, 0]), observation.yaw)


def describe_class(label: str, comparisons: Sequence[Comparison], limits: tuple[float, float]) -> Figures:
    """Return the row of a class; `limits` names those of median and 95th percentile that it exceeds."""
    pairs = [(true_yaw, yaw) for true_yaw, yaw in comparisons if yaw is not None]
    errors = np.array([math.remainder(yaw.angle - true, math.tau / yaw.symmetry) for true, yaw in pairs])
    stds = np.array([yaw.std for _, yaw in pairs])
    errors_deg = np.degrees(np.abs(errors))
    median = float(np.quantile(errors_deg, 0.5))
    percentile = float(np.quantile(errors_deg, 0.95))
    exceeded = {"median": median > limits[0], "95th percentile": percentile > limits[1]}
    return {
        "class": label,
        "objects": len(comparisons),
        "without yaw %": 100 * (1 - len(pairs) / len(comparisons)),
        "bias deg": float(np.degrees(np.median(errors))),
        "median deg": median,
        "95 % deg": percentile,
        "max deg": float(errors_deg.max()),
        "std deg": float(np.degrees(np.median(stds))),
        "within 2 std %": 100 * float(np.mean(np.abs(errors) <= 2 * stds)),
        "within 4 std %": 100 * float(np.mean(np.abs(errors) <= 4 * stds)),
        "limits": ", ".join(name for name, is_exceeded in exceeded.items() if is_exceeded),
    }


if __name__ == "__main__":
    run_command(measure)

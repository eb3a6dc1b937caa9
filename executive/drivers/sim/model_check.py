"""Checks of the models of a cell: sizes, grasp points, rest on a table, and the hold of the tool on them."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from executive.arms.urdf import find_model
from executive.cell.config import CellConfig, ObjectConfig
from executive.cell.tools import CONTACT_SPACING
from executive.drivers.sim.models import (
    DROP_HEIGHT,
    SETTLING_STEP_COUNT,
    add_body,
    build_drop_world,
    compute_mass,
    draw_silhouette,
    load_mesh,
    load_unknown_model,
    locate_object,
    place_mesh,
)
from executive.errors import InputError
from executive.geometry import Pose, make_tool_down_pose
from executive.perception.yaw import choose_skewness
from executive.physics import model_files
from executive.processes import build_command
from executive.text.validate import KeyPath

SIZE_TOLERANCE = 0.003
"""Maximum difference between a size in a cell file and the size of the model [m]."""
TRIAL_TIMEOUT = 30
"""Maximum duration of the trial of a model, with the start of the process [s]."""
MAX_REST_ERROR = 0.005
"""Maximum distance of visual, collision shape and declared heights from each other at rest [m]."""


def measure_hold(config: CellConfig, label: str) -> float:
    """Return the largest force with which the tool can hold each model of a class [N].

    The tool is at the places of the first attempts: at a grasp point, on the ring or near the middle.
    """
    return min(_measure_hold(config, section) for section in config.objects[label].list_models())


def _measure_hold(config: CellConfig, section: ObjectConfig) -> float:
    mesh = load_mesh(section)
    X_WO = Pose.of([0.0, 0.0, -mesh.bottom])
    middle_x, middle_y = ((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))[:2] / 2).tolist()
    offsets = [(x, y) for x in (0.0, -CONTACT_SPACING, CONTACT_SPACING) for y in (0.0, CONTACT_SPACING)]
    places = [grasp.point[:2] for grasp in section.grasps] or [(section.ring + x, y) for x, y in offsets]
    client = build_drop_world()
    body = add_body(client, section, X_WO)
    client.performCollisionDetection()  # Rays do not hit a new body.
    forces = [0.0]
    for x, y in places:
        if math.isfinite(top := mesh.measure_top(x, y)):
            X_WT = make_tool_down_pose((middle_x + x, middle_y + y, top))
            forces.append(config.tool.measure_hold(client, X_WT, body))
    return max(forces)


def find_model_errors(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message for each model of an object that is missing, invalid, or of a wrong size.

    A child process tries each model that is not shipped with the executive or PyBullet; this process reads
    the model afterwards, because reading may take very long.
    """
    for label, section in config.objects.items():
        for index, object_config in enumerate(section.list_models()):
            try:
                path = find_model(object_config.mesh or object_config.urdf)
                if not model_files.is_shipped(path):
                    _try_in_child_process(object_config, path, path.stat().st_mtime_ns)
                compute_mass(object_config)
                for key, message in _find_wrong_sizes(label, object_config):
                    yield ("objects", label, "variants", index - 1) if index else key, message
            except InputError as error:
                keys = ("mesh" if section.mesh else "urdf",) if index == 0 else ("variants", index - 1)
                yield ("objects", label, *keys), str(error)
    for mesh in config.unknown.meshes:
        try:
            load_unknown_model(mesh)
        except InputError as error:
            yield ("unknown", "meshes"), str(error)


def _find_wrong_sizes(label: str, config: ObjectConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield key and message if the declared height or radius of a class differs from that of its model.

    The executive computes the centre, the top and the free space of an object from height and radius.
    """
    mesh = load_mesh(config)
    has_size = True
    for name, model_size in (("height", mesh.top - mesh.bottom), ("radius", mesh.radius)):
        declared_size = getattr(config, name)
        if not abs(declared_size - model_size) <= SIZE_TOLERANCE:  # also True for NaN
            message = f"the model of {label} has a {name} of {model_size:.4f} m, not {declared_size:g} m; "
            yield ("objects", label, name), message + f"correct {name}, scale or upright_deg"
            has_size = False
    for x, y, z in (grasp.point for grasp in config.grasps):
        if z > (top := mesh.measure_top(x, y)) + SIZE_TOLERANCE:
            surface = f"the surface is {top * 1000:.1f} mm high" if top >= 0 else "there is no surface"
            message = f"the grasp point {x:g}, {y:g}, {z:g} m is outside of the {label}: {surface} there"
            yield ("objects", label, "grasp"), message
    if config.yaw_symmetry == 1 and has_size:
        outlines, _ = cv2.findContours(
            draw_silhouette(mesh, mesh.vertices[:, :2] * 1000), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        outline = max(outlines, key=cv2.contourArea)[:, 0]
        offset = config.build_class(label).yaw_offset
        skewness = choose_skewness(outline @ [1, 1j] * np.exp(-1j * offset))
        if not skewness:
            message = f"no outline shows a half turn of the model of {label}; write yaw_symmetry: 2"
            yield ("objects", label, "yaw_symmetry"), message
        elif skewness < 0:
            turned = math.degrees(math.remainder(offset + math.pi, math.tau))
            message = f"the narrower end or the ends of the bend of the model of {label} point the other way"
            yield ("objects", label, "yaw_symmetry"), f"{message}; write yaw_offset_deg: {turned:g}"
    if config.footprint is None:
        return
    corners = cv2.convexHull(mesh.vertices[:, :2].astype(np.float32))[:, 0] @ [1, 1j]
    turned = corners * np.exp(1j * np.radians(np.arange(90)))[:, None]
    sides = np.sort(np.stack([np.ptp(turned.real, axis=1), np.ptp(turned.imag, axis=1)], axis=1), axis=1)
    errors = np.abs(sides - np.sort(config.footprint)).max(axis=1)
    if not errors.min() <= SIZE_TOLERANCE:
        width, length = sides[errors.argmin()].tolist()
        message = f"the model of {label} has a footprint of {length:.4f} by {width:.4f} m, not "
        yield (
            ("objects", label, "footprint"),
            message + " by ".join(f"{side:g}" for side in config.footprint) + " m",
        )


@lru_cache(maxsize=64)
def _try_in_child_process(config: ObjectConfig, path: Path, _change_time: int) -> None:
    """Call `try_model` in a child process, which the model at `path` may crash or keep busy.

    `_change_time` distinguishes versions of the file; the cache contains only models without errors.

    Raises:
        InputError: The child process crashed or took too long, or `try_model` failed.
    """
    command = build_command(__name__, config.model_dump_json())
    crash = f"the model {path.name} crashes PyBullet, or takes over {TRIAL_TIMEOUT} s; simplify its meshes"
    with tempfile.TemporaryDirectory() as folder:  # a crash would leave the files of `convert_model`
        environment = {**os.environ, "TMPDIR": folder}
        try:
            trial = subprocess.run(
                command, capture_output=True, text=True, timeout=TRIAL_TIMEOUT, env=environment, check=False
            )
        except subprocess.TimeoutExpired:
            raise InputError(crash) from None
    if trial.returncode < 0:  # a signal ended the process
        raise InputError(crash)
    if trial.returncode:
        message = trial.stderr.partition("InputError: ")[2].strip()
        reason = trial.stderr.strip().rpartition("\n")[2]
        raise InputError(message or f"the trial of the model {path.name} failed: {reason}")


def try_model(config: ObjectConfig) -> None:
    """Drop a model of the declared size on a table, and compare its shapes at rest with its class.

    Raises:
        InputError: PyBullet cannot load the model, or the model does not lie as its class declares.
    """
    compute_mass(config)
    if [*_find_wrong_sizes("", config)]:
        return  # the caller reports the sizes
    client = build_drop_world()
    mesh = load_mesh(config)
    place_mesh(config, Pose.identity(), "collision")  # refuses shapes that PyBullet would ignore
    body = add_body(client, config, Pose.of([0, 0, DROP_HEIGHT - mesh.bottom]))
    for _ in range(SETTLING_STEP_COUNT):
        client.stepSimulation()
    vertices = locate_object(client, body, config).apply(mesh.vertices)
    visual = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    centre, _ = client.getBasePositionAndOrientation(body)
    lower, upper = (visual.round(3) + 0.0).tolist()  # the sum replaces -0.0 by 0.0
    problem = f"the model {Path(config.mesh or config.urdf).name} lies on the table with"
    # Each condition is also true for NaN.
    if not ((visual[0] <= centre).all() and (centre <= visual[1]).all()):
        place = f"its centre of mass at {np.round(centre, 3).tolist()} m, outside of its visual"
        raise InputError(f"{problem} {place}, {lower} to {upper} m; correct <inertial>")
    if not np.abs(visual[:, 2] - [0, config.height]).max() <= MAX_REST_ERROR:
        heights = f"z of its visual from {lower[2]:g} to {upper[2]:g} m, not 0 to {config.height:g} m"
        raise InputError(f"{problem} {heights}; correct <collision>, <inertial> or upright_deg")
    if not (difference := np.abs(client.getAABB(body) - visual).max()) <= MAX_REST_ERROR:
        box = f"a box around its collision shape that differs by {difference:.3f} m from that of its visual"
        raise InputError(f"{problem} {box}, more than {MAX_REST_ERROR:g} m; correct <collision> or <visual>")


if __name__ == "__main__":
    try_model(ObjectConfig.model_validate_json(sys.argv[1]))

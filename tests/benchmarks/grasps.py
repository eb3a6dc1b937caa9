"""Grasps of a gripper with wrong places and angles, and its holds at the limit of friction, without planning.

The arm of the cell `overhead` serves as a gantry: it moves the tool down over the object, up, and sideways,
along lines in given times.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh

from executive.cell.arm import Goal
from executive.cell.config import CellConfig
from executive.cell.device_config import STEP
from executive.cell.objects import ObjectClass, Target
from executive.cell.tools import GraspAttempt, GraspPose
from executive.drivers.sim.models import load_mesh
from executive.drivers.sim.world import World
from executive.geometry import GRAVITY, Array, Pose, Yaw, make_tool_down_pose, rotate_about_z
from executive.mission.cell_file import load_cell
from executive.motion.configurations import find_configuration_pairs
from executive.motion.joints import build_planning_kinematics
from executive.text.files import find_cell
from tests.benchmarks.report import Figures, run_command, show_progress

POSITION_STD = 0.002
"""Standard deviation of the error of a position along x and y [m]."""
YAW_STD = math.radians(2.5)
"""Standard deviation of the error of a yaw [rad]."""
LIFT = 0.20
"""Height of the lift [m]."""
TRANSIT = 0.35
"""Length of the sideways motion [m]; its largest acceleration is 1 g."""
MIN_HELD_FRACTION = 0.99
"""Limit of the share of the grasps that hold the object until the end."""
MAX_MEDIAN_SLIP = {"duck": 0.002}
"""Limit of the median slip by class [m]; 1 mm for other classes."""
MAX_DETECTION_TIME = 0.1
"""Limit of the time from the loss of an object to its report by the sensor [s]."""
PEAK_ACCELERATION = 10 / math.sqrt(3)
"""Largest acceleration of a motion with minimum jerk over a length of 1 m in 1 s [m/s²]."""
LIMIT_CASES = {
    "0.9 of the limit": (0.9, 1.0, 1.0),
    "1.1 of the limit": (1.1, 1.0, 1.0),
    "0.45 of the limit, but twice the mass": (0.45, 2.0, 1.0),
    "0.55 of the limit, but twice the mass": (0.55, 2.0, 1.0),
    "0.45 of the limit, but half the friction": (0.45, 1.0, 0.5),
    "0.55 of the limit, but half the friction": (0.55, 1.0, 0.5),
}
"""Ratio of the declared weight of a cube to the friction of the fingers, and ratios of true mass and friction
to the declared ones, by case."""
BENT_BAR = ((-0.05, 0.0), (0.0, 0.012), (0.05, 0.0))
"""Middle line of a bent bar [m]."""
OTHER_CLASSES = """
  ball: {mesh: ball.obj, height: 0.07, radius: 0.035, mass: 0.15}
  cylinder: {mesh: cylinder.obj, height: 0.1, radius: 0.03, mass: 0.15, flat_top: true}
  bent_bar:
    mesh: bar.obj
    height: 0.02
    radius: 0.052
    mass: 0.1
    footprint: [0.104, 0.03]
    grip_widths: [0.014, 0.034]
"""
"""Classes beside those of the shipped cells."""


@dataclass
class Gantry:
    """The simulated arm of the cell `overhead` with the tool of another cell, which it moves along lines."""

    cell: CellConfig

    def __post_init__(self) -> None:
        carrier = load_cell(find_cell("overhead"))
        self.cell = carrier.model_copy(update={"tool": self.cell.tool, "objects": self.cell.objects})
        self.world = World(self.cell)
        self.tool = self.cell.tool.build_sim(self.world, 0)
        self._kinematics = build_planning_kinematics(self.cell)
        self._start = np.radians(self.cell.arm.poses_deg["home"])
        self._q = self._start
        self.body: int | None = None
        self.hold_steps: list[tuple[bool, bool]] = []
        """For each step since the closing: whether fingers touch the object, and the sensor reports it."""

    def close(self) -> None:
        """Close the simulation."""
        self.world.close()

    def wait(self, duration: float) -> None:
        """Simulate a time [s]."""
        for _ in range(round(duration / STEP)):
            self._step()

    def _step(self) -> None:
        self.world.step()
        self.tool.advance()
        if self.body is not None:
            contacts = self.world.client.getContactPoints(bodyA=self.world.arm, bodyB=self.body)
            self.hold_steps.append((bool(contacts), self.tool.holding))

    def put(self, label: str, X_WO: Pose, mass: float = 0.0, friction: float = 0.0) -> int:
        """Put an object on the table, let it come to rest, and return its body; 0: the value of the model."""
        self.tool.open(self.cell.tool.max_opening)
        self.world.set_joint_positions(self._start)
        self.world.command_arm(self._start)
        body = self.world.add_object(label, X_WO, (1.0, 1.0, 1.0))
        if mass:
            self.world.client.changeDynamics(body, -1, mass=mass)
        if friction:
            self.world.client.changeDynamics(body, -1, lateralFriction=friction)
        self.wait(0.25)
        return body

    def approach(self, grasp: GraspPose) -> None:
        """Move the tool at once to the height `LIFT` above a grasp, open the fingers, and move down."""
        goal = grasp.goal
        self._position = np.add(goal.position, (0, 0, LIFT))
        candidates = []
        for yaw in goal.yaws or (0.0,):
            turned = Goal(goal.position, (yaw,))
            pairs = find_configuration_pairs(self._kinematics, turned, LIFT, self._start)
            turns = np.abs(pairs.upper_qs[:, -1])
            best = int(turns.argmin())
            candidates.append((float(turns[best]), yaw, pairs.branches[best]))
        # The last joint turns most on the way, so it starts far from its limits.
        nearest = min(candidates, key=lambda candidate: candidate[0])
        self._yaw = nearest[1]
        self._branch = nearest[2]
        q = self._solve([self._position])[0]
        self._q = q
        self.world.set_joint_positions(q)
        self.world.command_arm(q)
        self.tool.open(grasp.opening)
        self.wait(0.9)
        self.move((0, 0, -LIFT), 0.8)

    def move(self, offset: Sequence[float], duration: float) -> None:
        """Move the tool by an offset [m] in a time [s], with minimum jerk."""
        times = np.linspace(0, 1, round(duration / STEP) + 1)[1:, None]
        fractions = 10 * times**3 - 15 * times**4 + 6 * times**5
        positions = self._position + fractions * np.array(offset)
        # The solver returns angles between -180 and 180 degrees.
        for q in np.unwrap([self._q, *self._solve(positions)], axis=0)[1:]:
            self._q = q
            self.world.command_arm(q)
            self._step()
        self._position = positions[-1]

    def _solve(self, positions: Sequence[Array] | Array) -> Array:
        poses = [make_tool_down_pose(tuple(position), self._yaw) for position in positions]
        return self._kinematics.solve(poses, self._branch)

    def grip(self, body: int) -> None:
        """Close the fingers until they rest."""
        self.body = body
        self.hold_steps = []
        self.tool.close()
        self.wait(0.9)

    def locate(self, body: int) -> Pose:
        """Return the pose of an object in the frame of the tool."""
        return self.world.get_tool_pose().inverse() @ self.world.get_object_pose(body)

    def remove(self, body: int) -> None:
        """Open the fingers, and remove an object."""
        self.body = None
        self.tool.open()
        self.wait(0.05)
        self.world.remove_object(body, is_counted=False)


def measure(cell: CellConfig, grasps: int = 200, seed: int = 0) -> Figures:
    """Measure the grasps of CELL, which has a gripper: objects held after a transit, and their slip.

    The objects are those of the cell, a bolt, a ball of 70 mm, a cylinder of 60 x 100 mm and a bent bar.
    Places and yaws have random errors. A second table compares holds with those that Coulomb's law predicts.
    """
    with tempfile.TemporaryDirectory() as folder:
        extended = extend_cell(cell, Path(folder))
        with closing(Gantry(extended)) as gantry:
            rows = [
                measure_class(gantry, label, grasps, np.random.default_rng([seed, index]))
                for index, label in enumerate(show_progress(list(extended.objects), "grasping"))
            ]
    limits = [measure_limit(cell, name, *case) for name, case in LIMIT_CASES.items()]
    problems = [f"{row['class']}: {row['limits']}" for row in rows if row["limits"]]
    problems += [f"{row['case']}: {row['limits']}" for row in limits if row["limits"]]
    return {"cell": cell.cell, "seed": seed, "classes": rows, "friction": limits, "problems": problems}


def extend_cell(cell: CellConfig, folder: Path) -> CellConfig:
    """Return a cell with the further classes, whose meshes are written to a folder."""
    (folder / "ball.obj").write_text(trimesh.creation.icosphere(3, 0.035).export(file_type="obj"))
    cylinder = trimesh.creation.cylinder(0.03, 0.1, sections=48)
    (folder / "cylinder.obj").write_text(cylinder.export(file_type="obj"))
    # The simulator makes a convex hull of each part.
    parts = [make_bar(start, end) for start, end in pairwise(BENT_BAR)]
    (folder / "bar.obj").write_text(write_parts(parts))
    path = folder / "grasps.yaml"
    path.write_text(f"base: {cell.cell}.yaml\ncell: grasps\nobjects:{OTHER_CLASSES}")
    others = dict(load_cell(path).objects)
    bolt = load_cell(find_cell("fasteners")).objects["bolt"]
    return cell.model_copy(update={"objects": {**cell.objects, "bolt": bolt, **others}})


def make_bar(start: tuple[float, float], end: tuple[float, float]) -> trimesh.Trimesh:
    """Return an upright prism, 16 mm wide and 20 mm high, between two points of its middle line [m]."""
    along = np.subtract(end, start)
    across = 0.008 * np.array([-along[1], along[0]]) / np.linalg.norm(along)
    base = np.array([start + across, start - across, end + across, end - across])
    points = [(x, y, z) for x, y in base - (0, 0.006) for z in (-0.01, 0.01)]
    return trimesh.convex.convex_hull(np.array(points))


def write_parts(parts: Sequence[trimesh.Trimesh]) -> str:
    """Return a Wavefront file with one group per part."""
    lines = []
    first = 1
    for index, part in enumerate(parts):
        lines.append(f"o part_{index}")
        lines.extend(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in part.vertices)
        lines.extend("f " + " ".join(str(first + corner) for corner in face) for face in part.faces)
        first += len(part.vertices)
    return "\n".join(lines) + "\n"


def measure_class(gantry: Gantry, label: str, grasps: int, rng: np.random.Generator) -> Figures:
    """Return the row of a class: grasps with random errors that held the object, and its slip."""
    object_class = gantry.cell.objects[label].build_class(label)
    if refusal := gantry.cell.tool.explain_unsuitable(object_class):
        return {"class": label, "grasps": 0, "held %": 0.0, "limits": refusal}
    slips = []
    turns = []
    held_count = 0
    for _ in range(grasps):
        body = gantry.put(label, draw_pose(gantry.cell, object_class, rng))
        gantry.approach(choose_grasp(gantry, object_class, body, rng))
        gantry.grip(body)
        before = gantry.locate(body)
        gantry.move((0, 0, LIFT), 0.6)
        side = -1 if gantry.world.get_tool_pose().position[1] > 0 else 1
        gantry.move((0, side * TRANSIT, 0), math.sqrt(TRANSIT * PEAK_ACCELERATION / GRAVITY))
        gantry.wait(0.4)
        after = gantry.locate(body)
        if gantry.tool.holding and gantry.world.get_object_pose(body).position[2] > LIFT / 2:
            held_count += 1
            slips.append(float(np.linalg.norm(after.position - before.position)))
            turns.append(measure_turn(before, after))
        gantry.remove(body)
    slip = float(np.median(slips or [math.inf]))
    limits = {
        "held": held_count < MIN_HELD_FRACTION * grasps,
        "slip": slip > MAX_MEDIAN_SLIP.get(label, 0.001),
    }
    return {
        "class": label,
        "grasps": grasps,
        "held %": 100 * held_count / grasps,
        "median slip mm": 1000 * slip,
        "max slip mm": 1000 * max(slips, default=math.inf),
        "median turn deg": float(np.degrees(np.median(turns or [math.inf]))),
        "limits": ", ".join(name for name, is_exceeded in limits.items() if is_exceeded),
    }


def draw_pose(cell: CellConfig, object_class: ObjectClass, rng: np.random.Generator) -> Pose:
    """Return a random pose on the table."""
    position = (rng.uniform(0.45, 0.52), rng.uniform(-0.1, 0.1), object_class.height / 2 + 0.001)
    return Pose(rotate_about_z(rng.uniform(-math.pi, math.pi)), np.array(position))


def choose_grasp(gantry: Gantry, object_class: ObjectClass, body: int, rng: np.random.Generator) -> GraspPose:
    """Return the best grasp of an object whose place and yaw have random errors."""
    true_pose = gantry.world.get_object_pose(body)
    angle = math.atan2(true_pose.rotation[1, 0], true_pose.rotation[0, 0]) + rng.normal(0, YAW_STD)
    vertices = true_pose.apply(load_mesh(gantry.world.models[body]).vertices)
    centre = (vertices.min(axis=0) + vertices.max(axis=0))[:2] / 2
    position = np.append(centre + rng.normal(0, POSITION_STD, 2), object_class.height / 2)
    yaw = Yaw(angle, YAW_STD) if object_class.yaw_symmetry else None
    target = Target("object-1", object_class.label, position, 1.0, 0, 0, 0.0, yaw=yaw)
    return gantry.cell.tool.list_grasps(object_class, target, gantry.cell.motion, GraspAttempt())[0]


def measure_turn(before: Pose, after: Pose) -> float:
    """Return the angle between two poses [rad]."""
    cosine = (np.trace(before.rotation.T @ after.rotation) - 1) / 2
    return math.acos(min(max(float(cosine), -1.0), 1.0))


def measure_limit(
    cell: CellConfig, case: str, weight_ratio: float, mass_ratio: float, friction_ratio: float
) -> Figures:
    """Return the row of a hold of a heavy cube in a slow lift, compared with Coulomb's law.

    The arguments are as in `LIMIT_CASES`.
    """
    cube = cell.objects["cube"].build_class("cube")
    limit = cell.tool.compute_holding_force(cube, cell.tool.max_holding_force)
    is_held_predicted = weight_ratio * mass_ratio / friction_ratio < 1
    with closing(Gantry(cell)) as gantry:
        pose = Pose.of((0.48, 0.0, cube.height / 2 + 0.001))
        mass = weight_ratio * mass_ratio * limit / GRAVITY
        body = gantry.put("cube", pose, mass=mass, friction=friction_ratio * cube.friction)
        target = Target("cube-1", "cube", pose.position, 1.0, 0, 0, 0.0, yaw=Yaw(0.0, 0.0, 4))
        grasp = cell.tool.list_grasps(cube, target, cell.motion, GraspAttempt())[0]
        gantry.approach(grasp)
        gantry.grip(body)
        gantry.move((0, 0, LIFT), 4.0)
        gantry.wait(1.0)
        is_held = bool(gantry.world.get_object_pose(body).position[2] > LIFT / 2)
        delay = measure_detection(gantry.hold_steps)
    limits = {
        "hold": is_held != is_held_predicted,
        "sensor": is_held != gantry.tool.holding or delay > MAX_DETECTION_TIME,
    }
    return {
        "case": case,
        "predicted": "held" if is_held_predicted else "slips",
        "measured": "held" if is_held else "slips",
        "detected after s": delay,
        "limits": ", ".join(name for name, is_exceeded in limits.items() if is_exceeded),
    }


def measure_detection(hold_steps: Sequence[tuple[bool, bool]]) -> float:
    """Return the time from the last contact with an object to the report of its loss [s]; 0: no loss."""
    contacts = [index for index, (is_touching, _) in enumerate(hold_steps) if is_touching]
    reports = [index for index, (_, is_holding) in enumerate(hold_steps) if is_holding]
    if not contacts or not reports or contacts[-1] >= len(hold_steps) - 2:
        return 0.0
    return max(reports[-1] - contacts[-1], 0) * STEP


if __name__ == "__main__":
    run_command(measure)

"""Skill that moves the arm to a named pose of the cell, for instance to a scan pose."""

from __future__ import annotations

from executive.cell.protocols import Cell, Steps
from executive.manipulation.motions import follow, make_task, plan, wait_for_rest
from executive.skill import Skill, param


class MoveToScan(Skill):
    """Move the arm to a pose of the cell, for instance to a pose from which the camera sees the workspace.

    With `auto`, the arm does not move if the camera already sees the whole workspace. The skill does not
    check the view after the motion: `executive check` verifies that the scan poses of a simulated cell show
    the whole workspace.
    """

    pose: str = param(
        "auto",
        refers_to="pose",
        choices=("auto", "next"),
        doc="an arm pose of the cell; `auto`: the first scan pose, if needed; `next`: the next scan pose",
    )
    reasons = ("unreachable", "blocked")
    uses = ("arm",)
    moves = True

    def run(self, cell: Cell) -> Steps:
        """Select the pose and move to it."""
        yield from wait_for_rest(cell.arm)
        pose = self.pose
        if pose == "auto":
            if cell.camera.sees_table():
                return
            pose = cell.camera.scan_poses[0]
        elif pose == "next":
            pose = cell.camera.next_pose()
        motion = yield from plan(self, cell.arm, lambda: (pose, make_task(cell)))
        yield from follow(self, cell, motion)

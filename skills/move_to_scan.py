"""Skill that moves the arm to a named pose of the cell, for instance to a scan pose."""

from __future__ import annotations

from executive.cell.protocols import Camera, Cell, Steps
from executive.manipulation.motions import move_to_pose
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
        """Select the pose when the arm is at rest, and move to it."""
        return move_to_pose(self, cell, lambda: self._select_pose(cell.camera))

    def _select_pose(self, camera: Camera) -> str | None:
        """Return the name of the pose, or None if the arm need not move."""
        if self.pose == "auto":
            return None if camera.sees_table() else camera.scan_poses[0]
        return camera.next_pose() if self.pose == "next" else self.pose

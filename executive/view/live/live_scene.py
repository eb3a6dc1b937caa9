"""Three-dimensional scene of the cell: a viser server on a Unix socket, which browsers cannot open."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import viser
import websockets.asyncio.server

from executive.cell.visuals import Shape

CAMERA_POSITION, CAMERA_TARGET = (1.35, -0.68, 0.95), (0.33, 0.0, 0.2)
"""Initial position of the virtual camera, and the point at which it looks, in the world frame [m]."""
BACKGROUND = (243, 245, 248)
"""Colour of the background, RGB, 0 to 255."""


class LiveScene:
    """A viser server that shows shapes, some of which are attached to moving bodies.

    Args:
        path: Unix socket of the server; no other socket is opened, because viser does not check who connects.
        shapes: The shapes, which are attached to a body or fixed in the world.
    """

    def __init__(self, path: Path, shapes: Sequence[Shape]) -> None:
        with _serve_on_unix_socket(path):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self._bodies: dict[str, viser.FrameHandle] = {}
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        # Shadows and reflections are off, because they are slow in browsers without a graphics card.
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light", intensity=1.6)
        scene.set_background_image(np.full((1, 1, 3), BACKGROUND, np.uint8))
        self._server.initial_camera.position = CAMERA_POSITION
        self._server.initial_camera.look_at = CAMERA_TARGET
        self._server.gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        # The control panel of viser is hidden: the page itself has the buttons.
        self._server.gui.main_panel.minimize()
        for number, shape in enumerate(shapes):
            if shape.body and shape.body not in self._bodies:
                self._bodies[shape.body] = self._server.scene.add_frame(
                    _make_scene_path(shape.body), show_axes=False
                )
            parent = _make_scene_path(shape.body) if shape.body else "/fixed"
            self._add_shape(f"{parent}/{number}", shape)

    def set_body_poses(self, poses: Mapping[str, Sequence[float]]) -> None:
        """Set the poses of bodies by name: position [m] and quaternion (w, x, y, z); hide other bodies."""
        with self._server.atomic():
            for name, frame in self._bodies.items():
                pose = poses.get(name)
                if frame.visible != (pose is not None):
                    frame.visible = pose is not None
                if pose is not None:
                    frame.position, frame.wxyz = np.array(pose[:3]), np.array(pose[3:])

    def _add_shape(self, name: str, shape: Shape) -> None:
        scene, colour = self._server.scene, shape.colour
        pose: dict[str, Any] = {"position": shape.X_BS.position, "wxyz": np.roll(shape.X_BS.quaternion, 1)}
        if shape.kind == "box":
            scene.add_box(name, color=colour, dimensions=shape.size, **pose)
        elif shape.kind == "cylinder":
            scene.add_cylinder(name, radius=shape.size[0] / 2, height=shape.size[2], color=colour, **pose)
        elif shape.kind == "sphere":
            scene.add_icosphere(name, radius=shape.size[0] / 2, color=colour, **pose)
        else:
            mesh = trimesh.load_mesh(shape.file, process=False, skip_materials=True)
            vertices = np.asarray(mesh.vertices) * shape.size
            scene.add_mesh_simple(name, vertices, np.asarray(mesh.faces), color=colour, **pose)


@contextlib.contextmanager
def _serve_on_unix_socket(path: Path) -> Iterator[None]:
    """Make viser servers created in this context listen on a Unix socket; viser has no option for this."""
    serve = websockets.asyncio.server.serve

    def serve_on_socket(handler: Any, host: Any, port: Any, **options: Any) -> Any:
        del host, port
        return serve(handler, unix=True, path=str(path), **options)

    websockets.asyncio.server.serve = serve_on_socket  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


def _make_scene_path(body: str) -> str:
    return "/bodies/" + body.replace(" ", "_").replace("/", "_")

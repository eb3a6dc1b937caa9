"""Three-dimensional scene of the cell: a viser server behind a Unix socket."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import viser
import websockets.asyncio.server

from executive.cell.devices import Shape

CAMERA_POSITION = (1.35, -0.68, 0.95)
"""Initial position of the virtual camera in the world frame [m]."""
CAMERA_TARGET = (0.33, 0.0, 0.2)
"""Point at which the virtual camera looks at first, in the world frame [m]."""
BACKGROUND = (243, 245, 248)
"""Colour of the background, RGB, 0 to 255."""


class LiveScene:
    """Viser server that shows fixed shapes and shapes on moving bodies.

    The server opens only the Unix socket `socket_path`, because viser has no access control.
    """

    def __init__(self, socket_path: Path, shapes: Sequence[Shape]) -> None:
        with _serve_on_unix_socket(socket_path):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self._bodies: dict[str, viser.FrameHandle] = {}
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        # Browsers without a graphics card draw shadows and reflections slowly.
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light", intensity=1.6)
        scene.set_background_image(np.full((1, 1, 3), BACKGROUND, np.uint8))
        self._server.initial_camera.position = CAMERA_POSITION
        self._server.initial_camera.look_at = CAMERA_TARGET
        self._server.gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        # The page has its own buttons instead of the control panel of viser.
        self._server.gui.main_panel.minimize()
        for number, shape in enumerate(shapes):
            if shape.body and shape.body not in self._bodies:
                self._bodies[shape.body] = scene.add_frame(_make_scene_path(shape.body), show_axes=False)
            parent = _make_scene_path(shape.body) if shape.body else "/fixed"
            self._add_shape(f"{parent}/{number}", shape)

    def set_body_poses(self, poses: Mapping[str, Sequence[float]]) -> None:
        """Set poses of bodies by name: position [m], quaternion (w, x, y, z); hide bodies without a pose."""
        with self._server.atomic():
            for name, frame in self._bodies.items():
                pose = poses.get(name)
                if frame.visible != (pose is not None):
                    frame.visible = pose is not None
                if pose is not None:
                    frame.position = np.array(pose[:3])
                    frame.wxyz = np.array(pose[3:])

    def _add_shape(self, path: str, shape: Shape) -> None:
        """Add a shape to the scene at `path`; the path without its last part is the path of the parent."""
        scene = self._server.scene
        radius = shape.size[0] / 2
        quaternion = np.roll(shape.X_BS.quaternion, 1)  # (x, y, z, w) becomes (w, x, y, z).
        options: dict[str, Any] = {
            "color": shape.colour, "position": shape.X_BS.position, "wxyz": quaternion,
        }  # fmt: skip
        if shape.kind == "box":
            scene.add_box(path, dimensions=shape.size, **options)
        elif shape.kind == "cylinder":
            scene.add_cylinder(path, radius=radius, height=shape.size[2], **options)
        elif shape.kind == "sphere":
            scene.add_icosphere(path, radius=radius, **options)
        else:
            mesh = trimesh.load_mesh(shape.file, process=False, skip_materials=True)
            vertices = np.asarray(mesh.vertices) * shape.size
            scene.add_mesh_simple(path, vertices, np.asarray(mesh.faces), **options)


@contextlib.contextmanager
def _serve_on_unix_socket(socket_path: Path) -> Iterator[None]:
    """Make viser, which has no option for a Unix socket, listen on a Unix socket in this context."""
    original_serve = websockets.asyncio.server.serve

    def serve_on_socket(handler: Any, host: Any, port: Any, **options: Any) -> Any:
        del host, port
        return original_serve(handler, unix=True, path=str(socket_path), **options)

    websockets.asyncio.server.serve = serve_on_socket  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = original_serve  # type: ignore[misc]


def _make_scene_path(body: str) -> str:
    return "/bodies/" + body.replace(" ", "_").replace("/", "_")

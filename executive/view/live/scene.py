"""Scene of the cell in three dimensions, by viser behind a socket that no browser can reach by itself."""

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

CAMERA, LOOK_AT = (1.35, -0.68, 0.95), (0.33, 0.0, 0.2)
"""Where a person's view begins, and what is in its middle [m]."""
BACKGROUND = (243, 245, 248)


class LiveScene:
    """A viser server that shows shapes.

    Args:
        path: The Unix socket it listens on, and nothing else: viser asks nobody who they are.
        shapes: The shapes.
    """

    def __init__(self, path: Path, shapes: Sequence[Shape]) -> None:
        with _listening_on(path):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self._bodies: dict[str, viser.FrameHandle] = {}
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        # Shadows and mirrored surroundings are what a browser without a graphics card draws slowest.
        scene.configure_default_lights(cast_shadow=False)
        scene.configure_environment_map(None)
        scene.add_light_ambient("/light", intensity=1.6)
        scene.set_background_image(np.full((1, 1, 3), BACKGROUND, np.uint8))
        self._server.initial_camera.position = CAMERA
        self._server.initial_camera.look_at = LOOK_AT
        self._server.gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        # There is nothing to be set: the page has the buttons.
        self._server.gui.main_panel.minimize()
        for number, shape in enumerate(shapes):
            if shape.body and shape.body not in self._bodies:
                self._bodies[shape.body] = self._server.scene.add_frame(_name(shape.body), show_axes=False)
            parent = _name(shape.body) if shape.body else "/fixed"
            self._add(f"{parent}/{number}", shape)

    def move(self, bodies: Mapping[str, Sequence[float]]) -> None:
        """Put bodies where they are: position [m] and quaternion (w, x, y, z); hide those that are gone."""
        with self._server.atomic():
            for name, frame in self._bodies.items():
                place = bodies.get(name)
                if frame.visible != (place is not None):
                    frame.visible = place is not None
                if place is not None:
                    frame.position, frame.wxyz = np.array(place[:3]), np.array(place[3:])

    def _add(self, name: str, shape: Shape) -> None:
        scene, colour = self._server.scene, shape.colour
        place: dict[str, Any] = {"position": shape.X_BS.position, "wxyz": np.roll(shape.X_BS.quaternion, 1)}
        if shape.kind == "box":
            scene.add_box(name, color=colour, dimensions=shape.size, **place)
        elif shape.kind == "cylinder":
            scene.add_cylinder(name, radius=shape.size[0] / 2, height=shape.size[2], color=colour, **place)
        elif shape.kind == "sphere":
            scene.add_icosphere(name, radius=shape.size[0] / 2, color=colour, **place)
        else:
            mesh = trimesh.load_mesh(shape.file, process=False, skip_materials=True)
            vertices = np.asarray(mesh.vertices) * shape.size
            scene.add_mesh_simple(name, vertices, np.asarray(mesh.faces), color=colour, **place)


@contextlib.contextmanager
def _listening_on(path: Path) -> Iterator[None]:
    """Have what viser serves meanwhile listen on a Unix socket, of which it has no notion."""
    serve = websockets.asyncio.server.serve

    def on_socket(handler: Any, host: Any, port: Any, **options: Any) -> Any:
        del host, port
        return serve(handler, unix=True, path=str(path), **options)

    websockets.asyncio.server.serve = on_socket  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


def _name(body: str) -> str:
    return "/bodies/" + body.replace(" ", "_").replace("/", "_")

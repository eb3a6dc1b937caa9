"""The scene, built when somebody first looks at it: before that it would cost the run for nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from executive.scenery import Shape

if TYPE_CHECKING:
    from executive.view.live.scene import Scene


class Stage:
    """Keeps what there is to be seen until there is a scene to show it.

    Args:
        path: The Unix socket that the scene is to listen on.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._shapes: Sequence[Shape] = ()
        self._told = asyncio.Event()
        self._bodies: Mapping[str, Sequence[float]] = {}
        self._scene: Scene | None = None
        self._building = asyncio.Lock()

    def show(self, shapes: Sequence[Shape]) -> None:
        """Show these shapes, to whoever looks already, too."""
        self._shapes = shapes
        self._told.set()

    def move(self, bodies: Mapping[str, Sequence[float]]) -> None:
        """Put bodies where they are: position [m] and quaternion (w, x, y, z)."""
        self._bodies = bodies
        if self._scene is not None:
            self._scene.move(bodies)

    async def ready(self) -> Path:
        """Return the socket at which the scene is, once it is known what to show."""
        await self._told.wait()
        async with self._building:
            if self._scene is None:
                # Half a second of imports and a second of meshes, during which others are served.
                scene = await asyncio.to_thread(self._build)
                scene.move(self._bodies)
                self._scene = scene
        return self._path

    def _build(self) -> Scene:
        from executive.view.live.scene import Scene

        scene = Scene(self._path)
        scene.show(self._shapes)
        return scene

"""Draws a few frames and says what one took; `python -m executive.cli.doctor.drawing tiny|egl`.

A process of its own: what an EGL driver does when it fails may take a whole process down.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec

import click

from executive.cli.output import stdout_kept_clean

FRAMES = 5
SIZE = (640, 480)
"""Width and height of a frame [pixel]."""


def tiny() -> Callable[[], object]:
    """Return what draws a frame of the overhead cell as a run does."""
    from executive.cli.cells import load_cells
    from executive.sim.camera import CELL_LIGHT, camera_pose, render
    from executive.sim.world import World
    from executive.vision.camera_model import calibrated

    config = load_cells(("overhead",))["overhead"]
    camera = next(iter(config.cameras.values()))
    world = World(config)
    matrix, _ = calibrated(camera)
    return lambda: render(world, matrix, camera_pose(world, camera), (0, 0, *SIZE), CELL_LIGHT)


def egl() -> Callable[[], object]:
    """Return what draws an empty scene by PyBullet's EGL plugin.

    Raises:
        ClickException: There is no such plugin, or it cannot be loaded.
    """
    import pybullet

    pybullet.connect(pybullet.DIRECT)
    spec = find_spec("eglRenderer")
    if spec is None or spec.origin is None:
        raise click.ClickException("this pybullet comes without it")
    if pybullet.loadPlugin(spec.origin, "_eglRendererPlugin") < 0:
        raise click.ClickException("it cannot be loaded")
    return lambda: pybullet.getCameraImage(*SIZE, renderer=pybullet.ER_BULLET_HARDWARE_OPENGL)


@click.command()
@click.argument("way", type=click.Choice(["tiny", "egl"]))
def main(way: str) -> None:
    """Print one line: what a frame took, the median of a few after the first [ms]."""
    times = []
    with stdout_kept_clean():
        draw = {"tiny": tiny, "egl": egl}[way]()
        for _ in range(1 + FRAMES):
            begun = time.perf_counter()
            draw()
            times.append(time.perf_counter() - begun)
    click.echo(json.dumps({"milliseconds": round(1000 * statistics.median(times[1:]), 2)}))
    sys.stdout.flush()


if __name__ == "__main__":
    main()

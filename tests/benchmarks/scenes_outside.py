"""Scenes outside of what the cell files declare, in groups of one kind of change each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

Scene = Mapping[str, object]
"""Content of a scene file without its name."""

OVERHEAD, WRIST = "sort_overhead", "sort_wrist"
MISSIONS = (OVERHEAD, WRIST)
"""The missions of the campaign."""
DECLARED = "declared"
"""Group of the runs without a scene, with which the others are compared."""


@dataclass(frozen=True)
class Case:
    """A mission in a scene.

    Attributes:
        group: Kind of change.
        name: Name of the scene.
        mission: Shipped name of the mission.
        scene: Content of the scene file; empty: the cell as it is declared.
        number: Position among all cases, from which its seeds follow.
    """

    group: str
    name: str
    mission: str
    scene: Scene
    number: int


NEARLY_BLACK, BROWN, NAVY = [0.05, 0.05, 0.055], [0.16, 0.09, 0.05], [0.04, 0.05, 0.14]
DARK_GREEN, DARK_RED, DARK_GREY = [0.04, 0.11, 0.06], [0.14, 0.03, 0.03], [0.12, 0.12, 0.12]
"""Dark colours of objects: r, g, b, each 0 to 1."""


def _objects(label: str, *colours: Sequence[float]) -> Scene:
    return {"objects": {label: {"colours": list(colours)}}}


def _table(texture: str, *colour: float) -> Scene:
    return {"table": {"texture": texture, "colour": list(colour)}}


def _light(**values: object) -> Scene:
    return {"light": values}


def _camera(**values: object) -> Scene:
    return {"camera": values}


def _size(label: str, scale: float) -> Scene:
    return {"objects": {label: {"scale": scale}}}


def _unknown(count: int, first: int, last: int, **values: object) -> Scene:
    return {"unknown": {"count": [count, count], "models": [first, last], **values}}


FOR_BOTH: Mapping[str, Mapping[str, Scene]] = {
    "dark": {
        "all nearly black": _objects("any", NEARLY_BLACK),
        "cubes nearly black": _objects("cube", NEARLY_BLACK),
        "brown, dark red, dark grey": _objects("any", BROWN, DARK_RED, DARK_GREY),
    },
    "tables": {
        "dark table": _table("wood", 0.22, 0.22, 0.24),
        "blue table": _table("wood", 0.22, 0.32, 0.62),
        "green table": _table("plain", 0.26, 0.5, 0.3),
        "striped red table": _table("pattern 5", 0.62, 0.25, 0.2),
    },
    "light": {
        "brightness 0.15": _light(brightness=0.15),
        "brightness 0.3": _light(brightness=0.3),
        "glare": _light(specular=1.6, direction=[-0.5, 0.1, 1.0]),
    },
    "camera": {
        "camera 10 mm along x": _camera(shift=[0.01, 0.0, 0.0]),
        "camera turned 2 deg about y": _camera(turn_deg=[0.0, 2.0, 0.0]),
    },
    "lens": {
        "field of view +10 %": _camera(fov_factor=1.1),
        "field of view -25 %": _camera(fov_factor=0.75),
    },
    "sizes": {"cubes 0.8": _size("cube", 0.8), "spheres 1.3": _size("sphere", 1.3)},
    "unknown": {"two unknown": _unknown(2, 850, 924)},
    "stacks": {"half stacked": {"table": {"stacked": 0.5, "gap": 0.0}}},
}
"""Scenes of both missions by group and name."""

FOR_OVERHEAD: Mapping[str, Mapping[str, Scene]] = {
    "dark": {
        "all navy": _objects("any", NAVY),
        "all dark green": _objects("any", DARK_GREEN),
        "cubes brown": _objects("cube", BROWN),
    },
    "tables": {
        "red table": _table("wood", 0.62, 0.24, 0.2),
        "tiled table": _table("pattern 10", 0.75, 0.75, 0.8),
        "speckled dark table": _table("pattern 15", 0.38, 0.38, 0.42),
    },
    "light": {
        "overexposed": _light(brightness=1.6),
        "orange lamp with shadow": _light(colour=[1.0, 0.7, 0.45], direction=[1.2, 0.8, 0.6], shadow=True),
    },
    "camera": {
        "camera 10 mm along y": _camera(shift=[0.0, 0.01, 0.0]),
        "camera 10 mm along z": _camera(shift=[0.0, 0.0, 0.01]),
        "camera -20 mm along x": _camera(shift=[-0.02, 0.0, 0.0]),
        "camera 20 mm along y": _camera(shift=[0.0, 0.02, 0.0]),
        "camera -20 mm along z": _camera(shift=[0.0, 0.0, -0.02]),
        "camera 35 mm along x": _camera(shift=[0.035, 0.0, 0.0]),
        "camera -35 mm along y": _camera(shift=[0.0, -0.035, 0.0]),
        "camera 35 mm along z": _camera(shift=[0.0, 0.0, 0.035]),
        "camera 50 mm along x": _camera(shift=[0.05, 0.0, 0.0]),
        "camera 50 mm along y": _camera(shift=[0.0, 0.05, 0.0]),
        "camera -50 mm along z": _camera(shift=[0.0, 0.0, -0.05]),
        "camera turned 5 deg about x": _camera(turn_deg=[5.0, 0.0, 0.0]),
        "camera turned 10 deg about its axis": _camera(turn_deg=[0.0, 0.0, 10.0]),
        "camera 2 deg around x": _camera(orbit_deg=[2.0, 0.0, 0.0]),
        "camera 5 deg around y": _camera(orbit_deg=[0.0, 5.0, 0.0]),
        "camera 10 deg around x": _camera(orbit_deg=[-10.0, 0.0, 0.0]),
    },
    "lens": {
        "height +10 %": _camera(shift=[0.0, 0.0, 0.12]),
        "height -10 %": _camera(shift=[0.0, 0.0, -0.12]),
        "height +25 %": _camera(shift=[0.0, 0.0, 0.30]),
        "height -25 %": _camera(shift=[0.0, 0.0, -0.30]),
        "field of view -10 %": _camera(fov_factor=0.9),
        "field of view +25 %": _camera(fov_factor=1.25),
    },
    "sizes": {
        "spheres 0.85": _size("sphere", 0.85),
        "ducks 0.8": _size("duck", 0.8),
        "ducks 1.15": _size("duck", 1.15),
        "cubes 1.3": _size("cube", 1.3),
    },
    "unknown": {
        "one unknown": _unknown(1, 800, 849),
        "three unknown": _unknown(3, 925, 999),
        "three large unknown of many colours": _unknown(
            3, 800, 999, scale=0.8, colours=[[0.85, 0.2, 0.18], [0.18, 0.35, 0.8], [0.95, 0.8, 0.2]]
        ),
    },
    "stacks": {
        "all that stay are stacked": {"table": {"stacked": 1.0, "gap": 0.0}},
        "touching": {"table": {"gap": 0.0}},
    },
}
"""Further scenes, of the overhead cell alone, by group and name."""

GROUPS = tuple(FOR_BOTH)
"""Groups of scenes."""


def list_cases() -> list[Case]:
    """Return all cases: for each mission that without a scene, then those of every group."""
    listed: list[tuple[str, str, str, Scene]] = [
        (DECLARED, "as declared", mission, {}) for mission in MISSIONS
    ]
    listed += [*_in_groups(FOR_BOTH, OVERHEAD), *_in_groups(FOR_OVERHEAD, OVERHEAD)]
    listed += _in_groups(FOR_BOTH, WRIST)
    return [Case(*values, number) for number, values in enumerate(listed)]


def _in_groups(
    groups: Mapping[str, Mapping[str, Scene]], mission: str
) -> Iterator[tuple[str, str, str, Scene]]:
    """Yield group, name, mission and content of each scene."""
    for group, scenes in groups.items():
        for name, scene in scenes.items():
            yield group, name, mission, scene

"""Write the meshes and textures of the applications beside this file: `python make_objects.py [FOLDER]`.

Each object is a Wavefront mesh with a material and a texture. Lengths are in metres, z points up, and the
origin is the middle of the underside of the object as it lies on a table. Each convex part is an `o` group,
because the simulator replaces each group by its convex hull.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from shapes import (
    BLACK,
    BLUE,
    GOLD,
    GREEN,
    SILVER,
    SIZE,
    STEEL,
    WHITE,
    Colour,
    Part,
    Point,
    Texture,
    bend,
    extrude,
    flatten_underside,
    make_bar,
    make_ellipse,
    make_ellipsoid_profile,
    make_rectangle,
    make_ring,
    revolve,
    write_object,
)  # fmt: skip

Object = tuple[list[Part], Texture]


def make_apple(name: str) -> Object:
    """An apple of 68 mm."""
    texture = Texture(name, (176, 38, 34), 9, 3).spots(40, 1, (206, 130, 60))
    texture.rectangle(0, 0, 1, 0.08, (120, 92, 40)).rectangle(0, 0.93, 1, 1, (96, 64, 32))
    return [revolve(make_ellipsoid_profile(0.034, 0.058, 2.3))], texture


def make_orange(name: str) -> Object:
    """An orange of 68 mm."""
    texture = Texture(name, (238, 134, 24), 9, 0.8).rectangle(0, 0, 1, 0.05, (80, 120, 40))
    return flatten_underside([revolve(make_ellipsoid_profile(0.034, 0.067))], 0.001), texture


def make_lemon(name: str) -> Object:
    """A lying lemon, 70 mm long."""
    positions = np.linspace(0, 1, 13)
    radii = 0.0235 * np.sin(math.pi * positions).clip(0) ** 0.62
    radii[[0, -1]] = 0.0
    profile = [(float(r), float(x)) for r, x in zip(radii, 0.07 * (positions - 0.5), strict=True)]
    return flatten_underside([revolve(profile, "x")], 0.001), Texture(name, (236, 212, 50), 8, 1.0)


def make_pear(name: str) -> Object:
    """A lying pear, 72 mm long, with its stem at positive x."""
    profile = [(0, -36), (16, -35), (26, -24), (29, -12), (26, 1), (19, 16), (12, 30), (6, 35), (0, 36)]
    body = revolve([(r / 1000, x / 1000) for r, x in profile], "x")
    return flatten_underside([body], 0.006), Texture(name, (168, 180, 62), 12, 2)


def make_banana(name: str) -> Object:
    """A lying banana, 118 mm long, with its dark stem at negative x."""
    texture = Texture(name, (232, 198, 58), 7, 4).spots(8, 2, (120, 88, 36))
    texture.rectangle(0, 0, 0.09, 1, (70, 60, 25)).rectangle(0.96, 0, 1, 1, (90, 70, 40))
    return flatten_underside(bend(0.118, 0.155, 0.0155), 0.0035), texture


def make_parcel(name: str) -> Object:
    """A cardboard box, 75 x 55 x 45 mm, closed with tape."""
    texture = Texture(name, (176, 134, 88), 5, 1).rectangle(0, 0.43, 1, 0.57, (206, 178, 128))
    texture.text("FRAGILE", 0.1, 0.3, (90, 60, 30), 0.7).plain((160, 118, 76))
    return [
        extrude(make_rectangle(0, 0, 0.075, 0.055), 0, 0.045, (-0.0375, -0.0275, 0.0375, 0.0275))
    ], texture


def make_carton(name: str) -> Object:
    """A folding box of brown cardboard with a window of lighter board, 76 x 54 x 45 mm."""
    texture = Texture(name, (158, 122, 84), 5, 1).stripes(16, (140, 104, 68), 1)
    texture.rectangle(0.2, 0.25, 0.8, 0.75, (188, 160, 120)).plain((148, 110, 72))
    return [extrude(make_rectangle(0, 0, 0.076, 0.054), 0, 0.045, (-0.038, -0.027, 0.038, 0.027))], texture


def make_newspaper(name: str) -> Object:
    """A folded newspaper, 90 x 64 x 10 mm."""
    texture = Texture(name, (226, 224, 214), 4, 1).rectangle(0.05, 0.05, 0.95, 0.18, (60, 60, 62))
    for column in range(3):
        for row in range(14):
            left = 0.05 + 0.31 * column
            top = 0.24 + 0.054 * row
            texture.rectangle(
                left, top, left + 0.2 + 0.06 * texture.rng.random(), top + 0.022, (110, 110, 112)
            )
    texture.rectangle(0.37, 0.3, 0.65, 0.55, (140, 140, 138)).plain((210, 208, 200))
    return [extrude(make_rectangle(0, 0, 0.090, 0.064), 0, 0.010, (-0.045, -0.032, 0.045, 0.032))], texture


def make_letters(name: str) -> Object:
    """A bundle of letters, 91 x 62 x 10 mm, with a stamp and an address."""
    texture = Texture(name, (238, 234, 222), 4, 1).rectangle(0.8, 0.06, 0.95, 0.3, (60, 110, 170))
    for row in range(4):
        top = 0.5 + 0.1 * row
        texture.rectangle(0.35, top, 0.7 - 0.06 * row, top + 0.04, (70, 70, 90))
    texture.rectangle(0.47, 0, 0.53, 1, (200, 60, 50)).plain((224, 220, 206))
    return [extrude(make_rectangle(0, 0, 0.091, 0.062), 0, 0.010, (-0.0455, -0.031, 0.0455, 0.031))], texture


def make_jar(name: str) -> Object:
    """A standing jar of green glass with a lid, 54 mm high."""
    texture = Texture(name, (46, 104, 62), 5, 4).rectangle(0, 0.3, 1, 0.6, (222, 214, 180))
    texture.text("JAM", 0.1, 0.52, (120, 30, 30)).text("JAM", 0.6, 0.52, (120, 30, 30))
    texture.rectangle(0, 0, 1, 0.16, (62, 140, 84))
    profile = [(0, 0), (26, 0), (28, 3), (28, 36), (24, 42), (24, 52), (23.5, 54), (0, 54)]
    return [revolve([(r / 1000, z / 1000) for r, z in profile])], texture


def make_medicine_bottle(name: str) -> Object:
    """A standing bottle of brown glass, 54 mm high."""
    texture = Texture(name, (104, 62, 24), 5, 4).rectangle(0, 0.35, 1, 0.7, (228, 226, 214))
    texture.text("Rx", 0.15, 0.6, (40, 40, 90)).text("Rx", 0.65, 0.6, (40, 40, 90))
    texture.rectangle(0, 0, 1, 0.12, (134, 84, 36))
    profile = [(0, 0), (27, 0), (28, 2), (28, 30), (22, 40), (18, 44), (18, 53), (17, 54), (0, 54)]
    return [revolve([(r / 1000, z / 1000) for r, z in profile])], texture


def make_soup_can(name: str) -> Object:
    """A standing food can with a red label, 39 mm high."""
    texture = Texture(name, (176, 178, 184), 6, 1.5).rectangle(0, 0.5, 1, 0.9, (196, 40, 44))
    texture.text("SOUP", 0.05, 0.78, WHITE).text("SOUP", 0.55, 0.78, WHITE)
    for ring in (0.1, 0.2, 0.3):
        texture.rectangle(0, ring, 1, ring + 0.03, (120, 122, 128))
    profile = [(0, 0), (30, 0), (31, 2), (31, 37), (30, 39), (20, 39), (10, 39), (0, 39)]
    return [revolve([(r / 1000, z / 1000) for r, z in profile])], texture


def make_drinks_can(name: str) -> Object:
    """A drinks can that was pressed flat from above, 39 mm high, with a blue label."""
    texture = Texture(name, (188, 190, 196), 6, 1.5).rectangle(0, 0.5, 1, 0.9, (30, 80, 150))
    texture.text("COLA", 0.05, 0.78, WHITE).text("COLA", 0.55, 0.78, WHITE)
    texture.rectangle(0, 0.3, 1, 0.36, (110, 112, 118)).rectangle(0, 0.05, 0.12, 0.12, (90, 92, 98))
    profile = [(0, 0), (24, 0), (30, 5), (31, 18), (30, 33), (26, 39), (13, 39), (0, 39)]
    return [revolve([(r / 1000, z / 1000) for r, z in profile])], texture


def make_water_bottle(name: str) -> Object:
    """A lying water bottle of blue plastic, 100 mm long."""
    texture = Texture(name, (120, 196, 226), 6, 4).rectangle(0, 0, 1, 0.2, (24, 60, 170))
    texture.rectangle(0, 0.43, 1, 0.74, (242, 246, 250))
    texture.text("WATER", 0.02, 0.65, (20, 60, 150)).text("WATER", 0.52, 0.65, (20, 60, 150))
    profile = [(0, -50), (20, -50), (22, -47), (22, 18), (18, 28), (9.5, 36), (9.5, 50), (0, 50)]
    body = revolve([(r / 1000, x / 1000) for r, x in profile], "x", 0.72)
    return flatten_underside([body], 0.001), texture


def make_shampoo_bottle(name: str) -> Object:
    """A lying flat bottle of white and violet plastic with a cap, 100 mm long and 31 mm high."""
    texture = Texture(name, (236, 236, 240), 5, 3).rectangle(0.15, 0.25, 0.75, 0.75, (150, 80, 170))
    texture.text("HAIR", 0.2, 0.6, WHITE, 0.8).plain((222, 222, 228))
    cap = texture.patch(0, (90, 40, 120))
    body = make_ellipse(-0.008, 0, 0.042, 0.022, 5)
    parts = [
        extrude(body, 0.004, 0.027, (-0.050, -0.022, 0.034, 0.022)),
        extrude(make_ellipse(-0.008, 0, 0.040, 0.020, 5), 0, 0.0307, (-0.050, -0.022, 0.034, 0.022)),
        extrude(make_rectangle(0.041, 0, 0.018, 0.026), 0.004, 0.027, cap),
    ]
    return parts, texture


def make_cloth(name: str) -> Object:
    """A folded cloth, 84 x 64 x 18 mm."""
    texture = Texture(name, (150, 62, 120), 9, 0.7).stripes(4, (226, 206, 216), 9).plain((120, 46, 96))
    texture.rectangle(0, 0.49, 1, 0.52, (90, 30, 70))
    picture = (-0.042, -0.032, 0.042, 0.032)
    lower = make_ellipse(0, 0, 0.042, 0.032, 4.4, 24)
    upper = make_ellipse(0, 0, 0.039, 0.0295, 4.4, 24)
    return [extrude(lower, 0, 0.010, picture), extrude(upper, 0.010, 0.018, picture)], texture


def make_sponge(name: str) -> Object:
    """A kitchen sponge with a scouring side, 84 x 62 x 18 mm."""
    texture = Texture(name, (40, 92, 56), 12, 0.8).spots(60, 1, (24, 60, 36)).plain((226, 196, 60))
    picture = (-0.042, -0.031, 0.042, 0.031)
    return [extrude(make_ellipse(0, 0, 0.042, 0.031, 6, 24), 0, 0.018, picture)], texture


def make_bread(name: str) -> Object:
    """A slice of bread, 76 x 72 x 14 mm."""
    texture = Texture(name, (212, 170, 104), 12, 1.2).spots(30, 2, (176, 128, 66)).plain((120, 70, 30))
    for left, top, right, bottom in (
        (0, 0, 1, 0.05),
        (0, 0, 0.05, 0.95),
        (0.95, 0, 1, 1),
        (0.05, 0.95, 1, 1),
    ):
        texture.rectangle(left, top, right, bottom, (120, 70, 30))
    outline = [(-32, -36), (32, -36), (38, 12), (34, 28), (20, 36), (-20, 36), (-34, 28), (-38, 12)]
    picture = (-0.038, -0.036, 0.038, 0.036)
    return [extrude([(x / 1000, y / 1000) for x, y in outline], 0, 0.014, picture)], texture


def make_melon(name: str) -> Object:
    """A slice of a water melon, 84 x 48 x 14 mm, with its rind at negative y."""
    texture = Texture(name, (206, 56, 62), 9, 2).spots(14, 2, (40, 26, 24)).plain((46, 110, 50))
    angles = np.linspace(math.pi, math.tau, 15)
    for radius, colour in ((1.0, (46, 110, 50)), (0.9, (214, 226, 170))):
        arc = np.column_stack([0.5 + 0.5 * np.cos(angles), -np.sin(angles)])
        inner = np.column_stack(
            [0.5 + 0.5 * (radius - 0.1) * np.cos(angles), -(radius - 0.1) * np.sin(angles)]
        )
        border = np.vstack([arc * [1, radius] + [0, 0], inner[::-1]])
        cv2.fillPoly(texture.image, [(border * SIZE).round().astype(np.int32)], colour, cv2.LINE_8)
    outline = [(0.042 * math.cos(angle), 0.048 * math.sin(angle)) for angle in angles]
    return [extrude(outline, 0, 0.014, (-0.042, -0.048, 0.042, 0))], texture


def make_battery(name: str) -> Object:
    """A 9 V block battery with its contacts at negative x, 51 x 26 x 17 mm."""
    texture = Texture(name, (34, 34, 38), 4, 1).rectangle(0, 0, 0.3, 0.95, (196, 140, 40))
    texture.text("9V", 0.45, 0.6, WHITE, 0.9).plain((30, 30, 34))
    contacts = texture.patch(0, SILVER)
    parts = [
        extrude(make_rectangle(0.0025, 0, 0.046, 0.026), 0, 0.017, (-0.0205, -0.013, 0.0255, 0.013)),
        extrude(make_rectangle(-0.023, 0, 0.005, 0.012), 0.0035, 0.0135, contacts),
    ]
    return parts, texture


INSTRUMENT_PICTURE = (-0.075, -0.03, 0.075, 0.03)


def make_steel(name: str) -> Texture:
    """Return a texture of polished steel."""
    return Texture(name, STEEL, 5, 1.2).gradient(20).plain((140, 144, 150))


def lay(outlines: Sequence[Sequence[Point]], low: float, high: float) -> list[Part]:
    """Return flat parts of an instrument between two heights [m]."""
    return [extrude(outline, low, high, INSTRUMENT_PICTURE) for outline in outlines]


def make_scalpel(name: str) -> Object:
    """A scalpel with its blade at positive x, 126 mm long."""
    handle = [make_bar((-0.062, 0), (0.035, 0), 0.015, 0.008)]
    neck = [make_bar((0.035, 0), (0.045, 0), 0.008, 0.005)]
    blade = [[(0.045, -0.004), (0.064, -0.0035), (0.060, 0.004), (0.045, 0.004)]]
    texture = make_steel(name)
    for left in np.arange(0.16, 0.4, 0.055).tolist():
        texture.rectangle(left, 0.4, left + 0.02, 0.6, (116, 120, 126))
    return [*lay(handle, 0, 0.005), *lay(neck, 0.001, 0.004), *lay(blade, 0.0015, 0.003)], texture


def make_forceps(name: str) -> Object:
    """Forceps with their two legs at positive x, 122 mm long."""
    handle = [
        make_bar((-0.06, 0), (-0.045, 0), 0.010, 0.010),
        make_bar((-0.046, 0), (0.012, 0), 0.012, 0.013),
    ]
    legs = [make_bar((0.012, y), (0.062, y / 3), 0.004, 0.002) for y in (0.0045, -0.0045)]
    texture = make_steel(name)
    for left in np.arange(0.25, 0.55, 0.045).tolist():
        texture.rectangle(left, 0.38, left + 0.022, 0.62, (108, 112, 118))
    return [*lay(handle, 0, 0.006), *lay(legs, 0, 0.005)], texture


def make_scissors(name: str) -> Object:
    """Closed scissors with their blades at positive x, 125 mm long."""
    handles = [outline for y in (0.017, -0.017) for outline in make_ring(-0.052, y, 0.011, 0.005)]
    handles += [make_bar((-0.043, side * 0.011), (-0.004, side * 0.001), 0.006, 0.008) for side in (1, -1)]
    blades = [make_bar((0.004, y), (0.062, y / 2.5), 0.007, 0.002) for y in (0.0025, -0.0025)]
    joint = [make_ellipse(0, 0, 0.0065, 0.0065, count=12)]
    texture = make_steel(name)
    return [*lay(handles, 0, 0.005), *lay(blades, 0, 0.004), *lay(joint, 0, 0.006)], texture


def make_clamp(name: str) -> Object:
    """A closed clamp with its jaws at positive x, 126 mm long."""
    handles = [outline for y in (0.014, -0.014) for outline in make_ring(-0.056, y, 0.0095, 0.0045)]
    handles += [make_bar((-0.048, side * 0.010), (0.006, side * 0.003), 0.005, 0.007) for side in (1, -1)]
    lock = [make_bar((-0.040, -0.006), (-0.040, 0.006), 0.004, 0.004)]
    joint = [make_ellipse(0.004, 0, 0.0075, 0.0065, count=12)]
    jaws = [make_bar((0.010, 0), (0.036, 0), 0.010, 0.007), make_bar((0.036, 0), (0.060, 0), 0.007, 0.004)]
    texture = make_steel(name)
    for left in np.arange(0.62, 0.9, 0.05).tolist():
        texture.rectangle(left, 0.4, left + 0.02, 0.6, (108, 110, 114))
    return [
        *lay(handles, 0, 0.005),
        *lay(lock, 0.001, 0.005),
        *lay(joint, 0, 0.006),
        *lay(jaws, 0, 0.005),
    ], texture


def make_retractor(name: str) -> Object:
    """A retractor with its wide hook at positive x, 114 mm long."""
    handle = [make_bar((-0.060, 0), (0.044, 0), 0.012, 0.012)]
    hook = [make_rectangle(0.046, 0, 0.008, 0.040)]
    grip = [make_rectangle(-0.060, 0, 0.007, 0.014)]
    return [*lay(handle, 0, 0.005), *lay(hook, 0, 0.008), *lay(grip, 0, 0.007)], make_steel(name)


Component = tuple[float, float, float, float, float, Colour]
"""Component of a board: x, y, length, width, height [mm] and colour."""


def make_board(name: str, size: Point, colour: Colour, components: Sequence[Component]) -> Object:
    """Return a circuit board of a size [m], 2 mm thick, with components; the highest is in the middle."""
    texture = Texture(name, colour, 4, 1)
    light = (min(colour[0] + 36, 255), min(colour[1] + 40, 255), min(colour[2] + 36, 255))
    texture.traces(26, light).plain(colour)
    for x, y in ((0.1, 0.1), (0.9, 0.1), (0.1, 0.85), (0.9, 0.85)):
        cv2.circle(texture.image, (round(x * SIZE), round(y * SIZE)), 5, GOLD, -1, cv2.LINE_8)
    a = size[0] / 2
    b = size[1] / 2
    parts = [extrude(make_rectangle(0, 0, *size), 0, 0.002, (-a, -b, a, b))]
    colours = list(dict.fromkeys(component[5] for component in components))
    patches = {colour: texture.patch(index, colour) for index, colour in enumerate(colours)}
    for *numbers, component_colour in components:
        x, y, length, width, height = (float(number) / 1000 for number in numbers)
        outline = make_rectangle(x, y, length, width)
        parts.append(extrude(outline, 0.002, 0.002 + height, patches[component_colour]))
    return parts, texture


def make_controller(name: str) -> Object:
    """A board of a microcontroller, 68 x 53 mm."""
    common = [(0, 23.5, 50, 3, 8, BLACK), (4, -23.5, 46, 3, 8, BLACK), (0, 0, 20, 20, 10, BLACK)]
    if name.endswith("_b"):
        components = [
            *common,
            (-27, 0, 13, 14, 9, SILVER),
            (26, 14, 8, 8, 6, SILVER),
            (26, -12, 8, 12, 5, WHITE),
        ]
        return make_board(name, (0.068, 0.053), (20, 84, 148), components)
    components = [
        *common,
        (-27, 16, 13, 12, 9, SILVER),
        (-28, -16, 12, 10, 9, BLACK),
        (26, 0, 6, 12, 4, SILVER),
    ]
    return make_board(name, (0.068, 0.053), (16, 92, 132), components)


def make_radio(name: str) -> Object:
    """A radio module with its aerial at positive x, 50 x 28 mm."""
    common: list[Component] = [(0, 0, 18, 18, 6, SILVER), (19, 0, 10, 18, 1, GOLD)]
    if name.endswith("_b"):
        components = [*common, (-20, 7, 8, 8, 4, BLACK), (-20, -7, 8, 8, 4, WHITE)]
        return make_board(name, (0.050, 0.028), (30, 26, 38), components)
    components = [
        *common,
        (-21, 0, 6, 9, 3, SILVER),
        (-5, 12.5, 30, 2, 4, BLACK),
        (-5, -12.5, 30, 2, 4, BLACK),
    ]
    return make_board(name, (0.050, 0.028), (24, 24, 30), components)


def make_power(name: str) -> Object:
    """A board of a power supply, 70 x 45 mm."""
    common = [(0, 0, 24, 22, 12, SILVER), (27, 0, 10, 30, 10, GREEN)]
    if name.endswith("_b"):
        components = [*common, (-24, 0, 14, 30, 11, BLACK), (10, -17, 12, 6, 6, GOLD)]
        return make_board(name, (0.070, 0.045), (36, 110, 44), components)
    components = [
        *common,
        (-26, 10, 12, 12, 12, BLACK),
        (-26, -12, 10, 10, 10, GOLD),
        (12, 16, 10, 6, 5, BLACK),
    ]
    return make_board(name, (0.070, 0.045), (30, 104, 52), components)


def make_relay(name: str) -> Object:
    """A board with a relay, 60 x 40 mm."""
    common = [(0, 0, 19, 16, 12, BLUE), (-22, 0, 10, 30, 9, GREEN)]
    if name.endswith("_b"):
        components = [*common, (21, 0, 8, 26, 6, WHITE), (6, 15, 14, 5, 4, BLACK)]
        return make_board(name, (0.060, 0.040), (140, 30, 26), components)
    components = [*common, (22, 8, 6, 10, 4, BLACK), (22, -10, 10, 6, 6, WHITE)]
    return make_board(name, (0.060, 0.040), (126, 24, 30), components)


def make_memory(name: str) -> Object:
    """A memory module with gold contacts at negative y, 75 x 26 mm."""
    contacts = (0, -11.5, 70, 3, 0.6, GOLD)
    if name.endswith("_b"):
        chips = [(0, 2, 18, 17, 3, BLACK), *((x, 2, 8, 14, 2, BLACK) for x in (-28, -17, 17, 28))]
        return make_board(name, (0.075, 0.026), (26, 104, 70), [contacts, *chips])
    chips = [(0, 2, 18, 17, 3, BLACK), *((x, 2, 12, 14, 2, BLACK) for x in (-24, 24))]
    return make_board(name, (0.075, 0.026), (22, 110, 60), [contacts, *chips])


OBJECTS: dict[str, dict[str, Callable[[str], Object]]] = {
    "fruit": {
        "apple": make_apple, "orange": make_orange, "lemon": make_lemon, "pear": make_pear,
        "banana": make_banana,
    },
    "waste": {
        "bread": make_bread, "melon": make_melon,
        "water_bottle": make_water_bottle, "shampoo_bottle": make_shampoo_bottle,
        "soup_can": make_soup_can, "drinks_can": make_drinks_can,
        "jar": make_jar, "medicine_bottle": make_medicine_bottle,
        "newspaper": make_newspaper, "letters": make_letters,
        "parcel": make_parcel, "carton": make_carton,
        "cloth": make_cloth, "sponge": make_sponge,
        "battery": make_battery,
    },
    "instruments": {
        "scalpel": make_scalpel, "forceps": make_forceps, "scissors": make_scissors, "clamp": make_clamp,
        "retractor": make_retractor,
    },
    "boards": {
        f"{name}_{variant}": make
        for name, make in {
            "controller": make_controller, "radio": make_radio, "power": make_power, "relay": make_relay,
            "memory": make_memory,
        }.items()
        for variant in "ab"
    },
}  # fmt: skip
"""Functions that make the objects, by folder and name of the files."""


def main() -> None:
    """Write all objects."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for application, makers in OBJECTS.items():
        for name, make in makers.items():
            write_object(folder / application, name, *make(name))


if __name__ == "__main__":
    main()

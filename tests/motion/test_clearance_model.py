from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.cell.config import CellConfig
from executive.cell.objects import BIN_THICKNESS, ObjectClass, Obstacle
from executive.errors import Blocked
from executive.geometry import Array
from executive.motion.clearance_model import (
    DISTANCE_PER_COSINE,
    OBSERVED_RADIUS,
    POSITION_TOLERANCE,
    ClearanceModel,
    Discs,
    make_tool_discs,
)
from executive.motion.joints import SAMPLING_MARGIN
from executive.tools.suction import SHAFT_RADIUS

DOWN = np.array([0.0, 0.0, -1.0])
AWAY = np.array([[-0.6, 0.0]])
"""Ends of a motion far from everything."""
POST = Obstacle(-0.5, 0.1, 0.03, 0.30, "the post")
"""Where nothing else is near."""
CUBE = ObjectClass("cube", 0.05, 0.0354)
ROUND = np.array([[0.0, 0.0], *((r * math.cos(a), r * math.sin(a)) for r in (0.25, 0.5, 0.75, 1.0)
                                for a in np.linspace(0, 2 * math.pi, 120, endpoint=False))])  # fmt: skip
"""Points of a disc of radius 1."""


def discs_of(tip: Array, axis: Array, discs: Discs) -> list[Array]:
    """Points of every disc `(S, 3)` [m]."""
    one = np.cross(axis, [1.0, 0.0, 0.0])
    one /= np.linalg.norm(one)
    both = np.stack([one, np.cross(axis, one)])
    places = zip(discs.offsets, discs.radii, strict=True)
    return [tip + offset * axis + radius * ROUND @ both for offset, radius in places]


def to_cylinder(points: Array, thing: Obstacle) -> Array:
    """Distances of points `(S, 3)` from the outside of an obstacle [m]; 0 inside."""
    across = np.linalg.norm(points[:, :2] - (thing.x, thing.y), axis=1) - thing.radius
    return np.hypot(np.maximum(across, 0.0), np.maximum(points[:, 2] - thing.top, 0.0))


def to_box(points: Array, low: Array, high: Array) -> Array:
    """Distances of points `(S, 3)` from the outside of a box [m]; 0 inside."""
    return np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)


def slack(clearance: ClearanceModel, tip, axis=DOWN) -> float:
    """Of one state."""
    pairs = clearance.find_nearest_pairs(np.array([tip], dtype=float), np.array([axis], dtype=float))
    return float(pairs.slack[0])


near_the_post = st.tuples(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(0.15, 0.42)).map(
    lambda off: np.array([POST.x, POST.y, 0.0]) + off
)


@given(near_the_post, st.booleans())
@settings(max_examples=60)
def test_distances_from_a_cylinder_are_what_geometry_says(config: CellConfig, tip, loaded: bool) -> None:
    discs = make_tool_discs(config, CUBE if loaded else None)
    without = slack(ClearanceModel(config, (), AWAY, discs), tip)
    found = slack(ClearanceModel(config, (POST,), AWAY, discs), tip)
    points = np.concatenate(discs_of(tip, DOWN, discs))
    grown = Obstacle(POST.x, POST.y, POST.radius + POSITION_TOLERANCE, POST.top, "")
    nearest = float(to_cylinder(points, grown).min())
    if nearest > 0:
        assert found == pytest.approx(
            min(nearest - (config.motion.margin + SAMPLING_MARGIN), without), abs=5e-4
        )
    else:
        assert found <= -(config.motion.margin + SAMPLING_MARGIN) + 1e-9


@given(st.tuples(st.floats(0.08, 0.38), st.floats(-0.66, -0.32), st.floats(0.01, 0.2)).map(np.array))
@settings(max_examples=80)
def test_distances_from_a_bin_are_what_geometry_says(config: CellConfig, tip) -> None:
    discs = make_tool_discs(config, None)
    bin, t = config.bins["red_bin"], BIN_THICKNESS
    low, high = np.array(bin.position[:2]), np.array(bin.position[:2])
    low, high = low - np.array(bin.size[:2]) / 2, high + np.array(bin.size[:2]) / 2
    top = bin.size[2]
    boxes = [
        ((low[0] - t, low[1] - t, 0), (low[0], high[1] + t, top)),
        ((high[0], low[1] - t, 0), (high[0] + t, high[1] + t, top)),
        ((low[0], low[1] - t, 0), (high[0], low[1], top)),
        ((low[0], high[1], 0), (high[0], high[1] + t, top)),
        ((low[0], low[1], 0), (high[0], high[1], t)),
        ((-2, -2, -1), (2, 2, 0)),
    ]
    points = np.concatenate(discs_of(tip, DOWN, discs))
    nearest = min(float(to_box(points, np.array(a), np.array(b)).min()) for a, b in boxes)
    # Its end is here, so that the workspace beside does not count.
    found = slack(ClearanceModel(config, (), tip[None, :2], discs), tip)
    if nearest > 0:
        spare = DISTANCE_PER_COSINE * (1 - discs.min_cosine)
        assert found == pytest.approx(
            min(nearest - (config.motion.margin + SAMPLING_MARGIN), spare), abs=5e-4
        )
    else:
        assert found <= -(config.motion.margin + SAMPLING_MARGIN) + 1e-9


def test_near_an_end_what_is_unavoidable_there_is_allowed_and_elsewhere_it_is_not(config) -> None:
    discs = make_tool_discs(config, None)
    beside = np.array([POST.x + POST.radius + POSITION_TOLERANCE + SHAFT_RADIUS + 0.002, POST.y, 0.1])
    opposite = np.array([2 * POST.x - beside[0], POST.y, 0.1])
    clearance = ClearanceModel(config, (POST,), beside[None, :2], discs)
    assert slack(clearance, beside) == pytest.approx(0.002 - (config.motion.margin + SAMPLING_MARGIN))
    clearance.relax_end_margins(beside[None], DOWN[None])
    assert slack(clearance, beside) == pytest.approx(0.0, abs=1e-9)
    assert slack(clearance, beside - (0.001, 0, 0)) == pytest.approx(-0.001, abs=1e-9)
    assert np.linalg.norm(opposite - beside) > OBSERVED_RADIUS
    assert slack(clearance, opposite) == pytest.approx(0.002 - (config.motion.margin + SAMPLING_MARGIN))
    inside = np.array([[POST.x, POST.y, POST.top - 0.01]])
    clearance.relax_end_margins(inside, DOWN[None])
    clearance.require_clearance(inside, DOWN[None])  # what is entered already may be left


def test_an_error_names_the_thing_the_lack_and_the_place(config: CellConfig) -> None:
    clearance = ClearanceModel(config, (POST,), AWAY, make_tool_discs(config, None))

    def require(tip, axis=DOWN) -> None:
        tips = np.array([[-0.6, 0.0, 0.4], tip, [-0.6, 0.0, 0.4]])
        clearance.require_clearance(tips, np.array([DOWN, axis, DOWN]))

    require((-0.6, 0.0, 0.4))
    text = "would bring tool or load 16 mm too near to the post, with the tool at (-0.500, 0.100, 0.290) m"
    with pytest.raises(Blocked, match=re.escape(text)):
        require((POST.x, POST.y, 0.29))
    for more, passes in ((-1e-4, True), (1e-4, False)):  # what is known may be off by the tolerance
        tip = (POST.x, POST.y, POST.top + config.motion.margin - POSITION_TOLERANCE - more)
        if passes:
            require(tip)
        else:
            with pytest.raises(Blocked, match="4 mm too near to the post"):
                require(tip)
    with pytest.raises(Blocked, match="too near to the table, with"):
        require((-0.6, 0.0, -0.01))
    with pytest.raises(Blocked, match="too near to the space for undetected objects, with"):
        require((0.5, 0.0, 0.05))
    with pytest.raises(Blocked, match="too near to yellow_bin, with"):
        require((0.49, 0.308, 0.05))
    with pytest.raises(Blocked, match="too near to the floor of blue_bin, with"):
        require((0.24, 0.48, 0.0))
    with pytest.raises(Blocked, match=re.escape("would tilt the tool too far, with the tool at (-0.600")):
        require((-0.6, 0.0, 0.4), (0.9, 0.0, -math.sqrt(1 - 0.81)))

"""Distance model of the cell for planning: obstacles as upright prisms, tool and load as discs.

Each obstacle is a base area on the ground and a height; tool and load are discs below the flange. So a few
array operations give the distances of all states of a motion from all obstacles. The planner checks the
motions that the search finds in a more exact model.

The workspace counts as an obstacle, because undetected objects may lie there. Near the two ends of a motion,
which looks have observed, only known obstacles count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.layout import NECK_LENGTH, TOOL_RADIUS, compute_max_pile_height
from executive.cell.objects import Load, Obstacle
from executive.errors import Blocked
from executive.geometry import Array

OBSERVED_RADIUS = 0.05
"""Radius around the ends of a motion in which only known obstacles count [m]."""
UNKNOWN_SLOPE = 1.5
"""Increase of the assumed height of undetected objects with the distance from the observed areas [m/m]."""
POSITION_TOLERANCE = 0.003
"""Tolerance of the position of an observed object, and of a load relative to the tool axis [m]."""
SAMPLING_MARGIN = 0.001
"""Distance beyond the margin of the cell, for the motion between two sampled states [m]."""
MAX_PENETRATION = 2e-4
"""Maximum depth by which a moving load may be pressed into the surface below [m]."""
TILT_DISTANCE = 0.1
"""Distance that is equivalent to a difference of 1 in the cosine of the tool's tilt [m]."""
MAX_EXTRA_TILT = 0.003
"""Maximum tilt of the tool beyond its limit during a motion, as an equivalent distance [m]."""
MIN_COSINE_DOWN, MIN_COSINE_DOWN_LOADED = 0.5, 0.8
"""Minimum cosine between the tool axis and straight down, without and with a load."""


class Discs(NamedTuple):
    """Tool and load as `P` discs, centred on the tool axis.

    Attributes:
        offset: Distance of each disc from the tool centre point along the axis, away from the arm `(P,)` [m].
        radius: Radius of each disc `(P,)` [m].
        min_cosine: Minimum cosine between the tool axis and straight down.
    """

    offset: Array
    radius: Array
    min_cosine: float


def discs_below_flange(config: CellConfig, load: Load | None) -> Discs:
    """Return the discs of the tool and its load."""
    if load is None:
        radius = np.array([config.tool.cup_radius, TOOL_RADIUS])
        return Discs(np.array([0.0, -NECK_LENGTH]), radius, MIN_COSINE_DOWN)
    load_radius = load.kind.radius + load.kind.ring + POSITION_TOLERANCE
    # Bottom and top of the load differ in position if the tool tilts.
    offset = np.array([load.kind.height, 0.0, -NECK_LENGTH])
    return Discs(offset, np.array([load_radius, load_radius, TOOL_RADIUS]), MIN_COSINE_DOWN_LOADED)


class Prisms(NamedTuple):
    """`K` upright obstacles, each a rectangle enlarged by a radius: boxes (radius 0) and cylinders (points).

    Attributes:
        low: Lower corners of the rectangles `(K, 2)` [m].
        high: Upper corners of the rectangles `(K, 2)` [m].
        radius: Enlargement of the rectangles `(K,)` [m].
        top: Height of the upper side `(K,)` [m].
        unknown: True for undetected objects, which do not count near the ends of a motion `(K,)`.
        flat: True for surfaces on which a load may lie `(K,)`.
        names: Name of each obstacle in messages.
    """

    low: Array
    high: Array
    radius: Array
    top: Array
    unknown: NDArray[np.bool_]
    flat: NDArray[np.bool_]
    names: tuple[str, ...]


class ClearanceModel:
    """Obstacles of a cell, and the distances of the states of a motion from them.

    Args:
        config: Content of the cell file.
        around: Obstacles that the cell file does not declare.
        ends: Horizontal positions of the start and the end of the motion `(E, 2)` [m].
    """

    def __init__(self, config: CellConfig, around: Sequence[Obstacle], ends: Array) -> None:
        self._margin = config.motion.margin + SAMPLING_MARGIN
        self._prisms = _build_prisms(config, around)
        self._ends = ends
        self._end_margins = np.full(len(self._prisms.names), self._margin)

    def relax(self, tips: Array, axes: Array, discs: Discs) -> None:
        """Reduce the required distances near the ends to the distances at the ends.

        `tips` `(E, 3)` [m] and `axes` `(E, 3)` are the tool centre points and tool axes at the ends.
        """
        at_ends = self._distances(tips, axes, discs).min(axis=(0, 1))
        self._end_margins = np.minimum(at_ends, self._margin)

    def slack(self, tips: Array, axes: Array, discs: Discs) -> Array:
        """Return the smallest distance of each state beyond its required distance `(N,)` [m].

        Args:
            tips: Tool centre points `(N, 3)` [m].
            axes: Tool axes `(N, 3)`.
            discs: Tool and load.
        """
        excess = self._distances(tips, axes, discs) - self._required_distances(tips)[:, None]
        return np.minimum(excess.min(axis=(1, 2)), _tilt_slack(axes, discs))

    def slopes(self, tips: Array, axes: Array, discs: Discs, moved: tuple[Array, Array]) -> Array:
        """Return the change of the slack of each state for each of `M` small displacements `(N, M)` [m].

        For each state, only the nearest pair of disc and prism counts.

        Args:
            tips: Tool centre points `(N, 3)` [m].
            axes: Tool axes `(N, 3)`.
            discs: Tool and load.
            moved: Tool centre points and axes of the displaced states, `(N, M, 3)` each.
        """
        required = self._required_distances(tips)
        excess = self._distances(tips, axes, discs) - required[:, None]
        state, prism_count = np.arange(len(tips)), excess.shape[2]
        pairs = excess.reshape(len(tips), excess.shape[1] * prism_count)
        disc, prism = np.divmod(pairs.argmin(axis=1), prism_count)
        before, required = excess[state, disc, prism], required[state, prism]
        nearest_disc = Discs(discs.offset[disc, None], discs.radius[disc, None], discs.min_cosine)
        columns = [values[prism, None] for values in self._prisms[:-1]]
        nearest_prism = Prisms._make([*columns, self._prisms.names])
        after = _distance(*moved, nearest_disc, nearest_prism, self._ends) - required[:, None]
        tilt_before, tilt_after = _tilt_slack(axes, discs), _tilt_slack(moved[1], discs)
        is_tilt_nearer = (tilt_before < before)[:, None]
        return np.where(is_tilt_nearer, tilt_after - tilt_before[:, None], after - before[:, None])

    def require_clear(self, tips: Array, axes: Array, discs: Discs) -> None:
        """Raise an error if a state is too near to an obstacle; arguments as for `slack`.

        Raises:
            Blocked: A state is too near; the text names the obstacle and the position of the tool.
        """
        tilt = _tilt_slack(axes, discs)
        if tilt.min() < -MAX_EXTRA_TILT:
            raise Blocked(f"the motion would tilt the tool too far{_describe_tip(tips[np.argmin(tilt)])}")
        # Undetected objects need no margin; no state may be pressed into the table or a floor.
        tolerance = np.where(self._prisms.unknown, self._margin, POSITION_TOLERANCE + SAMPLING_MARGIN)
        tolerance = np.where(self._prisms.flat, MAX_PENETRATION, tolerance)
        excess = self._distances(tips, axes, discs) - self._required_distances(tips)[:, None] + tolerance
        excess = excess.min(axis=1)
        state, prism = np.unravel_index(np.argmin(excess), excess.shape)
        if excess[state, prism] < 0:
            shortfall = (tolerance[prism] - excess[state, prism]) * 1000
            raise Blocked(
                f"the motion would bring tool or load {shortfall:.0f} mm too near to "
                f"{self._prisms.names[prism]}{_describe_tip(tips[state])}"
            )

    def _required_distances(self, tips: Array) -> Array:
        """Return the required distance of each state from each prism `(N, K)` [m]."""
        end_distances = np.linalg.norm(tips[:, None, :2] - self._ends, axis=-1).min(axis=1)
        return np.where((end_distances < OBSERVED_RADIUS)[:, None], self._end_margins, self._margin)

    def _distances(self, tips: Array, axes: Array, discs: Discs) -> Array:
        """Return the distance of each disc to each prism in each state `(N, P, K)` [m], negative inside."""
        columns = Discs(discs.offset[:, None], discs.radius[:, None], discs.min_cosine)
        return _distance(tips[:, None, None], axes[:, None, None], columns, self._prisms, self._ends)


def _distance(tips: Array, axes: Array, discs: Discs, prisms: Prisms, ends: Array) -> Array:
    """Return the distance between discs and prisms [m], negative inside; the shapes broadcast."""
    low, high = prisms.low, prisms.high
    centres = tips + discs.offset[..., None] * axes
    x, y = centres[..., 0], centres[..., 1]
    end_distance = np.sqrt(np.min([(x - ex) ** 2 + (y - ey) ** 2 for ex, ey in ends], axis=0))
    unknown_top = np.clip(UNKNOWN_SLOPE * (end_distance - OBSERVED_RADIUS), 0.0, prisms.top)
    top = np.where(prisms.unknown, unknown_top, prisms.top)
    sine_of_tilt = np.sqrt(np.maximum(0.0, 1 - axes[..., 2] ** 2))
    vertical = centres[..., 2] - discs.radius * sine_of_tilt - top
    dx = np.maximum(np.maximum(low[..., 0] - x, x - high[..., 0]), 0.0)
    dy = np.maximum(np.maximum(low[..., 1] - y, y - high[..., 1]), 0.0)
    horizontal = np.sqrt(dx**2 + dy**2) - prisms.radius - discs.radius
    outside = np.sqrt(np.maximum(horizontal, 0.0) ** 2 + np.maximum(vertical, 0.0) ** 2)
    return np.where(outside > 0, outside, np.maximum(horizontal, vertical))


def _describe_tip(tip: Array) -> str:
    x, y, z = tip
    return f", with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"


def _tilt_slack(axes: Array, discs: Discs) -> Array:
    """Return the remaining tilt of tool axes `(..., 3)` up to the limit, as an equivalent distance [m]."""
    return TILT_DISTANCE * (-axes[..., 2] - discs.min_cosine)


def _build_prisms(config: CellConfig, around: Sequence[Obstacle]) -> Prisms:
    """Return the obstacles of a cell file, and those around that the file does not declare."""
    max_radius = max(kind.radius for kind in config.objects.values())
    # Columns: x range, y range, radius, top [m]; undetected objects; flat; name.
    rows: list[tuple[float, float, float, float, float, float, bool, bool, str]] = [
        (*config.table.x, *config.table.y, max_radius, compute_max_pile_height(config), True, False,
         "the space for undetected objects"),
        (-2.0, 2.0, -2.0, 2.0, 0.0, 0.0, False, True, "the table"),
    ]  # fmt: skip
    for name, bin in config.bins.items():
        (x, y, floor), (length, width, height), t = bin.position, bin.size, BIN_THICKNESS
        left, right, front, back = x - length / 2, x + length / 2, y - width / 2, y + width / 2
        for wall in (
            (left - t, left, front - t, back + t), (right, right + t, front - t, back + t),
            (left, right, front - t, front), (left, right, back, back + t),
        ):  # fmt: skip
            rows.append((*wall, 0.0, floor + height, False, False, name))
        rows.append((left, right, front, back, 0.0, floor + t, False, True, f"the floor of {name}"))
    rows += [(o.x, o.x, o.y, o.y, o.radius + POSITION_TOLERANCE, o.top, False, False, o.name) for o in around]
    table, names = np.array([row[:8] for row in rows]), tuple(row[8] for row in rows)
    corners = table[:, [0, 2]], table[:, [1, 3]]
    return Prisms(*corners, table[:, 4], table[:, 5], table[:, 6] > 0, table[:, 7] > 0, names)

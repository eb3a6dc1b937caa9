"""Distance model of the cell for planning: obstacles as upright prisms, tool and load as discs.

The model gives the distances between all states of a motion and all obstacles in a few array operations. The
planner can check the found motion in a more exact model.

The workspace counts as an obstacle, because undetected objects may lie in it. Near the two ends of a motion,
where detectors have found all objects, only known obstacles count.
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
UNDETECTED_HEIGHT_SLOPE = 1.5
"""Increase of the assumed height of undetected objects with the distance beyond `OBSERVED_RADIUS` [m/m]."""
POSITION_TOLERANCE = 0.003
"""Tolerance of the position of an observed object, and of a load relative to the tool axis [m]."""
SAMPLING_MARGIN = 0.001
"""Addition to the margin of the cell, because only samples of a motion are checked [m]."""
MAX_PENETRATION = 2e-4
"""Maximum depth by which a moving load may be pressed into its support [m]."""
TILT_DISTANCE = 0.1
"""Factor that converts the cosine of the tool's tilt to an equivalent distance [m]."""
MAX_EXTRA_TILT = 0.003
"""Maximum tilt of the tool beyond its limit during a motion, as an equivalent distance [m]."""
MIN_COSINE_DOWN = 0.5
"""Minimum cosine between the tool axis and straight down without a load."""
MIN_COSINE_DOWN_LOADED = 0.8
"""Minimum cosine between the tool axis and straight down with a load."""


class Discs(NamedTuple):
    """Tool and load as `P` discs, centred on the tool axis.

    Attributes:
        offsets: Distance of each disc from the tool centre point, positive away from the arm `(P,)` [m].
        radii: Radius of each disc `(P,)` [m].
        min_cosine: Minimum cosine between the tool axis and straight down.
    """

    offsets: Array
    radii: Array
    min_cosine: float


def make_tool_discs(config: CellConfig, load: Load | None) -> Discs:
    """Return the discs of the tool and its load."""
    if load is None:
        radii = np.array([config.tool.cup_radius, TOOL_RADIUS])
        return Discs(np.array([0.0, -NECK_LENGTH]), radii, MIN_COSINE_DOWN)
    load_radius = load.kind.radius + load.kind.ring + POSITION_TOLERANCE
    # The load has a disc at its bottom and one at its top, because the tool may tilt.
    offsets = np.array([load.kind.height, 0.0, -NECK_LENGTH])
    return Discs(offsets, np.array([load_radius, load_radius, TOOL_RADIUS]), MIN_COSINE_DOWN_LOADED)


class Prisms(NamedTuple):
    """`K` upright obstacles: the base of each is a rectangle or a point, enlarged by a radius.

    Attributes:
        low: Corners of the rectangles with the smallest coordinates `(K, 2)` [m].
        high: Corners of the rectangles with the largest coordinates `(K, 2)` [m].
        radii: Enlargement of the bases `(K,)` [m].
        tops: Height of the upper sides above the world's origin `(K,)` [m].
        undetected: True for undetected objects, which do not count near the ends of a motion `(K,)`.
        supports: True for surfaces on which a load may lie `(K,)`.
        names: Name of each obstacle in messages.
    """

    low: Array
    high: Array
    radii: Array
    tops: Array
    undetected: NDArray[np.bool_]
    supports: NDArray[np.bool_]
    names: tuple[str, ...]


class ClearanceModel:
    """Obstacles of a cell, and their distances from the states of a motion.

    Args:
        config: Content of the cell file.
        obstacles: Obstacles that the cell file does not declare.
        ends: Horizontal positions of the start and the end of the motion `(E, 2)` [m].
    """

    def __init__(self, config: CellConfig, obstacles: Sequence[Obstacle], ends: Array) -> None:
        self._margin = config.motion.margin + SAMPLING_MARGIN
        self._prisms = _build_prisms(config, obstacles)
        self._ends = ends
        self._end_margins = np.full(len(self._prisms.names), self._margin)

    def relax_end_margins(self, tips: Array, axes: Array, discs: Discs) -> None:
        """Reduce the required distances near the ends of the motion to the distances at the ends.

        `tips` `(E, 3)` [m] and `axes` `(E, 3)` are the tool centre points and tool axes at the ends.
        """
        end_distances = self._compute_distances(tips, axes, discs).min(axis=(0, 1))
        self._end_margins = np.minimum(end_distances, self._margin)

    def compute_slack(self, tips: Array, axes: Array, discs: Discs) -> Array:
        """Return the smallest difference between distance and required distance in each state `(N,)` [m].

        Args:
            tips: Tool centre points `(N, 3)` [m].
            axes: Tool axes `(N, 3)`.
            discs: Tool and load.
        """
        slack = self._compute_distances(tips, axes, discs) - self._find_required_distances(tips)[:, None]
        return np.minimum(slack.min(axis=(1, 2)), _compute_tilt_slack(axes, discs))

    def compute_slack_changes(
        self, tips: Array, axes: Array, discs: Discs, displaced: tuple[Array, Array]
    ) -> Array:
        """Return the change of the slack of each state for each of `M` small displacements `(N, M)` [m].

        For each state, only the pair of disc and prism with the smallest slack counts.

        Args:
            tips: Tool centre points `(N, 3)` [m].
            axes: Tool axes `(N, 3)`.
            discs: Tool and load.
            displaced: Tool centre points and axes of the displaced states, `(N, M, 3)` each.
        """
        required = self._find_required_distances(tips)
        slack = self._compute_distances(tips, axes, discs) - required[:, None]
        state, prism_count = np.arange(len(tips)), slack.shape[2]
        pairs = slack.reshape(len(tips), slack.shape[1] * prism_count)
        disc, prism = np.divmod(pairs.argmin(axis=1), prism_count)
        before, required = slack[state, disc, prism], required[state, prism]
        nearest_disc = Discs(discs.offsets[disc, None], discs.radii[disc, None], discs.min_cosine)
        columns = [values[prism, None] for values in self._prisms[:-1]]
        nearest_prism = Prisms._make([*columns, self._prisms.names])
        after = _compute_distance(*displaced, nearest_disc, nearest_prism, self._ends) - required[:, None]
        tilt_before, tilt_after = (_compute_tilt_slack(values, discs) for values in (axes, displaced[1]))
        is_tilt_nearer = (tilt_before < before)[:, None]
        return np.where(is_tilt_nearer, tilt_after - tilt_before[:, None], after - before[:, None])

    def require_clearance(self, tips: Array, axes: Array, discs: Discs) -> None:
        """Check the distances of tool and load from the obstacles at tips `(N, 3)` [m] and axes `(N, 3)`.

        Raises:
            Blocked: A state is too near to an obstacle; the message names the obstacle and the tool position.
        """
        tilt_slack = _compute_tilt_slack(axes, discs)
        if tilt_slack.min() < -MAX_EXTRA_TILT:
            tip = tips[np.argmin(tilt_slack)]
            raise Blocked(f"the motion would tilt the tool too far{_describe_tip(tip)}")
        # Undetected objects need no margin; the load must not be pressed into the table or a floor.
        tolerances = np.where(self._prisms.undetected, self._margin, POSITION_TOLERANCE + SAMPLING_MARGIN)
        tolerances = np.where(self._prisms.supports, MAX_PENETRATION, tolerances)
        required = self._find_required_distances(tips)[:, None]
        slack = self._compute_distances(tips, axes, discs) - required + tolerances
        slack = slack.min(axis=1)
        state, prism = np.unravel_index(np.argmin(slack), slack.shape)
        if slack[state, prism] < 0:
            shortfall = (tolerances[prism] - slack[state, prism]) * 1000
            raise Blocked(
                f"the motion would bring tool or load {shortfall:.0f} mm too near to "
                f"{self._prisms.names[prism]}{_describe_tip(tips[state])}"
            )

    def _find_required_distances(self, tips: Array) -> Array:
        """Return the required distance of each state from each prism `(N, K)` [m]."""
        end_distances = np.linalg.norm(tips[:, None, :2] - self._ends, axis=-1).min(axis=1)
        return np.where((end_distances < OBSERVED_RADIUS)[:, None], self._end_margins, self._margin)

    def _compute_distances(self, tips: Array, axes: Array, discs: Discs) -> Array:
        """Return the distance of each disc from each prism in each state `(N, P, K)` [m], negative inside."""
        columns = Discs(discs.offsets[:, None], discs.radii[:, None], discs.min_cosine)
        return _compute_distance(tips[:, None, None], axes[:, None, None], columns, self._prisms, self._ends)


def _compute_distance(tips: Array, axes: Array, discs: Discs, prisms: Prisms, ends: Array) -> Array:
    """Return the distance between discs and prisms [m], negative inside; the shapes broadcast."""
    low, high = prisms.low, prisms.high
    centres = tips + discs.offsets[..., None] * axes
    x, y = centres[..., 0], centres[..., 1]
    end_distance = np.sqrt(np.min([(x - ex) ** 2 + (y - ey) ** 2 for ex, ey in ends], axis=0))
    undetected_top = np.clip(UNDETECTED_HEIGHT_SLOPE * (end_distance - OBSERVED_RADIUS), 0.0, prisms.tops)
    top = np.where(prisms.undetected, undetected_top, prisms.tops)
    sine_of_tilt = np.sqrt(np.maximum(0.0, 1 - axes[..., 2] ** 2))
    vertical = centres[..., 2] - discs.radii * sine_of_tilt - top
    dx = np.maximum(np.maximum(low[..., 0] - x, x - high[..., 0]), 0.0)
    dy = np.maximum(np.maximum(low[..., 1] - y, y - high[..., 1]), 0.0)
    horizontal = np.sqrt(dx**2 + dy**2) - prisms.radii - discs.radii
    outside = np.sqrt(np.maximum(horizontal, 0.0) ** 2 + np.maximum(vertical, 0.0) ** 2)
    return np.where(outside > 0, outside, np.maximum(horizontal, vertical))


def _describe_tip(tip: Array) -> str:
    x, y, z = tip
    return f", with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"


def _compute_tilt_slack(axes: Array, discs: Discs) -> Array:
    """Return the remaining tilt of tool axes `(..., 3)` up to the limit, as an equivalent distance [m]."""
    return TILT_DISTANCE * (-axes[..., 2] - discs.min_cosine)


def _build_prisms(config: CellConfig, obstacles: Sequence[Obstacle]) -> Prisms:
    """Return the obstacles that the cell file declares, and the other obstacles, as prisms."""
    max_radius = max(kind.radius for kind in config.objects.values())
    # Columns: x range, y range, radius, top [m]; is undetected; is a support; name.
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
    for o in obstacles:
        rows.append((o.x, o.x, o.y, o.y, o.radius + POSITION_TOLERANCE, o.top, False, False, o.name))
    table, names = np.array([row[:8] for row in rows]), tuple(row[8] for row in rows)
    corners = table[:, [0, 2]], table[:, [1, 3]]
    return Prisms(*corners, table[:, 4], table[:, 5], table[:, 6] > 0, table[:, 7] > 0, names)

"""Distance model of the cell for planning: obstacles as upright prisms, tool and load as discs.

The model gives the distances between all states of a motion and all obstacles in a few array operations.

The workspace counts as an obstacle, because undetected objects may lie in the workspace. Near the two ends of
a motion, detectors have found all objects; only known obstacles count there.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.config import CellConfig
from executive.cell.objects import BIN_THICKNESS, ObjectClass, Obstacle
from executive.errors import Blocked
from executive.geometry import Array, format_point
from executive.motion.joints import SAMPLING_MARGIN

OBSERVED_RADIUS = 0.05
"""Radius around the ends of a motion in which only known obstacles count [m]."""
UNDETECTED_HEIGHT_SLOPE = 1.5
"""Increase of the assumed height of undetected objects with the distance beyond `OBSERVED_RADIUS` [m/m]."""
POSITION_TOLERANCE = 0.003
"""Tolerance of the position of an observed object, and of a load relative to the tool axis [m]."""
MAX_PENETRATION = 2e-4
"""Maximum depth by which a moving load may be pressed into its support [m]."""
DISTANCE_PER_COSINE = 0.1
"""Factor that converts the cosine of the tool's tilt to an equivalent distance [m]."""
MAX_EXTRA_TILT = 0.003
"""Maximum tilt of the tool beyond its limit during a motion, as an equivalent distance [m]."""
MIN_COSINE_UNLOADED = 0.5
"""Minimum cosine between the tool axis and straight down without a load."""
MIN_COSINE_LOADED = 0.8
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


def make_tool_discs(config: CellConfig, load: ObjectClass | None, opening: float = 0.0) -> Discs:
    """Return the discs of the tool and its load: one at the lower end of each part, two of the load.

    Parts inside the cylinder of the load have no disc. `opening` is the distance between the fingers [m].
    """
    parts = config.tool.list_parts(opening)[::-1]
    if load is None:
        radii = np.array([part.radius for part in parts])
        return Discs(np.array([-part.offset for part in parts]), radii, MIN_COSINE_UNLOADED)
    load_radius = load.radius + load.contact_radius + POSITION_TOLERANCE
    bottom = config.tool.get_hold_height(load)
    top = bottom - load.height
    outer_parts = [part for part in parts if -part.offset < top or part.radius > load_radius]
    # The load has a disc at its bottom and one at its top, because the tool may tilt.
    offsets = np.array([bottom, top, *(-part.offset for part in outer_parts)])
    radii = np.array([load_radius, load_radius, *(part.radius for part in outer_parts)])
    return Discs(offsets, radii, MIN_COSINE_LOADED)


class Prisms(NamedTuple):
    """`K` upright obstacles; each base is a rectangle or a point, enlarged by a radius.

    Attributes:
        min_x, min_y, max_x, max_y: Smallest and largest coordinates of the rectangles, `(K,)` each [m].
        radii: Enlargement of the bases `(K,)` [m].
        tops: Height of the upper sides above the world's origin `(K,)` [m].
        is_undetected: True for undetected objects, which do not count near the ends of a motion `(K,)`.
        is_support: True for surfaces on which a load may lie `(K,)`.
        names: Name of each obstacle in messages.
    """

    min_x: Array
    min_y: Array
    max_x: Array
    max_y: Array
    radii: Array
    tops: Array
    is_undetected: NDArray[np.bool_]
    is_support: NDArray[np.bool_]
    names: tuple[str, ...]

    def select(self, indices: NDArray[np.intp]) -> Prisms:
        """Return the prisms with the given indices; `names` keeps all names, in the original order."""
        return Prisms._make([*(values[indices] for values in self[:-1]), self.names])


class NearestPairs(NamedTuple):
    """For each of `N` states, the pair of disc and prism with the smallest slack.

    Attributes:
        slack: Minimum of `pair_slack` and `tilt_slack` `(N,)` [m]; in the optimizer, also of the slack of the
            joint range.
        pair_slack: Slack of the pair `(N,)` [m].
        tilt_slack: Slack of the tilt of the tool `(N,)` [m].
        distances: Distance between disc and prism of the pair `(N,)` [m], negative for a penetration.
        disc_indices, prism_indices: Indices of the pair `(N,)`.
    """

    slack: Array
    pair_slack: Array
    tilt_slack: Array
    distances: Array
    disc_indices: NDArray[np.intp]
    prism_indices: NDArray[np.intp]

    def select(self, indices: NDArray[np.intp]) -> NearestPairs:
        """Return the values of the states with the given indices."""
        return NearestPairs._make(values[indices] for values in self)


class ClearanceModel:
    """Obstacles of a cell, and their distances from the states of a motion.

    Args:
        config: Content of the cell file.
        obstacles: Obstacles that the cell file does not declare.
        end_positions: Horizontal positions of the start and the end of the motion `(E, 2)` [m].
        discs: Tool and load.
    """

    def __init__(
        self, config: CellConfig, obstacles: Sequence[Obstacle], end_positions: Array, discs: Discs
    ) -> None:
        self._margin = config.motion.margin + SAMPLING_MARGIN
        self._prisms = _build_prisms(config, obstacles)
        self._end_positions = end_positions
        self._discs = discs
        self._end_margins = np.full(len(self._prisms.names), self._margin)

    def relax_end_margins(self, tcps: Array, axes: Array, min_margin: float = -math.inf) -> None:
        """For each prism, limit the required distance near the ends to the smallest distance at the ends.

        `tcps` `(E, 3)` [m] and `axes` `(E, 3)` are the tool centre points and tool axes at the ends. The
        required distance stays at least `min_margin` [m].
        """
        all_prisms = np.arange(len(self._prisms.names))
        end_distances = self._compute_all_distances(tcps, axes, all_prisms).min(axis=(1, 2))
        self._end_margins = np.clip(end_distances, min_margin, self._margin)

    def find_nearest_pairs(self, tcps: Array, axes: Array, max_slack: float = math.inf) -> NearestPairs:
        """Return the pair of disc and prism with the smallest slack in each state.

        The slack is the difference between distance and required distance. A slack up to `max_slack` [m] is
        exact; a larger slack is an upper bound, because prisms that are far from all states are skipped.
        `tcps` `(N, 3)` [m] and `axes` `(N, 3)` are the tool centre points and the tool axes.
        """
        near_prisms = self._find_near_prisms(tcps, axes, max_slack)
        required_distances = self._find_required_distances(tcps, near_prisms)
        slack = self._compute_all_distances(tcps, axes, near_prisms) - required_distances[:, None]
        flat_slack = slack.reshape(-1, len(tcps))
        pairs = flat_slack.argmin(axis=0)
        states = np.arange(len(tcps))
        pair_slack = flat_slack[pairs, states]
        tilt_slack = self._compute_tilt_slack(axes)
        prisms, discs = np.divmod(pairs, len(self._discs.radii))
        distances = required_distances[prisms, states] + pair_slack
        min_slack = np.minimum(pair_slack, tilt_slack)
        return NearestPairs(min_slack, pair_slack, tilt_slack, distances, discs, near_prisms[prisms])

    def compute_slack_changes(self, pairs: NearestPairs, tcps: Array, axes: Array) -> Array:
        """Return the change of the slack of each state for each of `M` small displacements `(N, M)` [m].

        Args:
            pairs: Pairs of the states; for each state, only the slack of its pair or of its tilt counts.
            tcps: Displaced tool centre points `(N, M, 3)` [m].
            axes: Displaced tool axes `(N, M, 3)`.
        """
        discs = pairs.disc_indices[:, None]
        prisms = pairs.prism_indices[:, None]
        slack_change = self._compute_distances(tcps, axes, discs, prisms) - pairs.distances[:, None]
        tilt_change = self._compute_tilt_slack(axes) - pairs.tilt_slack[:, None]
        return np.where((pairs.tilt_slack < pairs.pair_slack)[:, None], tilt_change, slack_change)

    def require_clearance(self, tcps: Array, axes: Array) -> None:
        """Check the distances from the obstacles at tool centre points `(N, 3)` [m] and axes `(N, 3)`.

        Raises:
            Blocked: A state is too near to an obstacle; the message names the obstacle and the tool position.
        """
        tilt_slack = self._compute_tilt_slack(axes)
        if tilt_slack.min() < -MAX_EXTRA_TILT:
            place = format_point(tcps[np.argmin(tilt_slack)])
            raise Blocked(f"the motion would tilt the tool too far, with the tool at {place}")
        near_prisms = self._find_near_prisms(tcps, axes, 0.0)
        # Undetected objects need no margin. The load must not be pressed into the table or a floor.
        prisms = self._prisms.select(near_prisms)
        tolerances = np.where(prisms.is_undetected, self._margin, POSITION_TOLERANCE + SAMPLING_MARGIN)
        tolerances = np.where(prisms.is_support, MAX_PENETRATION, tolerances)
        required_distances = self._find_required_distances(tcps, near_prisms)
        distances = self._compute_all_distances(tcps, axes, near_prisms).min(axis=1)
        slack = (distances - required_distances + tolerances[:, None]).T
        state, prism = np.unravel_index(np.argmin(slack), slack.shape)
        if slack[state, prism] < 0:
            shortfall = (tolerances[prism] - slack[state, prism]) * 1000
            raise Blocked(
                f"the motion would bring tool or load {shortfall:.0f} mm too near to "
                f"{prisms.names[near_prisms[prism]]}, with the tool at {format_point(tcps[state])}"
            )

    def _find_near_prisms(self, tcps: Array, axes: Array, max_slack: float) -> NDArray[np.intp]:
        """Return the indices of the prisms whose slack may be `max_slack` [m] or less in a state."""
        prisms = self._prisms
        max_distances = prisms.radii + (self._discs.radii.max() + self._margin + max_slack)
        x, y = (tcps[:, i] + self._discs.offsets[:, None] * axes[:, i] for i in range(2))
        is_near_in_x = (prisms.min_x - max_distances < x.max()) & (prisms.max_x + max_distances > x.min())
        is_near_in_y = (prisms.min_y - max_distances < y.max()) & (prisms.max_y + max_distances > y.min())
        return np.flatnonzero(is_near_in_x & is_near_in_y)

    def _find_required_distances(self, tcps: Array, prism_indices: NDArray[np.intp]) -> Array:
        """Return the required distance from each of `K` prisms in each state `(K, N)` [m]."""
        is_near_end = self._compute_end_distances(tcps[:, 0], tcps[:, 1]) < OBSERVED_RADIUS
        return np.where(is_near_end, self._end_margins[prism_indices, None], self._margin)

    def _compute_end_distances(self, x: Array, y: Array) -> Array:
        """Return the horizontal distances of points from the nearest end of the motion [m]."""
        squares = [(x - end_x) ** 2 + (y - end_y) ** 2 for end_x, end_y in self._end_positions]
        return np.sqrt(functools.reduce(np.minimum, squares))

    def _compute_all_distances(self, tcps: Array, axes: Array, prism_indices: NDArray[np.intp]) -> Array:
        """Return the distance of each disc from each of `K` prisms in each state `(K, P, N)` [m].

        The states are the last axis, because operations on long rows are faster.
        """
        all_discs = np.arange(len(self._discs.radii))
        return self._compute_distances(tcps, axes, all_discs[:, None], prism_indices[:, None, None])

    def _compute_distances(
        self, tcps: Array, axes: Array, disc_indices: NDArray[np.intp], prism_indices: NDArray[np.intp]
    ) -> Array:
        """Return the distances between discs and prisms [m], negative inside; all arrays broadcast."""
        offsets = self._discs.offsets[disc_indices]
        radii = self._discs.radii[disc_indices]
        prisms = self._prisms.select(prism_indices)
        x, y, z = (tcps[..., i] + offsets * axes[..., i] for i in range(3))
        sine_of_tilt = np.sqrt(np.maximum(0.0, 1 - axes[..., 2] ** 2))
        end_distance = self._compute_end_distances(x, y)
        max_undetected_top = UNDETECTED_HEIGHT_SLOPE * np.maximum(end_distance - OBSERVED_RADIUS, 0.0)
        top = np.where(prisms.is_undetected, np.minimum(max_undetected_top, prisms.tops), prisms.tops)
        vertical = z - radii * sine_of_tilt - top
        dx = np.maximum(np.maximum(prisms.min_x - x, x - prisms.max_x), 0.0)
        dy = np.maximum(np.maximum(prisms.min_y - y, y - prisms.max_y), 0.0)
        horizontal = np.sqrt(dx * dx + dy * dy) - (prisms.radii + radii)
        outside_h = np.maximum(horizontal, 0.0)
        outside_v = np.maximum(vertical, 0.0)
        outside = np.sqrt(outside_h * outside_h + outside_v * outside_v)
        return np.where(outside > 0, outside, np.maximum(horizontal, vertical))

    def _compute_tilt_slack(self, axes: Array) -> Array:
        """Return the slack of the tilt for tool axes `(..., 3)` as a distance [m]; negative: too tilted."""
        return DISTANCE_PER_COSINE * (-axes[..., 2] - self._discs.min_cosine)


def _build_prisms(config: CellConfig, obstacles: Sequence[Obstacle]) -> Prisms:
    """Return the obstacles that the cell file declares, and the other obstacles, as prisms."""
    max_radius = max(object_class.radius for object_class in config.objects.values())
    # Each row: smallest corner, largest corner, radius, top [m]; is undetected; is a support; name.
    rows: list[tuple[tuple[float, float], tuple[float, float], float, float, bool, bool, str]] = [
        ((config.table.x[0], config.table.y[0]), (config.table.x[1], config.table.y[1]), max_radius,
         config.max_pile_height, True, False, "the space for undetected objects"),
        ((-2.0, -2.0), (2.0, 2.0), 0.0, 0.0, False, True, "the table"),
    ]  # fmt: skip
    for name, bin in config.bins.items():
        x, y, bottom = bin.position
        length, width, height = bin.size
        for low, high in bin.build_bin(name).walls:
            rows.append(((*low,), (*high,), 0.0, bottom + height, False, False, name))
        low_corner = (x - length / 2, y - width / 2)
        high_corner = (x + length / 2, y + width / 2)
        floor = (low_corner, high_corner, 0.0, bottom + BIN_THICKNESS)
        rows.append((*floor, False, True, f"the floor of {name}"))
    for obstacle in obstacles:
        centre = (obstacle.x, obstacle.y)
        radius = obstacle.radius + POSITION_TOLERANCE
        rows.append((centre, centre, radius, obstacle.top, False, False, obstacle.name))
    min_corners, max_corners, *columns, names = zip(*rows, strict=True)
    corners = np.hstack([min_corners, max_corners])
    return Prisms._make([*corners.T, *map(np.array, columns), names])

"""Distance model of the cell: obstacles as prisms, tool and load as discs.

Everything in a cell stands upright on the table, so each thing is the ground it covers and the height of
its top; and what hangs under the flange is taken as upright discs, one under another. The distance of a disc
to a prism is then a matter of a few sums, for all states of a motion at once. It is the search's idea of the
cell, not the last word: what the search finds is checked in a planning world.

The workspace is never entered from the side, although nothing may be known to stand there: something may lie
that no look has shown. Around the place where a motion begins or ends, which has been looked at, only what is
known counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.cell.bins import BIN_THICKNESS
from executive.cell.config import CellConfig
from executive.cell.layout import NECK_LENGTH, TOOL_RADIUS, pile_height
from executive.cell.objects import Load, Obstacle
from executive.errors import Blocked
from executive.geometry import Array

OBSERVED_RADIUS = 0.05
"""Radius around the ends of a motion in which only known things count [m]."""
UNKNOWN_SLOPE = 1.5
"""How much higher unknown things may be for every metre farther away than that."""
POSITION_TOLERANCE = 0.003
"""How far what was seen may be from where it is believed, and a load from the tool's axis [m]."""
SAMPLING_MARGIN = 0.001
"""What is kept beyond the cell's margin, for what happens between the states that are looked at [m]."""
MAX_PENETRATION = 2e-4
"""How far a load may be pressed into what it lies on, in passing [m]."""
TILT_DISTANCE = 0.1
"""Metres of distance that a tool axis counts for whose cosine is by 1 too small."""
MAX_EXTRA_TILT = 0.003
"""How much farther than that, as a distance, the tool may tilt in passing [m]."""
MIN_COSINE_DOWN, MIN_COSINE_DOWN_LOADED = 0.5, 0.8
"""Least cosine between the tool's axis and straight down, empty and with a load."""


class Discs(NamedTuple):
    """What hangs under the flange: discs about the tool's axis.

    Attributes:
        offset: Distance of each from the tool centre point along the axis, away from the arm `(P,)` [m].
        radius: `(P,)` [m]
        upright: Least cosine between the axis and straight down.
    """

    offset: Array
    radius: Array
    upright: float


def discs_below_flange(config: CellConfig, load: Load | None) -> Discs:
    """Return the discs of the tool and what it holds."""
    if load is None:
        return Discs(
            np.array([0.0, -NECK_LENGTH]), np.array([config.tool.cup_radius, TOOL_RADIUS]), MIN_COSINE_DOWN
        )
    reach = load.kind.radius + load.kind.ring + POSITION_TOLERANCE
    # The load's underside and its top, which is elsewhere where the tool leans.
    offsets = np.array([load.kind.height, 0.0, -NECK_LENGTH])
    return Discs(offsets, np.array([reach, reach, TOOL_RADIUS]), MIN_COSINE_DOWN_LOADED)


class Prisms(NamedTuple):
    """Upright things, `K` of them: cylinders where the rectangle is a point, boxes where the radius is 0.

    Attributes:
        low, high: Corners of the rectangles `(K, 2)` [m].
        radius: What is added around the rectangle `(K,)` [m].
        top: Height `(K,)` [m].
        open: Whether they do not count around the ends of a motion `(K,)`.
        flat: Whether they are ground that a load may lie on `(K,)`.
        names: What they are.
    """

    low: Array
    high: Array
    radius: Array
    top: Array
    open: NDArray[np.bool_]
    flat: NDArray[np.bool_]
    names: tuple[str, ...]

    def chosen(self, numbers: NDArray[np.intp]) -> Prisms:
        """Return the prism of each of the numbers `(N,)`, shaped `(N, 1)`."""
        at = numbers, None
        sizes = self.low[at], self.high[at], self.radius[at], self.top[at]
        return Prisms(*sizes, self.open[at], self.flat[at], self.names)


class ClearanceModel:
    """Prisms of a cell, and the distances of a motion to them.

    Args:
        config: The cell file.
        around: What stands there besides.
        ends: Where the motion begins and ends, seen from above `(E, 2)` [m].
    """

    def __init__(self, config: CellConfig, around: Sequence[Obstacle], ends: Array) -> None:
        self._margin = config.motion.margin + SAMPLING_MARGIN
        self._prisms = _prisms(config, around)
        self._ends = ends
        self._allowed = np.full(len(self._prisms.names), self._margin)

    def relax(self, tips: Array, axes: Array, discs: Discs) -> None:
        """Allow near the ends what is unavoidable: what tool and load keep from things there `(E, 3)` [m]."""
        there = self._distances(tips, axes, discs).min(axis=(0, 1))
        self._allowed = np.minimum(there, self._margin)

    def slack(self, tips: Array, axes: Array, discs: Discs) -> Array:
        """Return by how much states keep their distance from everything `(N,)` [m]; negative: too near.

        Args:
            tips: Tool centre points `(N, 3)` [m].
            axes: Tool axes `(N, 3)`.
            discs: What hangs there.
        """
        near = self._distances(tips, axes, discs) - self._required(tips)[:, None]
        return np.minimum(near.min(axis=(1, 2)), _uprightness(axes, discs))

    def slopes(self, tips: Array, axes: Array, discs: Discs, moved: tuple[Array, Array]) -> Array:
        """Return by how much the slack of states changes as they are moved `(N, M)` [m].

        Of each state the disc and the thing count that are nearest to each other before.

        Args:
            tips: Tool centre points `(N, 3)` [m].
            axes: Tool axes `(N, 3)`.
            discs: What hangs there.
            moved: Tool centre points and axes of the moved states, `(N, M, 3)` each.
        """
        required = self._required(tips)
        near = self._distances(tips, axes, discs) - required[:, None]
        number, count = np.arange(len(tips)), near.shape[2]
        disc, prism = np.divmod(near.reshape(len(tips), near.shape[1] * count).argmin(axis=1), count)
        before, required = near[number, disc, prism], required[number, prism]
        nearest = Discs(discs.offset[disc, None], discs.radius[disc, None], discs.upright)
        after = self._distance(*moved, nearest, self._prisms.chosen(prism)) - required[:, None]
        upright, tilted = _uprightness(axes, discs), _uprightness(moved[1], discs)
        return np.where((upright < before)[:, None], tilted - upright[:, None], after - before[:, None])

    def require_clear(self, tips: Array, axes: Array, discs: Discs) -> None:
        """Make sure that all states keep their distance; arguments as for `slack`.

        Raises:
            Blocked: One does not; the text names the thing and where.
        """
        if (upright := _uprightness(axes, discs)).min() < -MAX_EXTRA_TILT:
            at = int(np.argmin(upright))
            raise Blocked(f"the motion would tilt the tool too far{_at(tips[at])}")
        # To what may be there the margin need not be kept; nothing may be pressed into table or floor.
        spare = np.where(self._prisms.open, self._margin, POSITION_TOLERANCE + SAMPLING_MARGIN)
        spare = np.where(self._prisms.flat, MAX_PENETRATION, spare)
        near = (self._distances(tips, axes, discs) - self._required(tips)[:, None] + spare).min(axis=1)
        at, number = (int(index) for index in np.unravel_index(np.argmin(near), near.shape))
        if near[at, number] < 0:
            raise Blocked(
                f"the motion would bring tool or load {(spare[number] - near[at, number]) * 1000:.0f} mm too "
                f"near to {self._prisms.names[number]}{_at(tips[at])}"
            )

    def _required(self, tips: Array) -> Array:
        """Return the distance to be kept by each state from each prism `(N, K)` [m]."""
        away = np.linalg.norm(tips[:, None, :2] - self._ends, axis=-1).min(axis=1)
        return np.where((away < OBSERVED_RADIUS)[:, None], self._allowed, self._margin)

    def _distances(self, tips: Array, axes: Array, discs: Discs) -> Array:
        """Return the distance of each disc to each prism `(N, P, K)` [m], negative inside."""
        each = Discs(discs.offset[:, None], discs.radius[:, None], discs.upright)
        return self._distance(tips[:, None, None], axes[:, None, None], each, self._prisms)

    def _distance(self, tips: Array, axes: Array, discs: Discs, prisms: Prisms) -> Array:
        """Return the distance between discs and prisms [m], negative inside; shapes broadcast."""
        low, high = prisms.low, prisms.high
        centres = tips + discs.offset[..., None] * axes
        x, y = centres[..., 0], centres[..., 1]
        # What is not known to be empty is a funnel around the ends.
        away = np.sqrt(np.min([(x - ex) ** 2 + (y - ey) ** 2 for ex, ey in self._ends], axis=0))
        funnel = np.clip(UNKNOWN_SLOPE * (away - OBSERVED_RADIUS), 0.0, prisms.top)
        top = np.where(prisms.open, funnel, prisms.top)
        tilt = np.sqrt(np.maximum(0.0, 1 - axes[..., 2] ** 2))
        above = centres[..., 2] - discs.radius * tilt - top
        across_x = np.maximum(np.maximum(low[..., 0] - x, x - high[..., 0]), 0.0)
        across_y = np.maximum(np.maximum(low[..., 1] - y, y - high[..., 1]), 0.0)
        across = np.sqrt(across_x**2 + across_y**2) - prisms.radius - discs.radius
        outside = np.sqrt(np.maximum(across, 0.0) ** 2 + np.maximum(above, 0.0) ** 2)
        return np.where(outside > 0, outside, np.maximum(across, above))


def _at(tip: Array) -> str:
    x, y, z = tip
    return f", with the tool at ({x:.3f}, {y:.3f}, {z:.3f}) m"


def _uprightness(axes: Array, discs: Discs) -> Array:
    """Return by how much tool axes `(..., 3)` are more upright than they must be, as a distance [m]."""
    return TILT_DISTANCE * (-axes[..., 2] - discs.upright)


def _prisms(config: CellConfig, around: Sequence[Obstacle]) -> Prisms:
    rows: list[tuple[float, float, float, float, float, float, bool, bool, str]] = []
    widest = max(kind.radius for kind in config.objects.values())
    (x0, x1), (y0, y1) = config.table.x, config.table.y
    rows.append((x0, x1, y0, y1, widest, pile_height(config), True, False, "what may lie on the workspace"))
    rows.append((-2.0, 2.0, -2.0, 2.0, 0.0, 0.0, False, True, "the table"))
    for name, bin in config.bins.items():
        (x, y, floor), (length, width, height), t = bin.position, bin.size, BIN_THICKNESS
        left, right, front, back = x - length / 2, x + length / 2, y - width / 2, y + width / 2
        top = floor + height
        for wall in (
            (left - t, left, front - t, back + t), (right, right + t, front - t, back + t),
            (left, right, front - t, front), (left, right, back, back + t),
        ):  # fmt: skip
            rows.append((*wall, 0.0, top, False, False, name))
        rows.append((left, right, front, back, 0.0, floor + t, False, True, f"the floor of {name}"))
    rows += [(o.x, o.x, o.y, o.y, o.radius + POSITION_TOLERANCE, o.top, False, False, o.name) for o in around]
    table, names = np.array([row[:8] for row in rows]), tuple(row[8] for row in rows)
    corners = table[:, [0, 2]], table[:, [1, 3]]
    return Prisms(*corners, table[:, 4], table[:, 5], table[:, 6] > 0, table[:, 7] > 0, names)

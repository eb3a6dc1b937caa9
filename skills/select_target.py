"""Skill that selects the next target and its bin."""

from __future__ import annotations

import math
from collections.abc import Callable

from executive.cell.objects import Item, Target
from executive.cell.protocols import Cell
from executive.manipulation.grasps import explain_blocked_grasp
from executive.manipulation.tool_goals import choose_bin, sort_by_tour, sort_pickable_targets
from executive.perception.evidence import describe_unknown_labels
from executive.skill import In, Out, Skill, SkillFailed, param, port

UNSELECTABLE_STATES = ("held", "placed", "rejected", "skipped")
"""States of an item that cannot be selected; not `lost`, because a look may find a lost item."""


class SelectTarget(Skill):
    """Select the next target to pick, and its bin.

    The skill selects only open items with a valid position and a certain class, if a bin of the class is
    below its quota. The class of an item is certain if the probability of a wrong class, given the error
    rates of the detector, is at most the limit of the cell. The skill chooses the first bin of the class that
    has a quota and is below this quota; without quotas, the bin with the fewest objects. Last come
    deferred items (see `Defer`), and before them items beside which the fingers have no space.

    * `shortest_tour` prefers the target with which the travel to all targets, each from the bin of the last
      one, is the shortest.
    * `nearest` prefers the target nearest to the tool or, while the arm moves, to the destination of the arm.
    * `surest` prefers the target with the highest confidence of the last detection.
    * `least_tried` prefers the fewest failed attempts and, of several such targets, the nearest.
    * With `among`, the skill fails with `no_candidate` as soon as none of these items is open or lost.
    * With `where`, only targets for which this expression is true are candidates.
    * With `order_by`, the target with the smallest value of this expression comes first.
    * With `same`, the skill fails with `no_candidate` if the item is held, placed, rejected or skipped, or
      after `attempts` failed attempts to pick it.
    """

    targets: In[list[Target]] = port(doc="the known targets")
    same: In[Item | None] = port(default=None, refers_to="item", doc="only this item")
    wanted: In[str | None] = port(default=None, refers_to="class", doc="only this class")
    among: In[list[Item] | None] = port(default=None, refers_to="item", doc="only these items")
    not_: In[list[Item] | None] = port(default=None, refers_to="item", doc="none of these items")
    target: Out[Target] = port(doc="the chosen target")
    item: Out[Item] = port(refers_to="item", doc="the item of the target")
    bin: Out[str] = port(refers_to="bin", doc="the bin for the target")
    prefer: str = param(
        "shortest_tour",
        choices=("shortest_tour", "nearest", "surest", "least_tried"),
        doc="the first of the `shortest_tour`, the `nearest`, the `surest` or the `least_tried` target",
    )
    where: Callable[[Target], bool] | None = param(
        None, candidate="target", doc="expression that is true for the candidates, with `$target`"
    )
    order_by: Callable[[Target], float] | None = param(
        None, candidate="target", doc="expression whose smallest value comes first, with `$target`"
    )
    attempts: int = param(100, ge=1, doc="number of failed attempts after which `same` is no candidate")
    reasons = ("no_candidate", "unseen", "doubtful")

    def run(self, cell: Cell) -> None:
        """Select the first candidate in the preferred order."""
        if self.same and (count := cell.ledger.describe(self.same).attempts) >= self.attempts:
            raise self.failure("no_candidate", f"{count} attempts to pick {self.same} failed")
        pickable_targets = sort_pickable_targets(cell, self.targets)
        candidates = [target for target in pickable_targets if self._is_requested(cell, target.item)]
        if not candidates:
            raise self._make_failure_without_candidate(cell)
        if self.where is not None:
            chosen = list(filter(self.where, candidates))
            if not chosen:
                # The others do not matter: what is left is unseen, doubtful or nothing.
                self.not_ = [*(self.not_ or ()), *(target.item for target in candidates)]
                raise self._make_failure_without_candidate(cell)
            candidates = chosen
        if self.prefer == "shortest_tour":
            candidates = sort_by_tour(cell, candidates)
        # The candidates are sorted by distance or tour, and `min` returns the first of equal ones.
        best = min(candidates, key=lambda target: self._make_sort_key(cell, target))
        if names := self._format_uncertain_items(cell, cell.ledger.describe(best.item).deferral_rank):
            message = f"{best.item} is deferred, and not enough looks agree on {names} yet; look again"
            raise self.failure("doubtful", message)
        self.target = best
        self.item = best.item
        self.bin = choose_bin(cell, best.item)
        cell.report_selection(best, self.bin)

    def _make_sort_key(self, cell: Cell, target: Target) -> tuple[float | str, ...]:
        """Return the sort key of a candidate; the smallest key comes first."""
        known = cell.ledger.describe(target.item)
        is_blocked = bool(explain_blocked_grasp(cell, target))
        if self.order_by is not None:
            return known.deferral_rank, is_blocked, self.order_by(target)
        if self.prefer == "surest":
            return known.deferral_rank, is_blocked, -target.confidence, target.item
        attempts = known.attempts if self.prefer == "least_tried" else 0
        return known.deferral_rank, is_blocked, attempts

    def _is_permitted(self, cell: Cell, item: Item) -> bool:
        """Return True if a bin for an item is free, and `same`, `among` and `not` permit the item."""
        is_excluded = item in (self.not_ or ()) or (self.among is not None and item not in self.among)
        return not is_excluded and self.same in (None, item) and choose_bin(cell, item) != ""

    def _is_requested(self, cell: Cell, item: Item) -> bool:
        """Return True if an item is permitted, and its most probable class is `wanted`."""
        return self.wanted in (None, cell.ledger.get_label(item)) and self._is_permitted(cell, item)

    def _format_uncertain_items(self, cell: Cell, rank_limit: float = math.inf) -> str:
        """Return the names of the uncertain requested items whose deferral rank is below `rank_limit`."""
        items = (item for item in cell.ledger.find_uncertain_items() if self._is_requested(cell, item))
        return ", ".join(item for item in items if cell.ledger.describe(item).deferral_rank < rank_limit)

    def _has_nothing_left(self, cell: Cell) -> bool:
        """Return True if no requested item is left, or if none of the items in `among` is open or lost.

        An item counts as left if a weighing may find that it is of the class `wanted`.
        """
        ledger = cell.ledger
        if self.among is None:
            return self.same is None and ledger.is_table_empty(self.wanted, self.not_ or ())
        return not any(
            (known.is_open or known.state == "lost")
            and self.wanted in (None, *ledger.list_possible_labels(known.item))
            and self._is_permitted(cell, known.item)
            for known in ledger.list_known_items()
        )

    def _make_failure_without_candidate(self, cell: Cell) -> SkillFailed:
        """Return the failure with the reason why there is no candidate."""
        if self.same and (state := cell.ledger.describe(self.same).state) in UNSELECTABLE_STATES:
            skip_reason = cell.ledger.explain_skipped_class(cell.ledger.get_label(self.same))
            cause = f": {skip_reason}" if state == "skipped" else ""
            return self.failure("no_candidate", f"{self.same} is {state}{cause}")
        if names := self._format_uncertain_items(cell):
            return self.failure("doubtful", f"not enough looks agree on {names} yet; look again")
        name = self.same or self.wanted or "object to sort"
        if self._has_nothing_left(cell):
            labels = (label for label in cell.routes if self.wanted in (None, label))
            skip_reasons = sorted({cell.ledger.explain_skipped_class(label) for label in labels} - {""})
            surplus = " and surplus objects" if skip_reasons else ""
            message = f"no {name} is left on the table, except rejected objects{surplus}"
            unknown_labels = describe_unknown_labels(cell.ledger.unknown_labels)
            details = (message, *skip_reasons, unknown_labels)
            return self.failure("no_candidate", "; ".join(filter(None, details)))
        return self.failure("unseen", f"no {name} is in sight, but it is not certain that the table is empty")

"""Where things stand in a picture, for trees of any shape."""

from __future__ import annotations

import itertools
import random

import pytest

from executive.view.tree.svg import NodeSize, Rectangle, compute_layout


def draw_tree(seed: int) -> tuple[list[int], list[NodeSize]]:
    """Return the depths of the nodes of a tree, parents before children, and their sizes."""
    chance = random.Random(seed)
    depths = [0]
    for _ in range(chance.randrange(40)):
        depths.append(chance.randint(1, depths[-1] + 1))

    def size() -> NodeSize:
        slot, name = (chance.choice([0.0, chance.uniform(10, 200)]) for _ in range(2))
        return NodeSize(chance.uniform(10, 200), chance.uniform(20, 70), slot, name)

    return depths, [size() for _ in depths]


def list_children(depths: list[int]) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in depths]
    for index, depth in enumerate(depths):
        if depth:
            parent = max(other for other in range(index) if depths[other] == depth - 1)
            children[parent].append(index)
    return children


def list_branch(index: int, depths: list[int]) -> set[int]:
    """Return a node and all that hangs from it."""
    rest = itertools.takewhile(lambda other: depths[other] > depths[index], range(index + 1, len(depths)))
    return {index, *rest}


def overlap(one: Rectangle, other: Rectangle) -> bool:
    across = one.x < other.right_x and other.x < one.right_x
    return across and one.y < other.y + other.height and other.y < one.y + one.height


def contains(outer: Rectangle, inner: Rectangle) -> bool:
    right, bottom = outer.right_x - inner.right_x, outer.y + outer.height - inner.y - inner.height
    return min(inner.x - outer.x, inner.y - outer.y, right, bottom) >= -1e-6


@pytest.mark.parametrize("seed", range(8))
def test_boxes_are_apart_and_a_frame_contains_only_its_subtree(seed):
    depths, sizes = draw_tree(seed)
    layout = compute_layout(depths, list_children(depths), sizes)
    assert not any(overlap(one, other) for one, other in itertools.combinations(layout.boxes, 2))
    whole = Rectangle(0, 0, layout.width, layout.height)
    assert all(contains(whole, part) for part in (*layout.boxes, *layout.frames.values()))
    for index, frame in layout.frames.items():
        branch = list_branch(index, depths)
        assert frame.width >= sizes[index].subtree_name_width
        for other, box in enumerate(layout.boxes):
            assert contains(frame, box) if other in branch else not overlap(frame, box)


def test_a_small_tree_stands_exactly_there():
    sizes = [
        NodeSize(60, 28),
        NodeSize(50, 28, label_width=20),
        NodeSize(40, 42, subtree_name_width=90),
        NodeSize(30, 28),
    ]
    plan = compute_layout([0, 1, 1, 2], [[1, 2], [], [3], []], sizes)
    assert plan.boxes == (
        Rectangle(16, 16, 60, 28), Rectangle(137, 16, 50, 28), Rectangle(137, 74, 40, 42),
        Rectangle(219, 81, 30, 28),
    )  # fmt: skip
    assert plan.edge_xs == (16, 92, 203)
    assert plan.frames == {2: Rectangle(128, 54, 130, 71)}
    assert (plan.width, plan.height) == (274, 141)

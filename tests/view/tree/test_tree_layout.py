"""Where things stand in a picture, for trees of any shape."""

from __future__ import annotations

import itertools
import random

import pytest

from executive.view.tree.tree_layout import NodeSize, Rectangle, compute_layout


def drawn_by_chance(seed: int) -> tuple[list[int], list[NodeSize]]:
    """Return the depths of the nodes of a tree, parents before children, and their sizes."""
    chance = random.Random(seed)
    depths = [0]
    for _ in range(chance.randrange(40)):
        depths.append(chance.randint(1, depths[-1] + 1))

    def size() -> NodeSize:
        slot, name = (chance.choice([0.0, chance.uniform(10, 200)]) for _ in range(2))
        return NodeSize(chance.uniform(10, 200), chance.uniform(20, 70), slot, name)

    return depths, [size() for _ in depths]


@pytest.fixture(params=range(8))
def tree(request: pytest.FixtureRequest) -> tuple[list[int], list[NodeSize]]:
    return drawn_by_chance(request.param)


def below(depths: list[int]) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in depths]
    for index, depth in enumerate(depths):
        if depth:
            parent = max(other for other in range(index) if depths[other] == depth - 1)
            children[parent].append(index)
    return children


def inside(index: int, depths: list[int]) -> set[int]:
    """Return a node and all that hangs from it."""
    rest = itertools.takewhile(lambda other: depths[other] > depths[index], range(index + 1, len(depths)))
    return {index, *rest}


def overlap(one: Rectangle, other: Rectangle) -> bool:
    across = one.x < other.right_x and other.x < one.right_x
    return across and one.y < other.y + other.height and other.y < one.y + one.height


def contains(outer: Rectangle, inner: Rectangle) -> bool:
    right, bottom = outer.right_x - inner.right_x, outer.y + outer.height - inner.y - inner.height
    return min(inner.x - outer.x, inner.y - outer.y, right, bottom) >= -1e-6


def test_nodes_stand_clear_of_each_other_in_their_order_and_level_with_their_first_child(tree):
    depths, nodes = tree
    plan = compute_layout(depths, below(depths), nodes)
    assert not any(overlap(one, other) for one, other in itertools.combinations(plan.boxes, 2))
    for parent, among in enumerate(below(depths)):
        middles = [plan.boxes[child].middle_y for child in among]
        assert middles == sorted(middles)
        for child in among:
            trunk = plan.edge_xs[depths[child]]
            assert plan.boxes[parent].right_x < trunk < plan.boxes[child].x - nodes[child].label_width
        if among and not nodes[parent].subtree_name_width:
            assert abs(plan.boxes[parent].middle_y - middles[0]) < 1e-6
    whole = Rectangle(0, 0, plan.width, plan.height)
    assert all(contains(whole, part) for part in (*plan.boxes, *plan.frames.values()))


def test_a_frame_holds_its_subtree_and_nothing_else(tree):
    depths, nodes = tree
    plan = compute_layout(depths, below(depths), nodes)
    assert set(plan.frames) == {index for index, size in enumerate(nodes) if size.subtree_name_width}
    for index, frame in plan.frames.items():
        within = inside(index, depths)
        assert frame.width >= nodes[index].subtree_name_width
        for other, box in enumerate(plan.boxes):
            assert contains(frame, box) if other in within else not overlap(frame, box)
        for other, another in plan.frames.items():
            assert overlap(frame, another) == (other in within or index in inside(other, depths))


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

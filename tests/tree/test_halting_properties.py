"""Guarantees of halting for every tree, whatever its nodes do and whenever the halt comes."""

from __future__ import annotations

from hypothesis import given, settings
from py_trees.common import Status
from random_trees import PLANS, Plan, World, bottom_up, grow, lives, run
from scripted_leaf import Leaf

from executive.tree.halting import halt

MOST = 12
"""Number of ticks of a tree's life that are looked at."""


@settings(max_examples=60)
@given(plan=PLANS)
def test_running_nodes_end_once_from_the_leaves_up_and_no_other_is_touched(plan: Plan) -> None:
    for root, world in lives(plan, MOST):
        before = {node: node.status for node in bottom_up(root)}
        running = [node for node, status in before.items() if status is Status.RUNNING]
        said = len(world.log)

        problems = halt(root)

        assert world.log[said:] == [f"{node.path} halted" for node in running]
        broken = [node for node in running if isinstance(node, Leaf) and node.breaks]
        assert problems == [f"{node.path}: cannot stop" for node in broken]
        for node, status in before.items():
            assert node.status is (Status.INVALID if status is Status.RUNNING else status)
        assert (dict(world.scope), halt(root)) == ({}, [])
        for node in bottom_up(root):
            if not isinstance(node, Leaf):
                words = [line.split()[1] for line in world.log if line.startswith(f"{node.path} ")]
                turns = [word for word in words if word in ("starts", "halted", "SUCCESS", "FAILURE")]
                assert [word == "starts" for word in turns] == [True, False] * (len(turns) // 2)


@settings(max_examples=60)
@given(plan=PLANS)
def test_a_halted_tree_runs_again_as_a_fresh_one(plan: Plan) -> None:
    fresh = World()
    root = grow(plan, fresh)
    lived = []
    for said in run(root, fresh, MOST):
        lived.append(said)
        # After a fault the tree is halted at once.
        if said in Status.__members__:
            running = [node for node in bottom_up(root) if node.status is Status.RUNNING]
            assert all(node is root or node.parent in running for node in running)
    for root, world in lives(plan, MOST):
        halt(root)
        world.log.clear()
        for node in bottom_up(root):
            if isinstance(node, Leaf):
                node.rewind()
        assert (list(run(root, world, MOST)), world.log) == (lived, fresh.log)

"""What halting guarantees for every tree, whatever its nodes do and whenever it comes."""

from __future__ import annotations

from hypothesis import given, settings
from py_trees.common import Status
from random_trees import PLANS, Plan, World, bottom_up, grow, lives, run
from scripted_leaf import Leaf

from executive.control.halting import halt

MOST = 12
"""How many ticks of a tree's life are looked at."""


@settings(max_examples=200, deadline=None)
@given(plan=PLANS)
def test_what_runs_ends_once_from_the_leaves_up_and_nothing_else_is_touched(plan: Plan) -> None:
    for root, world in lives(plan, MOST):
        before = {node: node.status for node in bottom_up(root)}
        running = [node for node, status in before.items() if status is Status.RUNNING]
        world.log.clear()

        problems = halt(root)

        assert world.log == [f"{node.path} halted" for node in running]
        broken = [node for node in running if isinstance(node, Leaf) and node.breaks]
        assert problems == [f"{node.path}: cannot stop" for node in broken]
        for node, status in before.items():
            assert node.status is (Status.INVALID if status is Status.RUNNING else status)
        assert dict(world.scope) == {}
        assert halt(root) == []


@settings(max_examples=200, deadline=None)
@given(plan=PLANS)
def test_a_halted_tree_runs_again_as_a_fresh_one(plan: Plan) -> None:
    fresh = World()
    lived = list(run(grow(plan, fresh), fresh, MOST))
    for root, world in lives(plan, MOST):
        halt(root)
        world.log.clear()
        for node in bottom_up(root):
            if isinstance(node, Leaf):
                node.rewind()
        assert list(run(root, world, MOST)) == lived
        assert world.log == fresh.log


@settings(max_examples=200, deadline=None)
@given(plan=PLANS)
def test_what_runs_stands_below_what_runs(plan: Plan) -> None:
    world = World()
    root = grow(plan, world)
    for said in run(root, world, MOST):
        # After a fault the tree is halted at once.
        if said in Status.__members__:
            running = [node for node in bottom_up(root) if node.status is Status.RUNNING]
            assert all(node is root or node.parent in running for node in running)


@settings(max_examples=200, deadline=None)
@given(plan=PLANS)
def test_every_start_of_a_control_node_has_one_end(plan: Plan) -> None:
    for root, world in lives(plan, MOST):
        halt(root)
        for node in bottom_up(root):
            if not isinstance(node, Leaf):
                words = [line.split()[1] for line in world.log if line.startswith(f"{node.path} ")]
                turns = [word for word in words if word in ("starts", "halted", "SUCCESS", "FAILURE")]
                assert [word == "starts" for word in turns] == [True, False] * (len(turns) // 2)

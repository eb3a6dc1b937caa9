"""Tree of a recorded run, written and read."""

from __future__ import annotations

import math

import pytest

from executive.errors import InputError
from executive.mission.outline import Connection, OutlineNode
from executive.record.recorded_mission import format_tree, read_tree

LEAF = OutlineNode(
    "tree/retry/do/Grasp", "do: Grasp", 1, "", "skill", "Grasp", "do", "on Grasp.missed", ("pick",), "Grasp",
    "Close the tool.", {"settle": 0.1}, (Connection("target", "target", True),), (), ("missed",),
)  # fmt: skip


def test_a_tree_is_read_as_it_was_written_and_values_that_json_lacks_as_text(tmp_path):
    file = tmp_path / "tree.json"
    odd = OutlineNode("a", "a", 0, "", "skill", "A", params={"x": math.inf, "y": object})
    file.write_text(format_tree([LEAF, odd]))
    leaf, read = read_tree(file)
    assert leaf == LEAF
    assert read.params["x"] == "Infinity" and "object" in read.params["y"]
    file.write_text("{}")
    with pytest.raises(InputError, match=r"contains no tree of a run: input should be a valid array"):
        read_tree(file)

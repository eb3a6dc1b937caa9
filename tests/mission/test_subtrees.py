"""Subtrees: arguments, variables of their own, what they return, and libraries of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from executive.mission.load import LoadedMission
from executive.mission.ports import find_node_wires, find_wires
from executive.skill import Direction, Skill
from executive.text.findings import MissionError
from executive.tree.specification import SkillNode

Load = Callable[..., LoadedMission]

HEAD = "mission: m\ncell: cells/small.yaml\n"


def wiring(loaded: LoadedMission, skills: dict[str, type[Skill]]) -> list[str]:
    """Return what every skill reads and writes, as `Pick seen<-$a held->$b`."""
    lines = []
    for node in loaded.tree.walk():
        if isinstance(node, SkillNode):
            skill = skills[node.skill]
            reads = [f"{w.port.name}<-${w.variable}" for w in find_wires(node, skill, Direction.IN)]
            writes = [f"{w.port.name}->${w.variable}" for w in find_wires(node, skill, Direction.OUT)]
            lines.append(" ".join([node.skill, *reads, *writes]))
    return lines


WIRED = {
    "without returns a subtree shares its variables": (
        "tree: [use: look, Pick]\ntrees: {look: {do: Look}}\n",
        ["Look seen->$seen", "Pick seen<-$seen only<-$only held->$held"],
    ),
    "with returns it keeps the rest to itself, anew for every use": (
        "tree: [use: get, {Drop: {bin: red_bin}}, use: get, {Drop: {bin: red_bin}}]\n"
        "trees: {get: {returns: [held], do: [Look, Pick]}}\n",
        [
            "Look seen->$get.seen", "Pick seen<-$get.seen only<-$only held->$held", "Drop held<-$held",
            "Look seen->$get-2.seen", "Pick seen<-$get-2.seen only<-$only held->$held", "Drop held<-$held",
        ],
    ),
    "what is returned may be called otherwise": (
        "tree: [{use: get, returns: {held: $mine}}, {Drop: {held: $mine, bin: red_bin}}]\n"
        "trees: {get: {returns: [held], do: [Look, Pick]}}\n",
        ["Look seen->$get.seen", "Pick seen<-$get.seen only<-$only held->$mine", "Drop held<-$mine"],
    ),
    "an argument is the variable around, not the subtree's own of that name": (
        "tree: [Look, Pick, {use: outer, with: {which: $held}}]\n"
        "trees:\n"
        "  outer: {args: [which], returns: [seen], do: {use: inner, with: {what: $which}}}\n"
        "  inner:\n"
        "    args: [what]\n"
        "    returns: [seen]\n"
        "    do: [Look, Pick, {Drop: {held: $what, bin: red_bin}}, {Drop: {bin: red_bin}}]\n",
        [
            "Look seen->$seen", "Pick seen<-$seen only<-$only held->$held",
            "Look seen->$seen", "Pick seen<-$seen only<-$only held->$outer.inner.held",
            "Drop held<-$held", "Drop held<-$outer.inner.held",
        ],
    ),
    "an argument may stand for a variable by default": (
        "tree: [Look, Pick, use: drop]\n"
        "trees: {drop: {args: {which: $held}, do: {Drop: {held: $which, bin: red_bin}}}}\n",
        ["Look seen->$seen", "Pick seen<-$seen only<-$only held->$held", "Drop held<-$held"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WIRED)
def test_variables_of_subtrees(case: str, load: Load, skills: dict[str, type[Skill]]) -> None:
    text, expected = WIRED[case]
    assert wiring(load(HEAD + text), skills) == expected


def test_a_loop_in_a_closed_subtree_has_a_variable_of_its_own(load: Load) -> None:
    loaded = load(
        HEAD + "tree: [use: get, {Drop: {bin: red_bin}}]\n"
        "trees:\n"
        "  get:\n"
        "    returns: [held]\n"
        "    do: [Look, {for_each: {each: kind, in: [cube], do: {Pick: {only: $kind}}}}]\n"
    )
    wires = [wire for node in loaded.tree.walk() for wire in find_node_wires(node, {}, Direction.OUT)]
    assert [wire.variable for wire in wires] == ["get.kind"]


def library(name: str, text: str) -> None:
    Path("library").mkdir(exist_ok=True)
    Path(f"library/{name}.yaml").write_text(text)


def test_a_library_lends_its_subtrees(load: Load, skills: dict[str, type[Skill]]) -> None:
    library("eyes", "library: eyes\ntrees: {look: {args: {view: full}, do: {Look: {view: $view}}}}\n")
    loaded = load(HEAD + "library: library/eyes.yaml\ntree: [{use: look, with: {view: table}}, Pick]\n")
    assert wiring(loaded, skills)[0] == "Look seen->$seen"
    assert loaded.libraries == {"library/eyes.yaml": Path("library/eyes.yaml").read_text()}


def test_a_library_does_not_see_the_params_of_the_mission(load: Load) -> None:
    library("hands", "library: hands\ntrees: {get: [Look, {Pick: {height: $high}}]}\n")
    with pytest.raises(MissionError) as caught:
        load(HEAD + "params: {high: 0.2}\nlibrary: library/hands.yaml\ntree: {use: get}\n")
    text = str(caught.value)
    assert "library/hands.yaml:2:37: error[unknown-param]: Pick.height must be a constant" in text
    assert "A library cannot use params: declare high below args of the subtree" in text


def test_what_a_library_has_and_nobody_uses_is_no_mistake(load: Load) -> None:
    library("eyes", "library: eyes\ntrees: {look: Look, unused: {args: [x], do: Look}}\n")
    assert load(HEAD + "library: library/eyes.yaml\ntree: {use: look}\n").warnings == ()


def test_an_output_cannot_take_the_name_of_an_argument(load: Load) -> None:
    text = "tree: {use: get, with: {seen: 0.1}}\ntrees: {get: {args: [seen], do: Look}}"
    with pytest.raises(
        MissionError, match=r"Look\.seen writes \$seen, but seen is an argument of the subtree"
    ):
        load(HEAD + text + "\n")

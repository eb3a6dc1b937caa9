"""XML of missions for BehaviorTree.CPP: elements, ports, names and models, and the rules of its parser."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar
from xml.etree.ElementTree import Element, fromstring

import pytest

from executive.behaviours import load_skills
from executive.mission.load import read_mission
from executive.skill import In, Out, Skill, param, port
from executive.text.files import find_mission, get_shipped_folder
from executive.view.btcpp import format_btcpp

COUNTERPARTS = {
    "Sequence": "", "Fallback": "", "ReactiveSequence": "", "ReactiveFallback": "", "Inverter": "",
    "ForceSuccess": "", "AlwaysSuccess": "", "Repeat": "num_cycles", "RetryUntilSuccessful": "num_attempts",
    "Timeout": "msec", "ScriptCondition": "code", "IfThenElse": "",
    "Parallel": "success_count failure_count", "ParallelAll": "max_failures",
}  # fmt: skip
"""Ports of the nodes of BehaviorTree.CPP that represent control nodes."""


class Fail(Skill):
    """Fail."""

    reasons: ClassVar = ("failed", "late")

    def run(self, cell: Any) -> None: ...


class Held(Fail):
    """Be a condition."""

    is_condition: ClassVar = True


class Sleep(Fail):
    """Have the name of a node of BehaviorTree.CPP, and names that it reserves."""

    _left: In[int] = port(doc="a value")
    ID: Out[int] = port(doc="a value")
    name: str = param("x", doc="name of something")
    exact: bool = param(False, doc="a switch")


SKILLS = {**load_skills(), "Fail": Fail, "Held": Held, "Sleep": Sleep}


def export(path: Path, text: str = "") -> Element:
    """Return the exported XML of the mission in a file, which gets the text if there is one."""
    if text:
        path.write_text(f"cell: cells/overhead.yaml\n{text}", encoding="utf-8")
    files = read_mission(path, {}, SKILLS)
    return fromstring(format_btcpp(files.mission, {**SKILLS, **files.behaviours}).encode())


def list_elements(root: Element, tree_id: str) -> list[str]:
    nodes = root.iterfind(f"BehaviorTree[@ID='{tree_id}']//")
    return [" ".join([node.tag, *(f"{key}={text}" for key, text in node.items())]) for node in nodes]


@pytest.mark.parametrize("name", sorted(path.stem for path in get_shipped_folder().glob("*.yaml")))
def test_behavior_tree_cpp_can_create_every_tree_and_node_of_a_shipped_mission(name: str) -> None:
    root = export(find_mission(name))
    tree_ids = {tree.attrib["ID"] for tree in root.iter("BehaviorTree")}
    models = {model.attrib["ID"]: model for model in root.iterfind("TreeNodesModel/*")}
    used = {node.get("ID", node.tag) for node in root.iterfind("BehaviorTree//")}
    assert root.get("main_tree_to_execute") in tree_ids
    assert {node.attrib["ID"] for node in root.iterfind("BehaviorTree//SubTree")} <= tree_ids
    assert models.keys() == used - COUNTERPARTS.keys()
    for node in root.iterfind("BehaviorTree//"):
        model = models.get(node.get("ID", node.tag), Element("Control"))
        ports = {*COUNTERPARTS.get(node.tag, "").split(), *(port.attrib["name"] for port in model)}
        assert set(node.keys()) - {"ID", "name", "_autoremap"} <= ports
        assert model.tag == "Control" or len(node) == (model.tag == "Decorator")


@pytest.mark.parametrize(
    ("tree", "expected"),
    [
        ("{as: first, fallback: [{as: mine, Fail: {}}, {succeed: {invert: Fail}}, succeed]}",
         ["Fallback name=first", "Fail name=mine", "ForceSuccess", "Inverter", "Fail", "AlwaysSuccess"]),
        ("[Held, {sequence: {memory: false, do: [Held, {fallback: {memory: false, do: [Held, Fail]}}]}}]",
         ["Sequence", "Held", "ReactiveSequence", "Held", "ReactiveFallback", "Held", "Fail"]),
        ("{guard: {holds: {all: [Held, {any: [Held, {not: Held}]}]}, do: Fail}}",
         ["ReactiveSequence", "Sequence", "Held", "Fallback", "Held", "Inverter", "Held", "Fail"]),
        ("{repeat: {times: 3, do: {repeat: {times: 4, until: Fail.late, do: Fail}}}}",
         ["Repeat num_cycles=3", "repeat times=4 until=Fail.late", "Fail"]),
        ("{retry: {attempts: 3, on: [Fail.failed, Fail.late], backoff: 2, recover: Held, do: Fail}}",
         ["retry attempts=3 on=Fail.failed;Fail.late backoff=first=2", "retry-recover", "Held", "Fail"]),
        ("{parallel: {wait_for: 2, do: [Fail, Fail, Fail]}}", ["parallel wait_for=2", *["Fail"] * 3]),
        ("{for_each: {each: x, in: [1, 2], do: {while: {condition: Held, do: {Wait: {seconds: $x.n}}}}}}",
         ["for_each each={x} in=1;2", "while", "while-condition", "Held", "Wait seconds={x.n}"]),
        ("{try: Fail, catch: [{on: Fail.late, do: Fail}, {on: Fail.failed, do: succeed}], finally: Fail}",
         ["try", "Fail", "try-catch on=Fail.late", "Fail", "try-catch on=Fail.failed", "AlwaysSuccess",
          "try-finally", "Fail"]),
    ],
)  # fmt: skip
def test_a_node_becomes_a_counterpart_or_custom_node(tree: str, expected: list[str], tmp_path: Path) -> None:
    assert list_elements(export(tmp_path / "m.yaml", f"mission: m\ntree: {tree}\n"), "m") == expected


def test_the_model_of_a_node_has_its_ports_and_no_reserved_name(tmp_path: Path) -> None:
    root = export(tmp_path / "m", "mission: Fail\ntree: [Sleep, Held, {use: Delay}]\ntrees: {Delay: Fail}")
    assert [tree.get("ID") for tree in root.iter("BehaviorTree")] == ["Fail_", "Delay_"]
    models = {model.get("ID"): model for model in root.iterfind("TreeNodesModel/*")}
    assert list(models) == ["Fail", "Sleep_", "Held", "Delay_"]
    assert [model.tag for model in models.values()] == ["Action", "Action", "Condition", "SubTree"]
    assert [(port.tag, *port.attrib.values()) for port in models["Sleep_"]] == [
        ("input_port", "var_name", "std::string", "x"), ("input_port", "exact", "bool", "false"),
        ("input_port", "var__left", "int"), ("output_port", "var_ID", "int"),
    ]  # fmt: skip
    assert models["Sleep_"][0].text == "name of something"


SUBTREES = """
mission: m
params: {most: 3}
tree: [{use: job, with: {attempts: $most}}, {use: job, with: {limit: 4}, returns: {ID: $mine}, as: second}]
trees:
  job:
    doc: "Work <hard>\\e."
    args: {attempts: 2, limit: 2.5}
    returns: [ID]
    do: [{retry: {attempts: $attempts, do: {use: inner}}}, {timeout: {seconds: $limit, do: Sleep}}]
  inner: {repeat: {times: $most, do: {Sleep: {ID: $hidden}}}}
"""


def test_params_become_values_and_arguments_and_variables_become_pointers(tmp_path: Path) -> None:
    root = export(tmp_path / "m.yaml", SUBTREES)
    assert list_elements(root, "m") == [
        "Sequence",
        "SubTree ID=job attempts=3 limit=2.5 var_ID={var_ID} hidden={job-1.hidden} _autoremap=true",
        "SubTree ID=job attempts=2 limit=4 var_ID={mine} hidden={job-2.hidden} _autoremap=true name=second",
    ]
    # `Timeout` needs milliseconds, which a pointer to an argument in seconds does not give.
    assert list_elements(root, "job") == [
        "Sequence", "RetryUntilSuccessful num_attempts={attempts}", "SubTree ID=inner _autoremap=true",
        "timeout seconds={limit}", "Sleep_ var__left={var__left} var_ID={var_ID}",
    ]  # fmt: skip
    assert list_elements(root, "inner")[0] == "Repeat num_cycles=3"
    assert root[1].get("_description") == "Work <hard>\ufffd."

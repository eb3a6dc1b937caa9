"""XML of missions for BehaviorTree.CPP: the rules of the original, and a parser that rebuilds the mission."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

import guide_blocks
import pytest
from btcpp_rules import BUILT_IN, RULES, Document, list_violations

from executive.mission.model.mission import Mission
from executive.mission.model.nodes import InnerNode, Node, NodeSection, SkillNode, SubtreeNode
from executive.mission.model.values import Literal
from executive.mission.parse.read_mission import read_mission
from executive.mission.text.file_search import find_mission, get_shipped_folder
from executive.plugins import load_skills
from executive.skill import Direction, In, Out, Skill, param
from executive.tree.failure import Reason
from executive.tree.node_registry import load_control_nodes
from executive.view.tree.btcpp import format_btcpp

SHIPPED = sorted(path.stem for path in get_shipped_folder().glob("*.yaml"))
KEYWORDS = {
    "Sequence": "sequence", "Fallback": "fallback", "Inverter": "invert", "ForceSuccess": "succeed",
    "AlwaysSuccess": "succeed", "Repeat": "repeat", "RetryUntilSuccessful": "retry", "Timeout": "timeout",
    "Parallel": "parallel", "ParallelAll": "parallel", "ReactiveSequence": "sequence",
    "ReactiveFallback": "fallback",
}  # fmt: skip
"""Keywords of the control nodes by their counterparts."""
KEYWORDS_OF_CONDITIONS = {"all": "sequence", "any": "fallback", "not": "invert"}
"""Keywords of nodes that combine conditions, with the keywords of nodes that have the same counterpart."""
KEYS = {"num_attempts": "attempts", "num_cycles": "times", "msec": "seconds"}
"""Keys of the control nodes by ports of their counterparts."""
Branch = tuple[str, dict[str, str], list["Part"]]
"""Key of a control node, the constants of the section below the key, and the nodes below the key."""
Part = tuple[str, str, dict[str, str], list[Branch]]
"""A node of a mission: name, label, ports and branches."""


class Name(Skill):
    """Do something with names that BehaviorTree.CPP reserves."""

    name: str = param("x", doc="name of something")
    _left: In[int]
    ID: Out[int]

    def run(self, cell: Any) -> None:
        """Do nothing."""


class Fail(Skill):
    """Fail."""

    reasons: ClassVar = ("failed", "late")
    senses: ClassVar = True

    def run(self, cell: Any) -> None:
        """Do nothing."""


class Held(Skill):
    """Be a condition."""

    reasons: ClassVar = ("failed",)
    is_condition: ClassVar = True

    def run(self, cell: Any) -> None:
        """Do nothing."""


class Read(Skill):
    """Read a number."""

    value: In[int]

    def run(self, cell: Any) -> None:
        """Do nothing."""


class Write(Skill):
    """Write a number."""

    value: Out[int]

    def run(self, cell: Any) -> None:
        """Do nothing."""


class Sleep(Skill):
    """Have the name of a node of BehaviorTree.CPP."""

    _left: Out[int]
    count: int = param(3)
    exact: bool = param(False)

    def run(self, cell: Any) -> None:
        """Do nothing."""


SKILLS = {**load_skills(), **{skill.__name__: skill for skill in (Fail, Held, Name, Read, Sleep, Write)}}


@cache
def read_shipped(name: str) -> Mission:
    """Return a shipped mission."""
    return read(find_mission(name))


def read(path: Path) -> Mission:
    """Return the mission in a file without checks, which take most of the time of loading."""
    files = read_mission(path, {}, SKILLS, load_control_nodes())
    assert not files.findings
    SKILLS.update(files.behaviours)
    return files.mission


def export(tmp_path: Path, text: str) -> Document:
    """Return the exported XML of a mission without keys for the cell, and check the rules."""
    path = tmp_path / "m.yaml"
    path.write_text("cell: cells/overhead.yaml\n" + text, encoding="utf-8")
    xml = format_btcpp(read(path), SKILLS)
    assert list_violations(xml) == []
    return Document.parse(xml)


# The rules.


@pytest.mark.parametrize("name", SHIPPED)
def test_the_file_of_every_shipped_mission_satisfies_the_rules_of_xml_parsing(name: str) -> None:
    assert list_violations(format_btcpp(read_shipped(name), SKILLS)) == []


@pytest.mark.slow
def test_the_file_of_every_mission_of_the_guides_satisfies_the_rules(tmp_path: Path) -> None:
    for file in guide_blocks.files().values():
        path = tmp_path / file.name
        path.parent.mkdir(exist_ok=True)
        path.write_text(file.text, encoding="utf-8")
    for name, file in guide_blocks.files().items():
        if file.text.startswith("mission:") and not file.block.is_mistake:
            assert list_violations(format_btcpp(read(tmp_path / name), SKILLS)) == [], name


GOOD = """<root BTCPP_format="4" main_tree_to_execute="m"><BehaviorTree ID="m"><Sequence><A p="1"/>
<SubTree ID="s" q="2"/></Sequence></BehaviorTree><BehaviorTree ID="s"><D><A/></D></BehaviorTree>
<TreeNodesModel><Action ID="A"><input_port name="p" type="int"/></Action><Decorator ID="D"/>
<SubTree ID="s"><input_port name="q"/></SubTree></TreeNodesModel></root>"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('BTCPP_format="4"', "", "BTCPP_format"),
        ("root", "tree", "must have a root node"),
        ("</root>", "<TreeNodesModel/></root>", "Only a single node"),
        ('<Action ID="A">', "<Action>", "attribute [ID] is mandatory"),
        ("<A/>", "<D>" * 256 + "<A/>" + "</D>" * 256, "Maximum XML nesting depth"),
        ("<A/>", "<Action/>", "must have the attribute [ID]"),
        ('<BehaviorTree ID="s">', "<BehaviorTree>", "<BehaviorTree> must have the attribute [ID]"),
        ('ID="s"', 'ID="A"', "<BehaviorTree> must not use the name"),
        ('ID="s"', 'ID="A"', "<SubTree> must not use the name"),
        ("<A/>", "", "must have exactly 1 child"),
        ('<BehaviorTree ID="s">', '<BehaviorTree ID="s"><A/>', "with ID '...' must have exactly 1 child"),
        ('q="2"/>', 'q="2"><A/></SubTree>', "should not have any child"),
        ("<A/>", "<B/>", "Node not recognized"),
        ("<A/>", "<Fallback/>", "must have 1 or more children"),
        ("<A/>", "<TryCatch><A/></TryCatch>", "must have at least 2 children"),
        ("<A/>", "<ReactiveSequence><AsyncSequence><A/></AsyncSequence><AsyncSequence><A/></AsyncSequence>"
         "</ReactiveSequence>", "more than one async child"),
        ("<A/>", "<A><A/></A>", "must not have any child"),
        ('ID="s"', 'ID="a b"', "contains forbidden character"),
        ('name="p"', 'name="1p"', "cannot start with a digit"),
        ('name="q"', "", "Missing attribute [name]"),
        ("<A/>", '<A name="&#127;"/>', "invalid control character"),
        ("</TreeNodesModel>", '<Action ID="Sequence"/></TreeNodesModel>', "already registered"),
        ('main_tree_to_execute="m"', "", "main_tree_to_execute"),
        ('main_tree_to_execute="m"', 'main_tree_to_execute="n"', "Can't find a tree"),
        ("<A/>", '<SubTree ID="s" q="1"/>', "cycle detected"),
        ('q="2"', "", "you are not remapping it"),
        ('q="2"/>', 'q="2" name="x"/><SubTree ID="s" q="2" name="x"/>', "Duplicate SubTree path"),
        ("<A/>", '<A ID="A"/>', "Attribute [ID] is not allowed"),
        ("<A/>", '<A r="1"/>', "not in the providedPorts()"),
        ('p="1"', 'p="one"', "can not be converted"),
    ],
)  # fmt: skip
def test_each_rule_finds_a_violation(old: str, new: str, message: str) -> None:
    assert list_violations(GOOD) == []
    violations = list_violations(GOOD.replace(old, new))
    assert any(message in violation for violation in violations), violations


def test_every_rule_is_tested() -> None:
    assert len(RULES) == 30


# The parser.


@dataclass(frozen=True)
class MissionTree:
    """A tree of a mission: its root node, and the values of the params that its nodes can read."""

    mission: Mission
    body: Node
    params: Mapping[str, Literal]

    def describe_node(self, node: Node) -> Part:
        """Return the description of a node of the mission."""
        match node:
            case SkillNode():
                ports = {name: f"{{{name}}}" for name in SKILLS[node.skill].ports}
                ports |= {name: self.format(setting.value) for name, setting in node.settings.items()}
                return node.skill, node.label, ports, []
            case SubtreeNode():
                subtree = self.mission.subtrees[node.name]
                arguments = subtree.arguments.items()
                ports = {
                    name: self.format(argument.default) for name, argument in arguments if argument.default
                }
                ports |= {name: f"{{{name}}}" for name in subtree.returns or ()}
                settings = {**node.arguments, **node.returns}
                ports |= {name: self.format(setting.value) for name, setting in settings.items()}
                return f"use {node.name}", node.label, ports, []
        assert isinstance(node, InnerNode)
        keyword = node.declaring_class.keyword
        ports, branches = self.describe_keys(node)
        if keyword == "guard":
            # The counterpart is that of a sequence of the condition and the body, without memory.
            children = [child for _, _, nodes in branches for child in nodes]
            return "sequence", node.label, {"memory": "false"}, [("do", {}, children)]
        return KEYWORDS_OF_CONDITIONS.get(keyword, keyword), node.label, ports, branches

    def describe_keys(self, owner: InnerNode | NodeSection) -> tuple[dict[str, str], list[Branch]]:
        """Return the constants of a control node or section, and its branches; `do` is the last branch."""
        ports: dict[str, str] = {}
        branches: list[Branch] = []
        for key, value in owner.iterate_keys():
            items = value if isinstance(value, tuple) else (value,)
            nodes = [self.describe_node(item) for item in items if isinstance(item, Node)]
            sections = [self.describe_keys(item) for item in items if isinstance(item, NodeSection)]
            if nodes:
                branches.append((key.name, {}, nodes))
            elif any(section_branches for _, section_branches in sections):
                branches += [(key.name, constants, nodes) for constants, ((_, _, nodes),) in sections]
            else:
                ports[key.name] = self.format(value)
        return ports, sorted(branches, key=lambda branch: branch[0] == "do")

    def format(self, value: Any) -> str:
        """Return the text of a value of the mission."""
        match self.params.get(getattr(value, "name", ""), value):
            case Literal(value=list() as elements):
                return ";".join(map(str, elements))
            case Literal(value=constant):
                return str(constant).lower() if isinstance(constant, bool) else str(constant)
            case NodeSection() as section:
                return ",".join(f"{key.name}={self.format(item)}" for key, item in section.iterate_keys())
            case tuple() as items:
                return ";".join(
                    str(item) if isinstance(item, Reason) else self.format(item) for item in items
                )
        return f"{{{value.name}}}"


def list_trees(mission: Mission) -> dict[str, MissionTree]:
    """Return the trees of a mission by name."""
    params = {name: param.value for name, param in mission.params.items()}
    assert mission.tree is not None
    trees = {mission.name: MissionTree(mission, mission.tree, params)}
    for subtree in mission.subtrees.values():
        visible = (
            {}
            if subtree.library
            else {name: params[name] for name in params if name not in subtree.arguments}
        )
        trees[subtree.name] = MissionTree(mission, subtree.body, visible)
    return trees


def rebuild_node(element: Element) -> Part:
    """Return the description of the node of the mission that an element represents."""
    name, label = KEYWORDS.get(element.tag, element.tag), element.get("name", "")
    ports = {
        KEYS.get(key, key): text for key, text in element.items() if key not in ("ID", "name", "_autoremap")
    }
    if element.tag == "SubTree":
        # The pointers to local variables contain the name of the subtree.
        ports = {key: text for key, text in ports.items() if "." not in text or text[0] != "{"}
        return f"use {element.get('ID')}", label, ports, []
    if element.tag.startswith("Reactive"):
        ports["memory"] = "false"
    if element.tag == "Timeout":
        ports["seconds"] = str(int(ports["seconds"]) / 1000)
    branches: list[Branch] = []
    body = []
    for child in element:
        if child.tag.startswith(f"{name}-"):
            nodes = list(map(rebuild_node, child))
            branches.append((child.tag.removeprefix(f"{name}-"), dict(child.attrib), nodes))
        else:
            body.append(rebuild_node(child))
    return name, label, ports, [*branches, *([("do", {}, body)] if body else [])]


@pytest.mark.parametrize("name", SHIPPED)
def test_a_parser_rebuilds_every_shipped_mission(name: str) -> None:
    mission = read_shipped(name)
    file, trees = Document.parse(format_btcpp(mission, SKILLS)), list_trees(mission)
    assert file.root.get("main_tree_to_execute") == mission.name
    for tree_id, element in file.trees.items():
        assert rebuild_node(element[0]) == trees[tree_id].describe_node(trees[tree_id].body)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_models_are_the_nodes_that_behavior_tree_cpp_does_not_have(name: str) -> None:
    mission = read_shipped(name)
    file = Document.parse(format_btcpp(mission, SKILLS))
    used = {node.get("ID", "") if node.tag == "SubTree" else node.tag for node in file.nodes()}
    assert set(file.models) == used - BUILT_IN
    for model_id, model in file.models.items():
        if skill := SKILLS.get(model_id):
            assert model.tag == ("Condition" if skill.is_condition else "Action")
            outputs = {name for name, port in skill.ports.items() if port.direction is Direction.OUT}
            assert {port.attrib["name"] for port in model.iter("output_port")} == outputs
            inputs = {*skill.params, *skill.ports} - outputs
            assert {port.attrib["name"] for port in model.iter("input_port")} == inputs
            assert all(port.text for port in model)


# Single nodes.


def list_tags(element: Element) -> list[str]:
    """Return the names and ports of an element and its descendants, one text per element."""
    return [" ".join([node.tag, *(f"{key}={text}" for key, text in node.items())]) for node in element.iter()]


def list_elements(root: Element) -> list[str]:
    """Return the name and the attributes of an element and its descendants, one text per element."""
    return [" ".join([node.tag, *(f"{key}={text}" for key, text in node.items())]) for node in root.iter()]


WAIT = "{Wait: {seconds: 1}}"


CASES: tuple[tuple[str, list[str]], ...] = (
    (f"[{WAIT}]", ["Sequence"]),
    (f"{{fallback: [Fail, {WAIT}]}}", ["Fallback", "Fail"]),
    (f"{{sequence: {{memory: false, do: [Held, {WAIT}]}}}}", ["ReactiveSequence", "Held"]),
    (f"{{fallback: {{memory: false, do: [Held, {WAIT}]}}}}", ["ReactiveFallback", "Held"]),
    (f"{{succeed: {WAIT}}}", ["ForceSuccess"]),
    ("succeed", ["AlwaysSuccess"]),
    ("{invert: {invert: Fail}}", ["Inverter", "Inverter", "Fail"]),
    (f"{{repeat: {{times: 3, do: {WAIT}}}}}", ["Repeat num_cycles=3"]),
    (f"{{repeat: {{times: 3, until: Fail.failed, do: [{WAIT}, Fail]}}}}",
     ["repeat times=3 until=Fail.failed", "Sequence", "Fail"]),
    ("{retry: {attempts: 3, do: Fail}}", ["RetryUntilSuccessful num_attempts=3", "Fail"]),
    ("{retry: {attempts: 3, backoff: 2, do: Fail}}", ["retry attempts=3 backoff=first=2", "Fail"]),
    ("{retry: {attempts: 3, on: [Fail.failed, Fail.late], do: Fail}}",
     ["retry attempts=3 on=Fail.failed;Fail.late", "Fail"]),
    (f"{{retry: {{attempts: 3, recover: {WAIT}, do: Fail}}}}",
     ["retry attempts=3", "retry-recover", "Fail"]),
    (f"{{timeout: {{seconds: 1.25, do: {WAIT}}}}}", ["Timeout msec=1250"]),
    (f"{{timeout: {{seconds: 1.001, do: {WAIT}}}}}", ["Timeout msec=1001"]),
    (f"{{parallel: [Fail, {WAIT}]}}", ["ParallelAll max_failures=1", "Fail"]),
    (f"{{parallel: {{wait_for: any, do: [Fail, Fail, {WAIT}]}}}}",
     ["Parallel success_count=1 failure_count=3", "Fail", "Fail"]),
    (f"{{parallel: {{halt: true, do: [Fail, Fail, {WAIT}]}}}}",
     ["Parallel success_count=3 failure_count=1", "Fail", "Fail"]),
    (f"{{parallel: {{wait_for: 2, halt: true, do: [Fail, Fail, {WAIT}]}}}}",
     ["Parallel success_count=2 failure_count=2", "Fail", "Fail"]),
    (f"{{parallel: {{wait_for: 2, do: [Fail, Fail, {WAIT}]}}}}", ["parallel wait_for=2", "Fail", "Fail"]),
    (f"{{parallel: {{wait_for: lead, do: [{WAIT}, Fail]}}}}", ["parallel wait_for=lead", "Fail"]),
    (f"{{while: {{condition: Fail, do: {WAIT}}}}}", ["while", "while-condition", "Fail"]),
    (f"{{for_each: {{each: x, in: [1, 2], do: {WAIT}}}}}", ["for_each each={x} in=1;2"]),
    (f"{{for_each: {{each: y, in: items, do: {WAIT}}}}}", ["for_each each={y} in=items"]),
    ("{Read: {value: $item.attempts}}", ["Read value={item.attempts}"]),
    (f"{{try: Fail, catch: [{{on: Fail.late, do: {WAIT}}}, {{on: Fail.failed, do: succeed}}], "
     "finally: Fail}",
     ["try", "Fail", "try-catch on=Fail.late", "try-catch on=Fail.failed", "AlwaysSuccess", "try-finally",
      "Fail"]),
    (f"{{as: first, fallback: [Fail, {WAIT}]}}", ["Fallback name=first", "Fail"]),
    ("{as: mine, Fail: {}}", ["Fail name=mine"]),
    (f"{{guard: {{holds: {{all: [Held, {{any: [Held, {{not: Held}}]}}]}}, do: {WAIT}}}}}",
     ["ReactiveSequence", "Sequence", "Held", "Fallback", "Held", "Inverter", "Held"]),
)  # fmt: skip
"""Trees of missions, and the exported elements without `Wait`."""


@cache
def export_cases() -> Document:
    """Return the export of a mission that has each case as a subtree."""
    uses = ", ".join(f"{{use: case_{number}}}" for number in range(len(CASES)))
    trees = "\n".join(f"  case_{number}: {tree}" for number, (tree, _) in enumerate(CASES))
    with tempfile.TemporaryDirectory() as folder:
        return export(Path(folder), f"mission: m\ntree: [{uses}]\ntrees:\n{trees}\n")


@pytest.mark.parametrize("number", range(len(CASES)))
def test_a_node_becomes_its_counterpart_or_a_custom_node(number: int) -> None:
    elements = list_elements(export_cases().trees[f"case_{number}"][0])
    assert [text for text in elements if not text.startswith("Wait")] == CASES[number][1]


def test_names_that_behavior_tree_cpp_reserves_are_changed(tmp_path: Path) -> None:
    file = export(tmp_path, "mission: Fail\ntree: [Sleep, {Name: {name: a}}, {use: Sequence}]\n"
                  "trees: {Sequence: {Sleep: {exact: true, _left: $ID}}}\n")  # fmt: skip
    assert list(file.trees) == ["Fail_", "Sequence_"]
    assert list_elements(file.trees["Fail_"][0]) == [
        "Sequence", "Sleep_ var__left={var__left}", "Name var__left={var__left} var_ID={var_ID} var_name=a",
        "SubTree ID=Sequence_ _autoremap=true",
    ]  # fmt: skip
    assert list_elements(file.trees["Sequence_"][0]) == ["Sleep_ var__left={var_ID} exact=true"]
    assert list_elements(file.models["Sleep_"])[1:] == [
        "input_port name=count type=int default=3", "input_port name=exact type=bool default=false",
        "output_port name=var__left type=int",
    ]  # fmt: skip


ARGUMENTS = """
mission: m
params: {most: 3}
tree: [{use: job, with: {attempts: $most}}, {use: job, with: {limit: 4}, as: second}]
trees:
  job:
    doc: "Work <hard> & 'well'\\e[0m."
    args: {attempts: 2, limit: 2.5}
    do:
      - retry: {attempts: $attempts, do: Fail}
      - timeout: {seconds: $limit, do: {Wait: {seconds: 1}}}
      - repeat: {times: $most, do: {Wait: {seconds: $limit}}}
"""


def test_params_become_values_and_arguments_become_pointers(tmp_path: Path) -> None:
    file = export(tmp_path, ARGUMENTS)
    assert list_elements(file.trees["m"][0])[1:] == [
        "SubTree ID=job attempts=3 limit=2.5 _autoremap=true",
        "SubTree ID=job attempts=2 limit=4 _autoremap=true name=second",
    ]
    # `Timeout` needs milliseconds, which a pointer to an argument in seconds does not give.
    assert list_elements(file.trees["job"][0])[1:] == [
        "RetryUntilSuccessful num_attempts={attempts}", "Fail", "timeout seconds={limit}", "Wait seconds=1",
        "Repeat num_cycles=3", "Wait seconds={limit}",
    ]  # fmt: skip
    assert file.trees["job"].get("_description") == "Work <hard> & 'well'\ufffd[0m."


LOCALS = """
mission: m
tree: [{use: outer}, {use: outer, returns: {right: $mine}}, {Read: {value: $right}}, {Read: {value: $mine}}]
trees:
  outer:
    returns: [right]
    do: [{Write: {value: $left}}, {use: inner}, {Read: {value: $left}}]
  inner: [{Write: {value: $right}}, {Write: {value: $hidden}}, {Read: {value: $hidden}}]
"""


def test_local_variables_get_names_that_no_other_use_has(tmp_path: Path) -> None:
    file = export(tmp_path, LOCALS)
    assert list_elements(file.trees["m"][0])[1:3] == [
        "SubTree ID=outer hidden={outer-1.hidden} left={outer-1.left} right={right} _autoremap=true",
        "SubTree ID=outer hidden={outer-2.hidden} left={outer-2.left} right={mine} _autoremap=true",
    ]


# The reference.


@pytest.mark.parametrize("keyword", sorted(load_control_nodes()))
def test_the_reference_names_the_counterpart_of_every_control_node(keyword: str) -> None:
    reference = (get_shipped_folder() / "reference.md").read_text(encoding="utf-8")
    section = reference.partition(f"### `{keyword}`\n")[2].partition("\n### ")[0]
    lines = [line for line in section.splitlines() if line.startswith("* ")]
    assert [line.partition(":")[0] for line in lines[-2:]] == ["* BehaviorTree.CPP", "* py_trees"]
    exported = {
        elements[0].partition(" ")[0]
        for tree, elements in CASES
        if tree.startswith(f"{{{keyword}: ") or tree == keyword
    }
    assert all(f"`{name}`" in section for name in exported)

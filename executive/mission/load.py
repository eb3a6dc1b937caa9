"""Loading of a mission: reading and checking of its files, and construction of its behaviour tree."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path
from typing import cast

from pydantic import JsonValue

from executive.behaviours import Skills
from executive.cell.config import CellConfig
from executive.cell.objects import Quotas
from executive.cell.protocols import Cell
from executive.errors import InputError
from executive.events import Emit
from executive.mission import check_nodes, check_skills, check_variables
from executive.mission.analysis import CheckContext, UnhandledFailure, find_unhandled_failures
from executive.mission.cell_file import CellFile, CellFileChecker, read_cell
from executive.mission.expand import assign_paths, expand
from executive.mission.grammar import SEQUENCE_KEYWORD
from executive.mission.mission_file import Mission, Subtree, parse_library, parse_mission
from executive.mission.node_parser import NodeParser
from executive.mission.ports import convert_setting, find_literals, find_wires
from executive.perception.camera_model import find_calibration_doubts
from executive.perception.detectors.envelope import find_envelopes
from executive.skill import Direction, Param, Port, Skill
from executive.text.files import find_cell, find_file_below, find_mission, get_shipped_folder, read_source
from executive.text.findings import Finding, MissionError, Source, make_warning, sort_findings
from executive.text.yaml_files import parse_yaml
from executive.tree.blackboard import Blackboard, NodeContext, Wiring
from executive.tree.node import ControlNode, load_control_nodes
from executive.tree.skill_leaf import SkillLeaf
from executive.tree.specification import (
    Constant,
    Expression,
    InvalidNode,
    LocatedName,
    Node,
    SkillNode,
    SubtreeNode,
)
from executive.tree.tree_node import TreeNode

Check = Callable[[CheckContext], Iterator[Finding]]
"""Function that yields the findings of one check."""

CHECKS: tuple[Check, ...] = (
    check_skills.find_unknown_skills,
    check_skills.check_settings,
    check_nodes.check_constants,
    check_nodes.check_labels,
    check_skills.check_names,
    check_skills.check_quotas,
    check_skills.find_undetectable_classes,
    check_skills.find_unweighed_classes,
    check_nodes.check_failure_names,
    check_variables.find_unwritten_inputs,
    check_variables.find_unwritten_library_inputs,
    check_variables.find_overwritten_loop_variables,
    check_variables.find_unread_variables,
    check_variables.find_unwritten_returns,
    check_variables.check_port_types,
    check_nodes.check_tool_states,
    check_nodes.check_tool_at_end,
    check_nodes.find_unreachable,
    check_nodes.run_node_checks,
    check_nodes.find_shared_resources,
    check_nodes.find_shared_variables,
    check_nodes.find_read_races,
)
"""All checks; a check ignores the errors that another check reports, and their consequences."""

MAX_FINDINGS_PER_CHECK = 1000
"""Maximum number of findings of one check; a short mission can cause hundreds of thousands of findings."""


def run_checks(context: CheckContext) -> list[Finding]:
    """Return the findings of all checks."""
    return [finding for check in CHECKS for finding in islice(check(context), MAX_FINDINGS_PER_CHECK)]


@dataclass(frozen=True)
class MissionFiles:
    """The files of a mission.

    Attributes:
        source: Text of the mission file.
        mission: Content of the mission file and the subtrees of its libraries.
        libraries: Text of each library file by its path as written in the mission.
        behaviours: Behaviours of py_trees that the files name, as skills, by the names of their classes.
        cell: Content of the cell file, or None if the file cannot be read.
        findings: Errors of the parsers.
    """

    source: Source
    mission: Mission
    libraries: Mapping[str, str]
    behaviours: Skills
    cell: CellFile | None
    findings: tuple[Finding, ...]


def read_mission(
    path: Path,
    overrides: Mapping[str, str],
    skills: Skills,
    replacing_cell: str | CellFile = "",
    library_folder: Path | None = None,
) -> MissionFiles:
    """Return the content of a mission file, its libraries, and its cell file or the cell that replaces it.

    Raises:
        MissionError: The mission file is not valid YAML.
        InputError: The mission file or the replacing cell does not exist.
    """
    source = read_source(path)
    root, findings = parse_yaml(source)
    if root is None:
        raise MissionError(sort_findings(findings, source.path))
    parser = NodeParser(findings, skills, load_control_nodes())
    mission = parse_mission(root, overrides, parser)
    subtrees = dict(mission.subtrees)
    folder = library_folder or path.parent
    texts = {str(file): _add_library(file, folder, parser, subtrees) for file in mission.libraries}
    libraries = {name: text for name, text in texts.items() if text is not None}
    mission = replace(mission, subtrees=subtrees, is_complete=len(libraries) == len(texts))
    cell: CellFile | None = None
    if isinstance(replacing_cell, CellFile):
        cell = replacing_cell
    elif replacing_cell:
        cell = read_cell(find_cell(replacing_cell), overrides)
    elif mission.cell:
        try:
            cell = read_cell(find_file_below(path.parent, mission.cell), overrides)
        except InputError as error:
            parser.add_error(mission.cell.span, "no-cell", str(error))
    findings += cell.findings if cell else ()
    return MissionFiles(source, mission, libraries, parser.behaviours, cell, tuple(findings))


def _add_library(
    reference: LocatedName, folder: Path, parser: NodeParser, subtrees: dict[str, Subtree]
) -> str | None:
    """Add the subtrees of a library to `subtrees`; return the text of the library, or None after an error."""
    try:
        source = read_source(find_file_below(folder, reference))
    except InputError as error:
        parser.add_error(reference.span, "no-library", str(error))
        return None
    root, yaml_findings = parse_yaml(source)
    parser.findings += yaml_findings
    if root is None:
        return None
    for name, subtree in parse_library(root, parser).items():
        first_subtree = subtrees.setdefault(name, subtree)
        if first_subtree is subtree:
            continue
        # The position is in the mission file: the subtree of this name, or the path of the library.
        if first_subtree.library:
            span = reference.span
            other_span = first_subtree.name.span
            hint = "Delete one of the libraries from the list."
        else:
            span = first_subtree.name.span
            other_span = subtree.name.span
            hint = "Rename one of them."
        message = f'there are two subtrees "{name}"; the other is in {other_span.describe_place(span.source)}'
        parser.add_error(span, "duplicate-tree", message, hint)
    return source.text


CheckerFinder = Callable[[str], CellFileChecker]
"""Function that returns the checker of cells with a driver; raises InputError if it is not installed."""


@dataclass(frozen=True)
class LoadedMission:
    """A mission without errors.

    Attributes:
        mission: Content of the mission file.
        tree: Tree in which all subtrees, params and arguments are expanded.
        cell_config: Content of the cell file.
        text: Text of the mission file.
        path: Path of the mission file.
        cell_path: Path of the cell file.
        libraries: Text of each library file by its path as written in the mission.
        unhandled_failures: Failures that can end the mission, because no node handles them.
        warnings: Findings that do not prevent a run.
        overrides: Values of `--set` as text, by name of a param or by `cell.<key>.<key>`.
        skills: Installed skills by name, and skills for the py_trees behaviours in the mission by class name.
        replacing_cell: Cell file or name of the shipped cell that replaces the mission's cell, or "".
        files: Paths of the mission file, its libraries, the cell file, and the files that the cell names.
    """

    mission: Mission
    tree: Node
    cell_config: CellConfig
    text: str
    path: Path
    cell_path: Path
    libraries: Mapping[str, str]
    unhandled_failures: tuple[UnhandledFailure, ...]
    warnings: tuple[Finding, ...]
    overrides: Mapping[str, str]
    skills: Skills
    replacing_cell: str
    files: tuple[Path, ...]

    @property
    def params(self) -> dict[str, JsonValue]:
        """Values of the mission's params, with overrides."""
        return {str(name): cast("Constant", param.value).value for name, param in self.mission.params.items()}

    @property
    def routes(self) -> dict[str, tuple[str, ...]]:
        """Names of the permitted bins by class."""
        return {str(label): tuple(map(str, bins)) for label, bins in self.mission.routes.items()}

    @property
    def quotas(self) -> Quotas:
        """Maximum numbers of objects in the bins."""
        return {
            (str(bin), label and str(label)): cast("int", cast("Constant", limit).value)
            for (bin, label), limit in self.mission.quotas.items()
        }


def load_mission(
    path: str | Path,
    skills: Skills,
    overrides: Mapping[str, str] | None = None,
    find_checker: CheckerFinder | None = None,
    replacing_cell: str | CellFile = "",
    library_folder: Path | None = None,
) -> LoadedMission:
    """Return a mission that has passed all checks.

    Args:
        path: A mission file, or the name of a shipped mission.
        skills: Installed skills by name.
        overrides: Values as text, by name of a param or by `cell.<key>.<key>` for a key of the cell.
        find_checker: Function that returns the checker of cells with a driver; None to skip its checks.
        replacing_cell: Cell instead of the mission's cell: a cell file, the name of a shipped cell, or the
            cell of a recorded run; "" for the mission's cell.
        library_folder: Folder of the libraries; None for the folder of the mission.

    Raises:
        MissionError: The mission or the cell has errors; the exception contains every finding.
        InputError: The mission or the cell does not exist.
    """
    mission_path = find_mission(path)
    files = read_mission(mission_path, overrides or {}, skills, replacing_cell, library_folder)
    mission = files.mission
    cell = files.cell
    findings = list(files.findings)
    skills = ChainMap(dict(files.behaviours), cast("dict[str, type[Skill]]", skills))
    config = cell.config if cell else None
    checker = None
    classes_by_detector = {}
    if cell is not None and config is not None:
        for name, camera in config.cameras.items():
            for key, message in find_calibration_doubts(camera):
                span = cell.find_span(("cameras", name, "calibration", key))
                findings.append(make_warning(span, "calibration", message))
    if cell is not None and config is not None and find_checker is not None:
        try:
            checker = find_checker(config.kind)
        except InputError as error:
            findings.append(cell.make_error(("kind",), "unknown-kind", str(error)))
        else:
            folder = cell.path.parent
            errors = checker.check(config, folder)
            cell_findings = [cell.make_error(keys, "robot", message) for keys, message in errors]
            findings += cell_findings
            classes_by_detector = dict(checker.labels(config, folder))
            # The computation would fail for an invalid model.
            findings += check_skills.check_loads(cell, config, mission, None if cell_findings else checker)
            findings += check_skills.check_slots(cell, config, mission)
    predefined_lists: dict[str, Sequence[str]] = {}
    if config is not None:
        scan_poses = next(iter(config.cameras.values())).scan_poses
        labels = list(map(str, mission.routes))
        predefined_lists = {"poses": scan_poses, "bins": list(config.bins), "classes": labels}
    expansion = expand(mission, skills, predefined_lists)
    mission = replace(mission, quotas=expansion.quotas)
    tree = assign_paths(expansion.tree or InvalidNode(span=files.source.make_span()))
    unused_subtrees = expansion.unused_subtrees
    node_classes = load_control_nodes()
    context = CheckContext(mission, tree, unused_subtrees, skills, node_classes, config, classes_by_detector)
    findings += (*expansion.findings, *run_checks(context))
    has_errors = expansion.tree is None or any(finding.severity == "error" for finding in findings)
    if config is None or cell is None or has_errors:
        raise MissionError(sort_findings(findings, files.source.path))
    if checker is not None:
        folders = (cell.path.parent, get_shipped_folder() / "cells")
        for name, (error_rates, _) in find_envelopes(config, cell.path.parent, folders).items():
            span = cell.find_span(("detectors", name), at_key=True)
            if message := error_rates.assumption_reason:
                findings.append(make_warning(span, "not-measured", message))
            elif blindness := error_rates.blindness:
                message = f"images of detector {name} cannot prove that the table is empty: {blindness}"
                findings.append(make_warning(span, "blind", f"{message}; use a camera with depth"))
    libraries = [
        find_file_below(library_folder or mission_path.parent, library) for library in files.libraries
    ]
    return LoadedMission(
        mission, tree, config, files.source.text, mission_path, cell.path, files.libraries,
        find_unhandled_failures(context.flow_analysis), sort_findings(findings, files.source.path),
        dict(overrides or {}), skills, replacing_cell if isinstance(replacing_cell, str) else "",
        (mission_path, *libraries, *cell.files),
    )  # fmt: skip


def build_tree(
    loaded: LoadedMission,
    cell: Cell,
    blackboard: Blackboard,
    emit: Emit,
    substitutes: Skills | None = None,
) -> TreeNode:
    """Return the root of a new behaviour tree; every node of the tree has a unique, readable `path`.

    `substitutes` contains skills that run in place of the mission's skills, by pattern of node paths. In a
    pattern, `*` matches any characters, including `/`. The first matching pattern applies.

    Raises:
        InputError: A pattern matches no skill node.
    """
    builder = TreeBuilder(loaded.skills, cell, blackboard, emit, substitutes or {})
    root = builder.build_node(loaded.tree)
    paths = [node.path for node in root.iterate() if isinstance(node, SkillLeaf)]
    for pattern in builder.substitutes:
        if not any(fnmatchcase(path, pattern) for path in paths):
            raise InputError(f'no skill node matches "{pattern}"; the skill nodes are: {", ".join(paths)}')
    return root


@dataclass(frozen=True)
class TreeBuilder:
    """Builder of the behaviour tree of one mission.

    Attributes:
        substitutes: Skills that run in place of the mission's skills, by pattern of node paths.
    """

    skills: Skills
    cell: Cell
    blackboard: Blackboard
    emit: Emit
    substitutes: Skills

    def build_node(self, node: Node) -> TreeNode:
        """Return the behaviour for a node of the mission, with the behaviours of all nodes below it."""
        cell = self.cell
        context = NodeContext(node.path, cell.clock, cell.ledger, self.blackboard, node.label, self.emit)
        match node:
            case SkillNode():
                return self._build_skill_leaf(context, node)
            case ControlNode():
                return node.Behaviour(context, node, self.build_node)
            case SubtreeNode(body=Node() as subtree_root):
                body = self.build_node(subtree_root)
                # A node has one label, so the label of the `use` belongs to a sequence around the subtree.
                root = body
                if node.label:
                    sequence = load_control_nodes()[SEQUENCE_KEYWORD].make({}, do=(subtree_root,))
                    root = sequence.Behaviour(context, sequence, lambda _: body)
                root.subtree_names = (node.name, *root.subtree_names)
                return root
        raise AssertionError(f"a checked mission contains no {type(node).__name__}")

    def _build_skill_leaf(self, context: NodeContext, node: SkillNode) -> TreeNode:
        skill = self.skills[node.skill]
        declarations: Mapping[str, Param | Port] = {**skill.params, **skill.ports}
        literals = find_literals(node)
        input_wires = [wire for wire in find_wires(node, skill, Direction.IN) if not wire.is_operand]
        settings = node.settings.items()
        wiring = Wiring(
            constants={name: convert_setting(one.value, declarations[name]) for name, one in literals},
            inputs={wire.port.name: wire.variable for wire in input_wires},
            fields={wire.port.name: wire.field for wire in input_wires if wire.field},
            outputs={wire.port.name: wire.variable for wire in find_wires(node, skill, Direction.OUT)},
            expressions={str(name): value for name, value in settings if isinstance(value, Expression)},
        )
        patterns = (pattern for pattern in self.substitutes if fnmatchcase(node.path, pattern))
        executed_skill = next((self.substitutes[pattern] for pattern in patterns), skill)
        return SkillLeaf(context, node.skill, executed_skill, wiring, self.cell)

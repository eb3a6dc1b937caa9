"""Reading of a mission file, its libraries and its cell file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executive.errors import InputError
from executive.mission.findings import Finding, MissionError, sort_findings
from executive.mission.model.mission import Mission, Subtree
from executive.mission.model.values import LocatedName
from executive.mission.parse.cell_file import CellFile, read_cell
from executive.mission.parse.mission_file import parse_library, parse_mission
from executive.mission.parse.node_parser import NodeParser
from executive.mission.source import Source
from executive.mission.text.file_search import find_file_below, read_source
from executive.mission.text.yaml_text import parse_yaml
from executive.plugins import Skills
from executive.tree.node_registry import ControlNodes


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
    node_classes: ControlNodes,
    recorded_cell: CellFile | None = None,
) -> MissionFiles:
    """Return the content of a mission file, its libraries, and its cell file or the recorded cell.

    Raises:
        MissionError: The mission file is not valid YAML.
        InputError: The mission file does not exist.
    """
    source = read_source(path)
    root, findings = parse_yaml(source)
    if root is None:
        raise MissionError(sort_findings(findings, source.path))
    parser = NodeParser(findings, skills, node_classes)
    mission = parse_mission(root, overrides, parser)
    subtrees = dict(mission.subtrees)
    texts = {file.name: _add_library(file, path.parent, parser, subtrees) for file in mission.libraries}
    libraries = {name: text for name, text in texts.items() if text is not None}
    mission = replace(mission, subtrees=subtrees, is_complete=len(libraries) == len(texts))
    cell = recorded_cell
    if cell is None and mission.cell.name:
        try:
            cell = read_cell(find_file_below(path.parent, mission.cell.name), overrides)
            findings += cell.findings
        except InputError as error:
            parser.add_error(mission.cell.span, "no-cell", str(error))
    return MissionFiles(source, mission, libraries, parser.behaviours, cell, tuple(findings))


def _add_library(
    reference: LocatedName, folder: Path, parser: NodeParser, subtrees: dict[str, Subtree]
) -> str | None:
    """Add the subtrees of a library to `subtrees`; return the text of the library, or None after an error."""
    try:
        source = read_source(find_file_below(folder, reference.name))
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
            span, other_span = reference.span, first_subtree.span
            hint = "Delete one of the libraries from the list."
        else:
            span, other_span, hint = first_subtree.span, subtree.span, "Rename one of them."
        message = f'there are two subtrees "{name}"; the other is in {other_span.describe_place(span.source)}'
        parser.add_error(span, "duplicate-tree", message, hint)
    return source.text

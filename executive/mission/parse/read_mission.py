"""Reading of a mission file, its libraries and its cell file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError, make_error, sort_findings
from executive.mission.model.mission import Mission, Subtree
from executive.mission.model.values import LocatedName
from executive.mission.parse.cell_file import CellFile, read_cell
from executive.mission.parse.mission_file import parse_library, parse_mission
from executive.mission.parse.node_parser import Skills
from executive.mission.source import Source
from executive.mission.text.file_search import find_file_below, read_source
from executive.mission.text.yaml_text import parse_yaml
from executive.tree.node_registry import ControlNodes


@dataclass(frozen=True)
class MissionFiles:
    """The files of a mission.

    Attributes:
        source: Text of the mission file.
        mission: Content of the mission file and the subtrees of its libraries.
        libraries: Text of each library file by its path as written in the mission.
        cell: Content of the cell file, or None if it cannot be read.
        cell_path: Path of the cell file, or None if it cannot be read.
        findings: Errors of the parsers.
    """

    source: Source
    mission: Mission
    libraries: Mapping[str, str]
    cell: CellFile | None
    cell_path: Path | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class RecordedCell:
    """Cell of a recorded run, which replaces the cell file.

    Attributes:
        config: Content of the cell file in the recorded run, merged with its bases and overrides.
        path: Path of the cell file in the recorded run.
    """

    config: CellConfig
    path: Path


def read_mission(
    file: Path,
    overrides: Mapping[str, str],
    skills: Skills,
    node_classes: ControlNodes,
    recorded_cell: RecordedCell | None = None,
) -> MissionFiles:
    """Return the content of a mission file, its libraries, and its cell file or the recorded cell.

    Raises:
        MissionError: The mission file is not valid YAML.
        InputError: The mission file does not exist.
    """
    source = read_source(file)
    root, findings = parse_yaml(source)
    if root is None:
        raise MissionError(sort_findings(findings, source.path))
    mission, mission_findings = parse_mission(root, overrides, skills, node_classes)
    findings += mission_findings
    trees: dict[str, Subtree] = dict(mission.trees)
    texts = {
        reference.name: _add_library(reference, file.parent, skills, node_classes, trees, findings)
        for reference in mission.libraries
    }
    libraries = {name: text for name, text in texts.items() if text is not None}
    mission = replace(mission, trees=trees, is_complete=len(libraries) == len(texts))
    cell_path: Path | None
    cell: CellFile | None
    if recorded_cell is None:
        cell_path, cell = _read_cell_file(mission.cell, file.parent, overrides, findings)
    else:
        cell_path = recorded_cell.path
        cell = CellFile(recorded_cell.config, Source(str(cell_path), ""), None, ())
    return MissionFiles(source, mission, libraries, cell, cell_path, tuple(findings))


def _add_library(
    reference: LocatedName,
    folder: Path,
    skills: Skills,
    node_classes: ControlNodes,
    trees: dict[str, Subtree],
    findings: list[Finding],
) -> str | None:
    """Add the subtrees of the library file `reference` in `folder` to `trees`; return its text, or None."""
    try:
        source = read_source(find_file_below(folder, reference.name))
    except InputError as problem:
        findings.append(make_error(reference.mark, "no-library", str(problem)))
        return None
    root, yaml_findings = parse_yaml(source)
    findings += yaml_findings
    if root is None:
        return None
    library, library_findings = parse_library(root, skills, node_classes)
    findings += library_findings
    for name, subtree in library.trees.items():
        if name not in trees:
            trees[name] = subtree
            continue
        # The position of the error is in the mission file: its subtree, or the path of the library.
        first, is_in_mission = trees[name], not trees[name].library
        mark, other_mark = (first.mark, subtree.mark) if is_in_mission else (reference.mark, first.mark)
        message = f'there are two subtrees "{name}"; the other is in {other_mark.describe_place(mark.source)}'
        hint = "Rename one of them." if is_in_mission else "Delete one of the libraries from the list."
        findings.append(make_error(mark, "duplicate-tree", message, hint))
    return source.text


def _read_cell_file(
    reference: LocatedName, folder: Path, overrides: Mapping[str, str], findings: list[Finding]
) -> tuple[Path | None, CellFile | None]:
    """Return path and content of a cell file, or None for both; add its errors to `findings`."""
    if not reference.name:
        return None, None
    try:
        path = find_file_below(folder, reference.name)
        cell = read_cell(path, overrides)
    except InputError as problem:
        findings.append(make_error(reference.mark, "no-cell", str(problem)))
        return None, None
    findings += cell.findings
    return path, cell

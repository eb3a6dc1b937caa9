"""Reader of a mission file with its libraries and its cell file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError, error, in_file_order
from executive.mission.model.mission import Mission, Subtree
from executive.mission.model.values import Named
from executive.mission.parse.cell_file import CellFile, read_cell
from executive.mission.parse.mission_file import parse_library, parse_mission
from executive.mission.parse.nodes import Skills
from executive.mission.source import Source
from executive.mission.text.files import below, read_source
from executive.mission.text.yaml_text import parse_yaml
from executive.tree.registry import ControlNodes


@dataclass(frozen=True)
class MissionFiles:
    """The files of a mission.

    Attributes:
        source: Text of the mission file.
        mission: Content of the mission file and the subtrees of its libraries.
        libraries: Text of each library file by its path as written in the mission.
        cell: Content of the cell file, or None if it cannot be read.
        cell_path: Path of the cell file, or None if it cannot be read.
        findings: Errors in the form of the files.
    """

    source: Source
    mission: Mission
    libraries: Mapping[str, str]
    cell: CellFile | None
    cell_path: Path | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class GivenCell:
    """Cell of a recorded run, which replaces the cell file.

    Attributes:
        config: Content of the cell file, merged with bases and overrides.
        path: Path of the cell file in the recorded run.
    """

    config: CellConfig
    path: Path


def read_mission(
    file: Path,
    overrides: Mapping[str, str],
    skills: Skills,
    control: ControlNodes,
    given: GivenCell | None = None,
) -> MissionFiles:
    """Return the content of a mission file and of its files; a `given` cell replaces the cell file.

    Raises:
        MissionError: The mission file is not valid YAML.
        InputError: The mission file does not exist.
    """
    source = read_source(file)
    root, findings = parse_yaml(source)
    if root is None:
        raise MissionError(in_file_order(findings, source.path))
    mission, malformed = parse_mission(root, overrides, skills, control)
    findings += malformed
    trees: dict[str, Subtree] = dict(mission.trees)
    read = {
        named.name: _add_library(named, file.parent, skills, control, trees, findings)
        for named in mission.libraries
    }
    texts = {name: text for name, text in read.items() if text is not None}
    is_complete = len(texts) == len(read)
    cell_path: Path | None
    cell: CellFile | None
    if given is None:
        cell_path, cell = _read_cell_file(mission.cell, file.parent, overrides, findings)
    else:
        cell_path, cell = given.path, CellFile(given.config, Source(str(given.path), ""), None, ())
    return MissionFiles(
        source,
        replace(mission, trees=trees, is_complete=is_complete),
        texts,
        cell,
        cell_path,
        tuple(findings),
    )


def _add_library(
    named: Named,
    folder: Path,
    skills: Skills,
    control: ControlNodes,
    trees: dict[str, Subtree],
    findings: list[Finding],
) -> str | None:
    """Add the subtrees of a library to `trees` and return its text, or None if it cannot be read."""
    try:
        source = read_source(below(folder, named.name))
    except InputError as problem:
        findings.append(error(named.mark, "no-library", str(problem)))
        return None
    root, yaml_findings = parse_yaml(source)
    findings += yaml_findings
    if root is None:
        return None
    library, malformed = parse_library(root, skills, control)
    findings += malformed
    for name, subtree in library.trees.items():
        if name not in trees:
            trees[name] = subtree
            continue
        # The finding lies in the mission file: at its subtree, or at its list of libraries.
        other, is_in_mission = trees[name], not trees[name].library
        mark, place = (other.mark, subtree.mark) if is_in_mission else (named.mark, other.mark)
        message = f'there are two subtrees "{name}"; the other is in {place.place(mark.source)}'
        hint = "Rename one of them." if is_in_mission else "Leave one of the libraries out."
        findings.append(error(mark, "duplicate-tree", message, hint))
    return source.text


def _read_cell_file(
    named: Named, folder: Path, overrides: Mapping[str, str], findings: list[Finding]
) -> tuple[Path | None, CellFile | None]:
    """Return path and content of the cell file of a mission, and add its errors to `findings`."""
    if not named.name:
        return None, None
    try:
        path = below(folder, named.name)
        cell = read_cell(path, overrides)
    except InputError as problem:
        findings.append(error(named.mark, "no-cell", str(problem)))
        return None, None
    findings += cell.findings
    return path, cell

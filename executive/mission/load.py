"""Loading of missions: the mission file and its cell file are read and checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import JsonValue

from executive.cell.config import CellConfig
from executive.cell.workcell import CellKind
from executive.errors import InputError
from executive.mission.check.case import Case
from executive.mission.check.checks import check
from executive.mission.expand.expand import expand
from executive.mission.findings import Finding, MissionError, in_file_order, warning
from executive.mission.flow.endings import Ending, find_endings
from executive.mission.model.mission import Mission
from executive.mission.model.nodes import Node, UnknownNode
from executive.mission.model.paths import with_paths
from executive.mission.parse.cell_file import CellFile
from executive.mission.parse.read_mission import GivenCell, MissionFiles, read_mission
from executive.mission.parse.validate import mark_of
from executive.mission.text.files import find_mission, shipped_folder
from executive.perception.envelope.rated_detectors import find_unmeasured
from executive.skill import Skill
from executive.tree.registry import load_control_nodes

Kinds = Callable[[str], CellKind]
"""Function that returns the installed kind of cell with a name, or raises InputError."""


@dataclass(frozen=True)
class LoadedMission:
    """A mission without errors.

    Attributes:
        mission: Content of the mission file.
        tree: Tree with expanded subtrees, params and arguments.
        cell_config: Content of the cell file.
        text: Text of the mission file.
        path: Path of the mission file.
        cell_path: Path of the cell file.
        libraries: Text of each library file by its path as written in the mission.
        endings: Unhandled failures, which can end the mission.
        warnings: Findings that do not prevent a run.
        overrides: Overridden values of params and keys of the cell, as given.
    """

    mission: Mission
    tree: Node
    cell_config: CellConfig
    text: str
    path: Path
    cell_path: Path
    libraries: Mapping[str, str]
    endings: tuple[Ending, ...] = ()
    warnings: tuple[Finding, ...] = ()
    overrides: Mapping[str, str] = field(default_factory=dict)

    @property
    def params(self) -> dict[str, JsonValue]:
        """Values of the mission's params, with overrides."""
        return {name: param.value.value for name, param in self.mission.params.items()}

    @property
    def routes(self) -> dict[str, tuple[str, ...]]:
        """Permitted bins for each class."""
        return {route.label: tuple(bin.name for bin in route.bins) for route in self.mission.routes}


def load_mission(
    path: str | Path,
    skills: Mapping[str, type[Skill]],
    overrides: Mapping[str, str] | None = None,
    kinds: Kinds | None = None,
    cell: GivenCell | None = None,
) -> LoadedMission:
    """Return the mission in a file, or of a shipped name.

    Args:
        path: A mission file, or the name of a shipped mission.
        skills: Installed skills by name.
        overrides: Values for params by name, and for keys of the cell as `cell.<key>.<key>`.
        kinds: Finds the kind of the cell, which checks the mission against its abilities; None for no check.
        cell: Cell that replaces the mission's cell, or None.

    Raises:
        MissionError: Mission or cell have errors; the exception contains every finding.
        InputError: The mission does not exist.
    """
    file, control = find_mission(path), load_control_nodes()
    files = read_mission(file, overrides or {}, skills, control, cell)
    mission, config = files.mission, files.cell.config if files.cell else None
    findings = list(files.findings)
    kind = _find_kind(files, kinds, findings)
    labels, min_times = {}, None
    if kind is not None and files.cell is not None and files.cell_path is not None:
        base = files.cell_path.parent
        cell_findings = [files.cell.finding(keys, "robot", text) for keys, text in kind.check(config, base)]
        findings += cell_findings
        labels = dict(kind.labels(config, base))
        min_times = None if cell_findings else kind.min_times(config)
    expanded = expand(mission, skills)
    tree = with_paths(expanded.tree or UnknownNode(files.source.mark(), ""))
    case = Case(mission, tree, expanded.unused, skills, control, config, labels, min_times)
    findings += (*expanded.findings, *check(case))
    ordered = in_file_order(findings, files.source.path)
    is_valid = expanded.tree is not None and all(finding.severity != "error" for finding in findings)
    if config is None or files.cell_path is None or not is_valid:
        raise MissionError(ordered)
    if kind is not None and files.cell is not None:
        ordered = in_file_order(
            (*ordered, *_find_unmeasured(files.cell, files.cell_path.parent)), files.source.path
        )
    return LoadedMission(
        mission, tree, config, files.source.text, file, files.cell_path, files.libraries,
        find_endings(case.flow), ordered, dict(overrides or {}),
    )  # fmt: skip


def _find_unmeasured(cell: CellFile, base: Path) -> Iterator[Finding]:
    """Yield a warning for each detector of a cell without a measurement that applies to it."""
    assert cell.config is not None
    folders = (base, shipped_folder() / "cells")
    for keys, text in find_unmeasured(cell.config, base, folders):
        mark = mark_of(cell.root, keys, of_key=True) if cell.root else cell.source.mark()
        yield warning(mark, "not-measured", text)


def _find_kind(files: MissionFiles, kinds: Kinds | None, findings: list[Finding]) -> CellKind | None:
    """Return the kind of the mission's cell, or None if it is unknown."""
    if files.cell is None or files.cell.config is None or kinds is None:
        return None
    try:
        return kinds(files.cell.config.kind)
    except InputError as problem:
        findings.append(files.cell.finding(("kind",), "unknown-kind", str(problem)))
        return None

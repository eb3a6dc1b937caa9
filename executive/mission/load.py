"""A mission file and its cell file, read, checked, and ready to be built."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.cell_config import CellConfig
from executive.errors import InputError
from executive.mission.case import Case
from executive.mission.cell_file import CellFile, read_cell
from executive.mission.check import check
from executive.mission.expand import expand
from executive.mission.files import below, find_mission, read_source
from executive.mission.findings import Finding, MissionError, error, in_file_order
from executive.mission.model import Mission, Node
from executive.mission.parse import parse_mission
from executive.mission.text import parse_yaml
from executive.mission.validate import KeyPath
from executive.skill import Skill

RobotCheck = Callable[[CellConfig], Iterable[tuple[KeyPath, str]]]
"""Says what the robot cannot do in a cell: the keys of the value in the cell file, and a sentence."""


@dataclass(frozen=True)
class LoadedMission:
    """A mission without errors.

    Attributes:
        mission: What the file says, as written.
        tree: Its tree with subtrees, params and arguments put in.
        cell_config: The cell it happens in.
        text: The mission file.
        path: Where it was found.
        cell_path: Where the cell file was found.
        warnings: Findings that are no reason not to run.
    """

    mission: Mission
    tree: Node
    cell_config: CellConfig
    text: str
    path: Path
    cell_path: Path
    warnings: tuple[Finding, ...] = ()

    @property
    def params(self) -> dict[str, Any]:
        """The mission's params as plain values, overrides applied."""
        return {name: literal.value for name, literal in self.mission.params.items()}

    @property
    def routes(self) -> dict[str, str]:
        """Class label to bin name."""
        return {route.label: route.bin for route in self.mission.routes}


def load_mission(
    path: str | Path,
    skills: Mapping[str, type[Skill]],
    overrides: Mapping[str, str] | None = None,
    robot_check: RobotCheck | None = None,
) -> LoadedMission:
    """Return the mission in a file, or of a shipped name.

    Args:
        path: A mission file, or the name of a shipped mission.
        skills: Installed skills by name.
        overrides: Other values for params by name, and for the cell as `cell.<key>.<key>`.
        robot_check: Asked about the cell once it is known to be well formed.

    Raises:
        MissionError: Something is wrong with mission or cell; every finding is in it.
        InputError: There is no such mission.
    """
    overrides = overrides or {}
    file = find_mission(path)
    source = read_source(file)
    root, findings = parse_yaml(source)
    if root is None:
        raise MissionError(in_file_order(findings, source.path))
    mission, malformed = parse_mission(root, overrides)
    findings += malformed
    cell_path, cell = _cell(mission, file.parent, overrides, findings)
    config = cell.config if cell else None
    if cell and config and robot_check:
        findings += [cell.finding(keys, "robot", sentence) for keys, sentence in robot_check(config)]
    expanded = expand(mission)
    findings += expanded.findings
    case = Case(mission, expanded.tree, expanded.unused, skills, config)
    findings += check(case, sound=not _errors(findings))
    if config is None or cell_path is None or expanded.tree is None or _errors(findings):
        raise MissionError(in_file_order(findings, source.path))
    return LoadedMission(
        mission, expanded.tree, config, source.text, file, cell_path, in_file_order(findings, source.path)
    )


def _cell(
    mission: Mission, folder: Path, overrides: Mapping[str, str], findings: list[Finding]
) -> tuple[Path | None, CellFile | None]:
    """Return the mission's cell file; what is wrong with it is added to the findings."""
    if not mission.cell:
        return None, None
    try:
        path = below(folder, mission.cell)
        cell = read_cell(path, overrides)
    except InputError as problem:
        findings.append(error(mission.cell_mark, "no-cell", str(problem)))
        return None, None
    findings += cell.findings
    return path, cell


def _errors(findings: Iterable[Finding]) -> bool:
    return any(finding.severity == "error" for finding in findings)

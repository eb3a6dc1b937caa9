"""A cell file, read and checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from executive.cell_config import CellConfig
from executive.mission.files import read_source
from executive.mission.findings import Finding, MissionError, error, in_file_order
from executive.mission.overrides import override_cell
from executive.mission.source import Source
from executive.mission.text import Node, parse_yaml
from executive.mission.validate import KeyPath, mark_of, validate


@dataclass(frozen=True)
class CellFile:
    """What a cell file says.

    Attributes:
        config: Its content, or None where findings say why not.
        root: Its nodes, for placing findings that come later; None where it is no YAML.
    """

    config: CellConfig | None
    source: Source
    root: Node | None
    findings: tuple[Finding, ...]

    def finding(self, path: KeyPath, code: str, message: str) -> Finding:
        """Return an error about the value at `path`."""
        mark = mark_of(self.root, path) if self.root else self.source.mark()
        return error(mark, code, message)


def load_cell(path: Path, overrides: Mapping[str, str] | None = None) -> CellConfig:
    """Return the content of the cell file at `path`; `overrides` name its keys as `cell.<key>.<key>`.

    Raises:
        MissionError: Something is wrong with it; every finding is in the text.
        InputError: There is no such file.
    """
    file = read_cell(path, overrides or {})
    if file.config is None or file.findings:
        raise MissionError(in_file_order(file.findings, str(path)))
    return file.config


def read_cell(path: Path, overrides: Mapping[str, str]) -> CellFile:
    """Return what a cell file says and everything that is wrong with it.

    Raises:
        InputError: There is no such file.
    """
    source = read_source(path)
    root, findings = parse_yaml(source)
    if root is None:
        return CellFile(None, source, None, tuple(findings))
    root, wrong = override_cell(root, overrides)
    validated = validate(root, CellConfig)
    file = CellFile(validated.model, source, root, (*findings, *wrong, *validated.findings))
    if validated.model is None:
        return file
    later = (*_links(file, validated.model), *_assets(file, validated.model))
    found = _models_found(validated.model, path.parent)
    return CellFile(found, source, root, (*file.findings, *later))


def _links(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield every scan pose that the arm does not have."""
    poses = config.arm.poses_deg
    for name, camera in config.cameras.items():
        for index, pose in enumerate(camera.scan_poses):
            if pose not in poses:
                message = f'the arm has no pose "{pose}"; arm.poses_deg has: {", ".join(poses)}'
                yield file.finding(("cameras", name, "scan_poses", index), "unknown-pose", message)


def _models_found(config: CellConfig, folder: Path) -> CellConfig:
    """Return the cell with the models that lie in `folder` by their full path; others stay as named."""

    def found(urdf: str) -> dict[str, str]:
        path = (folder / urdf).resolve()
        return {"urdf": str(path) if path.is_file() else urdf}

    objects = {label: kind.model_copy(update=found(kind.urdf)) for label, kind in config.objects.items()}
    arm = config.arm.model_copy(update=found(config.arm.urdf))
    return config.model_copy(update={"arm": arm, "objects": objects})


def _assets(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield every model file that cannot lie below the cell's own folder or pybullet_data."""
    named: list[tuple[KeyPath, str]] = [(("arm", "urdf"), config.arm.urdf)]
    named += [(("objects", label, "urdf"), shape.urdf) for label, shape in config.objects.items()]
    for path, urdf in named:
        written = PurePosixPath(urdf)
        if written.is_absolute() or ".." in written.parts:
            message = f'"{urdf}" must be a relative path without ".."'
            yield file.finding(path, "outside", message)

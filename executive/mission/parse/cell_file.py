"""Cell files, merged with their bases and validated."""

from __future__ import annotations

import os.path
from collections.abc import Iterable, Iterator
from collections.abc import Mapping as Mapped
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.paths import has_outside_link, is_outside_path
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError, error, in_file_order
from executive.mission.parse.cell_layout import find_overlaps
from executive.mission.parse.overrides import CELL, override_cell, override_source
from executive.mission.parse.validate import KeyPath, mark_of, validate
from executive.mission.source import Source
from executive.mission.text.files import below, read_source
from executive.mission.text.yaml_text import Entry, Mapping, Node, Scalar, parse_yaml, plain
from executive.mission.words import describe

BASE = "base"
"""Key that names the base file, which supplies the missing top-level keys."""

DETECTORS = "detectors"
"""Key whose value is merged with the value in the base, detector by detector."""

MAX_BASE_FILES = 5
"""Maximum length of the chain of bases of a cell file."""


@dataclass(frozen=True)
class CellFile:
    """Content of a cell file and its bases.

    Attributes:
        config: Validated content, or None if the file has errors.
        source: Text of the cell file.
        root: Merged nodes of the file and its bases, which locate later findings; None if a file is not YAML.
        findings: Errors in the file and its bases.
    """

    config: CellConfig | None
    source: Source
    root: Node | None
    findings: tuple[Finding, ...]

    def finding(self, path: KeyPath, code: str, message: str) -> Finding:
        """Return an error about the value at `path`."""
        mark = mark_of(self.root, path) if self.root else self.source.mark()
        return error(mark, code, message)


def load_cell(path: Path, overrides: Mapped[str, str] | None = None) -> CellConfig:
    """Return the content of a cell file; `overrides` name its keys as `cell.<key>.<key>`.

    Raises:
        MissionError: The file has errors; the text contains every finding.
        InputError: The file does not exist.
    """
    file = read_cell(path, overrides or {})
    if file.config is None or file.findings:
        raise MissionError(in_file_order(file.findings, str(path)))
    return file.config


def read_cell(path: Path, overrides: Mapped[str, str]) -> CellFile:
    """Return the content of a cell file and its bases, with all findings.

    Raises:
        InputError: The file does not exist.
    """
    source = read_source(path)
    parts = _CellParts()
    root = parts.read_tree(path, source, ())
    if root is None:
        return CellFile(None, source, None, tuple(parts.findings))
    root, override_findings = override_cell(root, overrides)
    override_findings += _find_overridden_base(overrides)
    validated = validate(root, CellConfig)
    file = CellFile(validated.model, source, root, (*parts.findings, *override_findings, *validated.findings))
    if validated.model is None:
        return file
    overlaps = (file.finding(keys, "layout", text) for keys, text in find_overlaps(validated.model))
    models = tuple(_list_models(file, validated.model, parts.folders))
    outside = tuple(_find_models_outside(file, models))
    findings = (*file.findings, *_find_unknown_poses(file, validated.model), *outside, *overlaps)
    # Model files outside the folder must not be opened, so the cell is unusable.
    config = None if outside else _resolve_models(validated.model, models)
    return CellFile(config, source, root, findings)


class _CellParts:
    """A cell file and its bases, collected while they are read.

    Attributes:
        folders: Folder of each file.
        findings: Errors in the YAML of the files and in their references to bases.
    """

    def __init__(self) -> None:
        self.folders: dict[Source, Path] = {}
        self.findings: list[Finding] = []

    def read_tree(self, path: Path, source: Source, derived: tuple[Path, ...]) -> Node | None:
        """Return the nodes of a file merged with its base, or None if one of them is not YAML.

        `derived` are the files that are based on this file, the cell file first.
        """
        self.folders[source] = path.parent
        root, findings = parse_yaml(source)
        self.findings += findings
        if not isinstance(root, Mapping):
            return root
        named = root.get(BASE)
        # Validation rejects a base that is not a text.
        if not isinstance(named, Scalar) or not isinstance(named.value, str):
            return root
        base = self._read_base(named, (*derived, path))
        if base is None:
            return None
        own = tuple(_merge(entry, base) for entry in root.entries if entry.key.text != BASE)
        return _complete(replace(root, entries=own), base)

    def _read_base(self, named: Scalar, files: tuple[Path, ...]) -> Mapping | None:
        """Return the nodes of the base of the last of `files`, or None if the base cannot be read."""
        try:
            path = below(files[-1].parent, named.text, ("cells", ""))
            if any(file.samefile(path) for file in files):
                cycle = " -> ".join(file.name for file in (*files, path))
                raise InputError(f'"{named.text}" is itself based on this file: {cycle}')
            if len(files) > MAX_BASE_FILES:
                raise InputError(
                    f"at most {MAX_BASE_FILES} files may stand below {files[0].name}, one as base of another"
                )
            source = read_source(path)
            root = self.read_tree(path, source, files)
            if root is not None and not isinstance(root, Mapping):
                raise InputError(f"{source.path} must be a mapping, not {describe(plain(root))}")
        except InputError as problem:
            self.findings.append(error(named.mark, "no-base", str(problem)))
            return None
        return root


def _merge(entry: Entry, base: Mapping) -> Entry:
    """Return an entry of a file; the detectors are merged with the detectors of the base.

    A detector of the same kind in both files takes its missing keys from the base; a detector of another kind
    takes none. A detector without a value is removed. The detectors of the file come first.
    """
    own, inherited = entry.value, base.get(DETECTORS)
    if entry.key.text != DETECTORS or not isinstance(own, Mapping) or not isinstance(inherited, Mapping):
        return entry
    merged = []
    for detector in own.entries:
        base_detector = inherited.get(detector.key.text)
        if base_detector is None or plain(detector.value) is not None:
            merged.append(replace(detector, value=_merge_detector(detector.value, base_detector)))
    return replace(entry, value=_complete(replace(own, entries=tuple(merged)), inherited, own.keys))


def _merge_detector(own: Node, base: Node | None) -> Node:
    """Return a detector, with its missing keys taken from the base if both are of the same kind."""
    if not isinstance(own, Mapping) or not isinstance(base, Mapping):
        return own
    kind, base_kind = own.get("kind"), base.get("kind")
    is_same_kind = kind is None or (base_kind is not None and plain(kind) == plain(base_kind))
    return _complete(own, base) if is_same_kind else own


def _complete(own: Mapping, base: Mapping, excluded: tuple[str, ...] = ()) -> Mapping:
    """Return a mapping, with its missing entries taken from the base except the `excluded` keys."""
    known = {*own.keys, *excluded}
    return replace(own, entries=(*own.entries, *(e for e in base.entries if e.key.text not in known)))


def _find_overridden_base(overrides: Mapped[str, str]) -> Iterator[Finding]:
    """Yield a finding if an override changes the base; only the cell file may name a base."""
    key = f"{CELL}{BASE}"
    if key in overrides:
        mark = override_source(key, overrides[key]).mark(1, 1, len(key))
        yield error(mark, "unknown-key", "a cell's base cannot be changed here; name it in the cell file")


def _find_unknown_poses(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield a finding for each scan pose that is not a named pose of the arm."""
    poses = config.arm.poses_deg
    for name, camera in config.cameras.items():
        for index, pose in enumerate(camera.scan_poses):
            if pose not in poses:
                message = f'the arm has no pose "{pose}"; arm.poses_deg has: {", ".join(poses)}'
                yield file.finding(("cameras", name, "scan_poses", index), "unknown-pose", message)


def _list_models(
    file: CellFile, config: CellConfig, folders: Mapped[Source, Path]
) -> Iterator[tuple[KeyPath, Path, str]]:
    """Yield for each model file its keys, the folder of the file that names it, and its path as written."""
    assert file.root is not None
    for label, kind in config.objects.items():
        for key, model in (("urdf", kind.urdf), ("mesh", kind.mesh)):
            if model:
                keys = ("objects", label, key)
                yield keys, folders.get(mark_of(file.root, keys).source, folders[file.source]), model


def _resolve_models(config: CellConfig, models: Iterable[tuple[KeyPath, Path, str]]) -> CellConfig:
    """Return the cell with absolute paths of the model files that exist; other paths stay as written."""
    objects = dict(config.objects)
    for (_, label, key), folder, model in models:
        if os.path.isfile(path := folder / model):
            kind = objects[str(label)]
            objects[str(label)] = kind.model_copy(update={str(key): str(path.resolve())})
    return config.model_copy(update={"objects": objects})


def _find_models_outside(file: CellFile, models: Iterable[tuple[KeyPath, Path, str]]) -> Iterator[Finding]:
    """Yield a finding for each model file outside the folder of the file that names it."""
    for keys, folder, model in models:
        if is_outside_path(model):
            yield file.finding(keys, "outside", f'"{model}" must be a relative path without ".."')
        elif os.path.isfile(folder / model) and has_outside_link(folder, model):
            yield file.finding(keys, "outside", f'"{model}" is a link to a file outside of {folder}')

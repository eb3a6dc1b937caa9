"""Loading of cell files: merging with their base files, and validation."""

from __future__ import annotations

import os.path
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.paths import has_outside_link, is_outside_path
from executive.errors import InputError
from executive.mission.findings import Finding, MissionError, make_error, sort_findings
from executive.mission.parse.cell_layout import find_overlaps
from executive.mission.parse.overrides import CELL_PREFIX, make_override_source, override_cell
from executive.mission.parse.validate import KeyPath, find_span, validate
from executive.mission.source import Source
from executive.mission.text.file_search import find_file_below, read_source
from executive.mission.text.yaml_text import (
    YamlEntry,
    YamlMapping,
    YamlNode,
    YamlScalar,
    describe_node,
    parse_yaml,
    to_python_value,
)

BASE_KEY = "base"
"""Key with the path of the base file, which supplies the missing top-level keys."""

DETECTORS_KEY = "detectors"
"""Key whose value is merged with the value in the base, detector by detector."""

MAX_BASE_COUNT = 5
"""Maximum number of files in the chain of bases of a cell file."""


@dataclass(frozen=True)
class CellFile:
    """Content of a cell file and its bases.

    Attributes:
        config: Validated content, or None if the file has errors.
        source: Text of the cell file.
        root: Merged YAML tree of the file and its bases, for the positions of findings; None if invalid YAML.
        findings: Errors in the file and its bases.
    """

    config: CellConfig | None
    source: Source
    root: YamlNode | None
    findings: tuple[Finding, ...]

    def make_error(self, path: KeyPath, code: str, message: str) -> Finding:
        """Return an error about the value at `path`."""
        span = find_span(self.root, path) if self.root else self.source.make_span()
        return make_error(span, code, message)


def load_cell(path: Path, overrides: Mapping[str, str] | None = None) -> CellConfig:
    """Return the content of a cell file; `overrides` are values by `cell.<key>.<key>`, as text.

    Raises:
        MissionError: The file has errors; the exception contains every finding.
        InputError: The file does not exist.
    """
    file = read_cell(path, overrides or {})
    if file.config is None or file.findings:
        raise MissionError(sort_findings(file.findings, str(path)))
    return file.config


def read_cell(path: Path, overrides: Mapping[str, str]) -> CellFile:
    """Return the content of a cell file merged with its bases, and all errors.

    Raises:
        InputError: The file does not exist.
    """
    source = read_source(path)
    reader = _CellFileReader()
    root = reader.read_tree(path, source, ())
    if root is None:
        return CellFile(None, source, None, tuple(reader.findings))
    root, override_findings = override_cell(root, overrides)
    override_findings += _find_overridden_base(overrides)
    validated = validate(root, CellConfig)
    findings = (*reader.findings, *override_findings, *validated.findings)
    file = CellFile(validated.model, source, root, findings)
    if validated.model is None:
        return file
    overlaps = (file.make_error(keys, "layout", text) for keys, text in find_overlaps(validated.model))
    model_files = tuple(_list_model_files(file, validated.model, reader.folders))
    outside = tuple(_find_model_files_outside(file, model_files))
    findings = (*findings, *_find_unknown_poses(file, validated.model), *outside, *overlaps)
    # Without config, no caller can open a model file outside the folder.
    config = None if outside else _resolve_model_files(validated.model, model_files)
    return CellFile(config, source, root, findings)


class _CellFileReader:
    """Reader of a cell file and its bases.

    Attributes:
        folders: Folder of each file that was read.
        findings: Syntax errors of the files, and errors of the values of `base`.
    """

    def __init__(self) -> None:
        self.folders: dict[Source, Path] = {}
        self.findings: list[Finding] = []

    def read_tree(self, path: Path, source: Source, derived: tuple[Path, ...]) -> YamlNode | None:
        """Return the YAML tree of a file merged with its base, or None if one of them is invalid.

        `derived` are the files that are based on this file, the cell file first.
        """
        self.folders[source] = path.parent
        root, findings = parse_yaml(source)
        self.findings += findings
        if not isinstance(root, YamlMapping):
            return root
        reference = root.get(BASE_KEY)
        # Validation reports a base that is not a string.
        if not isinstance(reference, YamlScalar) or not isinstance(reference.value, str):
            return root
        base = self._read_base(reference, (*derived, path))
        if base is None:
            return None
        own = tuple(_merge_entry(entry, base) for entry in root.entries if entry.key.text != BASE_KEY)
        return _complete(replace(root, entries=own), base)

    def _read_base(self, reference: YamlScalar, files: tuple[Path, ...]) -> YamlMapping | None:
        """Return the YAML tree of the base file that `files[-1]` names, or None if it cannot be read."""
        try:
            path = find_file_below(files[-1].parent, reference.text, ("cells", ""))
            if any(file.samefile(path) for file in files):
                cycle = " -> ".join(file.name for file in (*files, path))
                raise InputError(f'"{reference.text}" is itself based on this file: {cycle}')
            if len(files) > MAX_BASE_COUNT:
                name = files[0].name
                raise InputError(f"the chain of bases of {name} has more than {MAX_BASE_COUNT} files")
            source = read_source(path)
            root = self.read_tree(path, source, files)
            if root is not None and not isinstance(root, YamlMapping):
                raise InputError(f"{source.path} must be a mapping, not {describe_node(root)}")
        except InputError as problem:
            self.findings.append(make_error(reference.span, "no-base", str(problem)))
            return None
        return root


def _merge_entry(entry: YamlEntry, base: YamlMapping) -> YamlEntry:
    """Return an entry of a file; an entry `detectors` is merged with the detectors of the base.

    A detector of the same kind in both files takes its missing keys from the base; a detector of another kind
    takes none. A detector without value is removed. The detectors of the file come first.
    """
    own, inherited = entry.value, base.get(DETECTORS_KEY)
    is_detectors = entry.key.text == DETECTORS_KEY
    if not is_detectors or not isinstance(own, YamlMapping) or not isinstance(inherited, YamlMapping):
        return entry
    merged = []
    for detector in own.entries:
        base_detector = inherited.get(detector.key.text)
        if base_detector is None or to_python_value(detector.value) is not None:
            merged.append(replace(detector, value=_merge_detector(detector.value, base_detector)))
    return replace(entry, value=_complete(replace(own, entries=tuple(merged)), inherited, own.keys))


def _merge_detector(own: YamlNode, base: YamlNode | None) -> YamlNode:
    """Return a detector, with its missing keys taken from the base if both have the same kind."""
    if not isinstance(own, YamlMapping) or not isinstance(base, YamlMapping):
        return own
    kind, base_kind = own.get("kind"), base.get("kind")
    is_same_kind = kind is None or (
        base_kind is not None and to_python_value(kind) == to_python_value(base_kind)
    )
    return _complete(own, base) if is_same_kind else own


def _complete(own: YamlMapping, base: YamlMapping, excluded: tuple[str, ...] = ()) -> YamlMapping:
    """Return a mapping, with its missing entries taken from the base, except entries with `excluded` keys."""
    skipped = {*own.keys, *excluded}
    inherited = (entry for entry in base.entries if entry.key.text not in skipped)
    return replace(own, entries=(*own.entries, *inherited))


def _find_overridden_base(overrides: Mapping[str, str]) -> Iterator[Finding]:
    """Yield an error if an override changes the base, because only the cell file may do this."""
    key = f"{CELL_PREFIX}{BASE_KEY}"
    if key in overrides:
        span = make_override_source(key, overrides[key]).make_span(1, 1, len(key))
        yield make_error(span, "unknown-key", "--set cannot change the base of a cell; edit the cell file")


def _find_unknown_poses(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield an error for each scan pose that is not a named pose of the arm."""
    poses = config.arm.poses_deg
    for name, camera in config.cameras.items():
        for index, pose in enumerate(camera.scan_poses):
            if pose not in poses:
                message = f'the arm has no pose "{pose}"; arm.poses_deg has: {", ".join(poses)}'
                yield file.make_error(("cameras", name, "scan_poses", index), "unknown-pose", message)


def _list_model_files(
    file: CellFile, config: CellConfig, folders: Mapping[Source, Path]
) -> Iterator[tuple[KeyPath, Path, str]]:
    """Yield each model file of an object: its keys, the folder of the file that names it, and its path."""
    assert file.root is not None
    for label, kind in config.objects.items():
        for key, model in (("urdf", kind.urdf), ("mesh", kind.mesh)):
            if model:
                keys = ("objects", label, key)
                yield keys, folders.get(find_span(file.root, keys).source, folders[file.source]), model


def _resolve_model_files(config: CellConfig, model_files: Iterable[tuple[KeyPath, Path, str]]) -> CellConfig:
    """Return the cell with absolute paths of the model files that exist; other paths are unchanged."""
    objects = dict(config.objects)
    for (_, label, key), folder, model in model_files:
        if os.path.isfile(path := folder / model):
            kind = objects[str(label)]
            objects[str(label)] = kind.model_copy(update={str(key): str(path.resolve())})
    return config.model_copy(update={"objects": objects})


def _find_model_files_outside(
    file: CellFile, model_files: Iterable[tuple[KeyPath, Path, str]]
) -> Iterator[Finding]:
    """Yield an error for each model file outside the folder of the file that names it."""
    for keys, folder, model in model_files:
        if is_outside_path(model):
            yield file.make_error(keys, "outside", f'"{model}" must be a relative path without ".."')
        elif os.path.isfile(folder / model) and has_outside_link(folder, model):
            yield file.make_error(keys, "outside", f'"{model}" is a link to a file outside {folder}')

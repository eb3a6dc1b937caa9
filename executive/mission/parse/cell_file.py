"""A cell file, put together with the files it is based on, and checked."""

from __future__ import annotations

import os.path
from collections.abc import Iterator
from collections.abc import Mapping as Mapped
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cell.config import CellConfig
from executive.cell.paths import leaves_folder, links_out
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
"""The key that names the file which gives every key of the first level that this one does not."""

DETECTORS = "detectors"
"""The key whose value is merged with that of the base, detector by detector."""

MAX_BASE_FILES = 5
"""How many files may stand below a cell file, each the base of the one before."""


@dataclass(frozen=True)
class CellFile:
    """What a cell file says.

    Attributes:
        config: Its content, or None where findings say why not.
        root: Its nodes and those of its bases, for placing findings that come later; None where it or a
            base is no YAML.
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
    """Return the content of the cell file at `path`; `overrides` name its keys as `cell.<key>.<key>`.

    Raises:
        MissionError: Something is wrong with it; every finding is in the text.
        InputError: There is no such file.
    """
    file = read_cell(path, overrides or {})
    if file.config is None or file.findings:
        raise MissionError(in_file_order(file.findings, str(path)))
    return file.config


def read_cell(path: Path, overrides: Mapped[str, str]) -> CellFile:
    """Return what a cell file and its bases say and everything that is wrong with them.

    Raises:
        InputError: There is no such file.
    """
    source = read_source(path)
    parts = _CellParts()
    root = parts.tree(path, source, ())
    if root is None:
        return CellFile(None, source, None, tuple(parts.findings))
    root, wrong = override_cell(root, overrides)
    wrong += _rebased(overrides)
    validated = validate(root, CellConfig)
    file = CellFile(validated.model, source, root, (*parts.findings, *wrong, *validated.findings))
    if validated.model is None:
        return file
    overlaps = (file.finding(keys, "layout", text) for keys, text in find_overlaps(validated.model))
    outside = tuple(_models_outside(file, validated.model, parts.folders))
    later = (*_links(file, validated.model), *outside, *overlaps)
    if outside:
        # Nobody may open these files, not even to check them.
        return CellFile(None, source, root, (*file.findings, *later))
    found = _models_found(file, validated.model, parts.folders)
    return CellFile(found, source, root, (*file.findings, *later))


class _CellParts:
    """The files that a cell is put together from, gathered while they are read.

    Attributes:
        folders: Where each of them is.
        findings: What is wrong with their form.
    """

    def __init__(self) -> None:
        self.folders: dict[Source, Path] = {}
        self.findings: list[Finding] = []

    def tree(self, path: Path, source: Source, above: tuple[Path, ...]) -> Node | None:
        """Return the nodes of a file with those of its base put in, or None where one is no YAML.

        `above` are the files that are based on this one, the cell file itself first.
        """
        self.folders[source] = path.parent
        root, wrong = parse_yaml(source)
        self.findings += wrong
        if not isinstance(root, Mapping):
            return root
        named = root.get(BASE)
        # A base that is no text stays where it is, for validation to complain of.
        if not isinstance(named, Scalar) or not isinstance(named.value, str):
            return root
        base = self._base(named, (*above, path))
        if base is None:
            return None
        own = tuple(_merge(entry, base) for entry in root.entries if entry.key.text != BASE)
        return _complete(replace(root, entries=own), base)

    def _base(self, named: Scalar, files: tuple[Path, ...]) -> Mapping | None:
        """Return the nodes of the base that the last of `files` names, or None where there are none."""
        try:
            path = below(files[-1].parent, named.text, ("cells", ""))
            if any(file.samefile(path) for file in files):
                ring = " -> ".join(file.name for file in (*files, path))
                raise InputError(f'"{named.text}" is itself based on this file: {ring}')
            if len(files) > MAX_BASE_FILES:
                raise InputError(
                    f"at most {MAX_BASE_FILES} files may stand below {files[0].name}, one as base of another"
                )
            source = read_source(path)
            root = self.tree(path, source, files)
            if root is not None and not isinstance(root, Mapping):
                raise InputError(f"{source.path} must be a mapping, not {describe(plain(root))}")
        except InputError as problem:
            self.findings.append(error(named.mark, "no-base", str(problem)))
            return None
        return root


def _merge(entry: Entry, base: Mapping) -> Entry:
    """Return an entry of a file; that of its detectors with those of the base.

    A detector that both files have in one kind takes the keys that the file lacks from the base; in another
    kind it is the file's alone. A detector without a value is removed. The detectors of the file come first.
    """
    own, inherited = entry.value, base.get(DETECTORS)
    if entry.key.text != DETECTORS or not isinstance(own, Mapping) or not isinstance(inherited, Mapping):
        return entry
    merged = []
    for detector in own.entries:
        older = inherited.get(detector.key.text)
        if older is None or plain(detector.value) is not None:
            merged.append(replace(detector, value=_merge_detector(detector.value, older)))
    others = (older for older in inherited.entries if older.key.text not in own.keys)
    return replace(entry, value=replace(own, entries=(*merged, *others)))


def _merge_detector(own: Node, base: Node | None) -> Node:
    """Return a detector with the keys of the base's detector that it lacks, if both are of one kind."""
    if not isinstance(own, Mapping) or not isinstance(base, Mapping):
        return own
    kind, older = own.get("kind"), base.get("kind")
    is_one_kind = kind is None or (older is not None and plain(kind) == plain(older))
    return _complete(own, base) if is_one_kind else own


def _complete(own: Mapping, base: Mapping) -> Mapping:
    """Return a mapping with the entries of the base for the keys that it lacks."""
    return replace(own, entries=(*own.entries, *(e for e in base.entries if e.key.text not in own.keys)))


def _rebased(overrides: Mapped[str, str]) -> Iterator[Finding]:
    """Yield a finding where an override names another base: that is for the file to say."""
    key = f"{CELL}{BASE}"
    if key in overrides:
        mark = override_source(key, overrides[key]).mark(1, 1, len(key))
        yield error(mark, "unknown-key", "a cell's base cannot be changed here; name it in the cell file")


def _links(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield every scan pose that the arm does not have."""
    poses = config.arm.poses_deg
    for name, camera in config.cameras.items():
        for index, pose in enumerate(camera.scan_poses):
            if pose not in poses:
                message = f'the arm has no pose "{pose}"; arm.poses_deg has: {", ".join(poses)}'
                yield file.finding(("cameras", name, "scan_poses", index), "unknown-pose", message)


def _models(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield the keys and the path, as written, of every model file that a cell names."""
    for label, kind in config.objects.items():
        if kind.urdf:
            yield ("objects", label, "urdf"), kind.urdf
        if kind.mesh:
            yield ("objects", label, "mesh"), kind.mesh


def _models_found(file: CellFile, config: CellConfig, folders: Mapped[Source, Path]) -> CellConfig:
    """Return the cell with the models beside the file that names them by full path; others stay as named."""
    assert file.root is not None
    found = {}
    for keys, model in _models(config):
        folder = folders.get(mark_of(file.root, keys).source, folders[file.source])
        path = folder / model
        found[keys] = str(path.resolve()) if os.path.isfile(path) else model
    objects = {
        label: kind.model_copy(update={key: found["objects", label, key]})
        for label, kind in config.objects.items()
        for key in ("mesh" if kind.mesh else "urdf",)
    }
    return config.model_copy(update={"objects": objects})


def _models_outside(file: CellFile, config: CellConfig, folders: Mapped[Source, Path]) -> Iterator[Finding]:
    """Yield every model file that does not lie below the folder of the file that names it."""
    assert file.root is not None
    for keys, model in _models(config):
        folder = folders.get(mark_of(file.root, keys).source, folders[file.source])
        if leaves_folder(model):
            yield file.finding(keys, "outside", f'"{model}" must be a relative path without ".."')
        elif os.path.isfile(folder / model) and links_out(folder, model):
            yield file.finding(keys, "outside", f'"{model}" is a link to a file outside of {folder}')

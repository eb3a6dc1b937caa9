"""Loading of cell files: merging with base and arm file, validation, and checks of names and overlaps."""

from __future__ import annotations

import os.path
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Protocol

import numpy as np

from executive.cell.arm_config import DEFAULT_ARM_FILE
from executive.cell.config import BinConfig, CellConfig, ObjectConfig
from executive.cell.objects import BIN_THICKNESS
from executive.errors import InputError
from executive.geometry import Array
from executive.mission.arm_file import read_arm_file, repeat_numbers
from executive.plugins import PACKAGE_PREFIX
from executive.text.files import describe_outside_path, find_file_below, is_outside_path, read_source
from executive.text.findings import Finding, MissionError, Source, Span, make_error, sort_findings
from executive.text.validate import BASE_KEY, KeyPath, find_span, override_cell, validate
from executive.text.yaml_files import YamlMapping, YamlNode, YamlScalar, flatten, parse_yaml

DETECTORS_KEY = "detectors"
"""Key whose value is merged with the value in the base, detector by detector."""

CALIBRATION_KEYS: Mapping[str, str] = {
    "camera_matrix": "matrix", "cameraMatrix": "matrix", "K": "matrix", "k": "matrix",
    "distortion_coefficients": "distortion", "distCoeffs": "distortion", "D": "distortion", "d": "distortion",
    "distortion_model": "distortion_model", "image_width": "width", "width": "width",
    "image_height": "height", "height": "height",
}  # fmt: skip
"""Keys of a calibration by the keys of `camera_info` files, `CameraInfo` messages and files of OpenCV."""

MESH_SUFFIXES = (".obj", ".stl", ".dae")
"""Suffixes of the files of meshes."""
MAX_BASE_COUNT = 5
"""Maximum number of files in the chain of bases of a cell file."""


class CellFileChecker(Protocol):
    """Checks of cell files of one kind; `executive.station.check.CellChecker` implements them."""

    def check(self, config: CellConfig, cell_folder: Path) -> Iterable[tuple[KeyPath, str]]:
        """Yield key and message of each error that the validation of the cell file does not find."""

    def labels(self, config: CellConfig, cell_folder: Path) -> Mapping[str, tuple[str, ...] | None]:
        """Return the labels that each detector can report, by name; None if they are unknown."""

    def compute_mass(self, section: ObjectConfig) -> float:
        """Return the mass of the objects of a class [kg], 0 if it is unknown."""

    def measure_hold(self, config: CellConfig, label: str) -> float:
        """Return the largest force with which the tool can hold objects of a class [N], inf if unknown."""


@dataclass(frozen=True)
class CellFile:
    """Content of a cell file and its bases.

    Attributes:
        path: Path of the cell file.
        config: Validated content, or None if the file has errors.
        source: Text of the cell file.
        root: Merged YAML tree, for positions of findings; None for invalid YAML and for a recorded cell.
        findings: Errors in the file, its bases and its arm file.
        files: Paths of the cell file, its bases, its arm file, its calibrations and its own models.
    """

    path: Path
    config: CellConfig | None
    source: Source
    root: YamlNode | None = None
    findings: tuple[Finding, ...] = ()
    files: tuple[Path, ...] = ()

    def find_span(self, key_path: KeyPath, *, at_key: bool = False) -> Span:
        """Return the position of the value at `key_path`, or of its key; the file for a recorded cell."""
        return find_span(self.root, key_path, at_key) if self.root else self.source.make_span()

    def make_error(self, key_path: KeyPath, code: str, message: str) -> Finding:
        """Return an error about the value at `key_path`."""
        return make_error(self.find_span(key_path), code, message)


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
    """Return the content of a cell file merged with its bases and its arm file, and all errors.

    Raises:
        InputError: The file does not exist.
    """
    source = read_source(path)
    reader = _CellFileReader()
    root = reader.read_tree(path, source, ())
    if root is None:
        return CellFile(path, None, source, findings=tuple(reader.findings))
    root, override_findings = override_cell(root, overrides)
    root = reader.insert_arm_file(reader.arrange_matrices(root))
    config, validation_errors = validate(root, CellConfig) if root else (None, [])
    findings = (*reader.findings, *override_findings, *validation_errors)
    file = CellFile(path, config, source, root, findings)
    if config is None:
        return file
    overlap_errors = (file.make_error(keys, "layout", message) for keys, message in find_overlaps(config))
    name_errors = (*_find_unknown_poses(file, config), *_find_wrong_looks(file, config))
    resolved_config, outside_errors, models = _resolve_model_files(file, config, reader.paths)
    findings = (*findings, *name_errors, *outside_errors, *overlap_errors)
    # If a model file lies outside the folder, `config` is None, so that no caller opens that file.
    files = (*reader.paths.values(), *models)
    return replace(file, config=None if outside_errors else resolved_config, findings=findings, files=files)


class _CellFileReader:
    """Reader of a cell file, its bases and its arm file.

    Attributes:
        paths: Path of each file that was read.
        findings: Syntax errors of the files, errors of the values of `base` and `file`, and all errors of the
            arm file.
    """

    def __init__(self) -> None:
        self.paths: dict[Source, Path] = {}
        self.findings: list[Finding] = []

    def read_tree(self, path: Path, source: Source, previous_files: tuple[Path, ...]) -> YamlNode | None:
        """Return the YAML tree of a file merged with its base, or None if a file is invalid.

        `previous_files` is the chain of bases from the cell file to the file that names `path` as its base.
        """
        self.paths[source] = path
        root, findings = parse_yaml(source)
        self.findings += findings
        if not isinstance(root, YamlMapping):
            return root
        reference = root.get(BASE_KEY)
        # Validation reports a base that is not a string.
        if not isinstance(reference, YamlScalar) or not isinstance(reference.value, str):
            return root
        base = self._read_base(reference, (*previous_files, path))
        if base is None:
            return None
        root = _omit_entry(root, BASE_KEY)
        if detectors := root.get(DETECTORS_KEY):
            root = root.with_value(DETECTORS_KEY, _merge_sections(detectors, base.get(DETECTORS_KEY)))
        return _inherit_entries(root, base)

    def _read_base(self, reference: YamlScalar, files: tuple[Path, ...]) -> YamlMapping | None:
        """Return the YAML tree of the base of `files[-1]`, or None if the base cannot be read."""
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
                raise InputError(f"{source.path} must be a mapping, not {root.description}")
        except InputError as problem:
            self.findings.append(make_error(reference.span, "no-base", str(problem)))
            return None
        return root

    def insert_arm_file(self, root: YamlNode) -> YamlNode | None:
        """Return the tree of a cell whose arm is completed by its arm file, or None if this is impossible.

        An arm without a file is completed by the default arm file, except by its limits.
        """
        arm = root.get("arm") if isinstance(root, YamlMapping) else None
        if not isinstance(root, YamlMapping) or not isinstance(arm, YamlMapping):
            return root
        is_default = "file" not in arm.entries
        file = YamlScalar(arm.span, DEFAULT_ARM_FILE, DEFAULT_ARM_FILE) if is_default else arm.get("file")
        if not isinstance(file, YamlScalar):
            return root  # Validation reports the wrong type.
        source = self._read_named_file(file, "", "no-arm")
        if source is None:
            return None
        try:
            arm_root, arm_file = read_arm_file(source, self.paths[source].parent)
        except MissionError as error:
            self.findings += error.findings
            return None
        urdf = arm.get("urdf")
        if is_default and urdf is not None and urdf.python_value != arm_file.urdf:
            message = f'an arm other than {arm_file.arm} needs the key "file" with the path of an arm file'
            self.findings.append(make_error(urdf.span, "no-arm", message))
            return None
        completing_root = _omit_entry(arm_root, "limits") if is_default else arm_root
        arm = repeat_numbers(arm, arm_file.joint_count)
        return root.with_value("arm", _merge_sections(arm, completing_root))

    def arrange_matrices(self, node: YamlNode, keys: KeyPath = ()) -> YamlNode:
        """Return a tree whose calibrations contain the entries of files, and each matrix as one list.

        `keys` is the path of `node`.
        """
        is_calibration = keys[:1] == ("cameras",) and keys[2:3] == ("calibration",)
        if not isinstance(node, YamlMapping):
            return flatten(node) if is_calibration else node
        if is_calibration and (data := node.get("data")):
            return flatten(data)
        # Only the calibration itself, and none of its parts, can name a file.
        entries = dict(self._insert_file(node).entries if is_calibration and len(keys) == 3 else node.entries)
        for key, entry in entries.items():
            entries[key] = replace(entry, value=self.arrange_matrices(entry.value, (*keys, key)))
        return replace(node, entries=entries)

    def _read_named_file(self, file: YamlScalar, shipped_subfolder: str, code: str) -> Source | None:
        """Return the text of the file that a value names, or None after an error with this code."""
        folder = self.paths.get(file.span.source, next(iter(self.paths.values()))).parent
        try:
            path = find_file_below(folder, file.text, (shipped_subfolder,))
            source = read_source(path)
        except InputError as problem:
            self.findings.append(make_error(file.span, code, str(problem)))
            return None
        self.paths[source] = path
        return source

    def _insert_file(self, calibration: YamlMapping) -> YamlMapping:
        """Return a calibration, completed by the entries of its file, if any."""
        file = calibration.get("file")
        if not isinstance(file, YamlScalar):
            return calibration
        source = self._read_named_file(file, "cells", "no-calibration")
        if source is None:
            return calibration
        # PyYAML reads neither the first line nor the tags of OpenCV; the replacements keep all columns.
        text = source.text.replace("%YAML:", "#YAML:").replace("!!opencv-matrix", " " * 15)
        # A message that `ros2 topic echo` prints ends with ---.
        text = text.rstrip().removesuffix("---")
        root, findings = parse_yaml(source, text)
        self.findings += findings
        entries = root.entries if isinstance(root, YamlMapping) else {}
        known = {CALIBRATION_KEYS[key]: entries[key] for key in entries if key in CALIBRATION_KEYS}
        return _inherit_entries(calibration, replace(calibration, entries=known))


def _merge_sections(sections: YamlNode, base: YamlNode | None) -> YamlNode:
    """Return a mapping of sections, completed by sections of the base and by keys of these sections.

    A section without value removes the base's section of this name. The sections of the file come first.
    """
    if not isinstance(sections, YamlMapping) or not isinstance(base, YamlMapping):
        return sections
    entries = {**sections.entries, **base.entries}
    for key, entry in sections.entries.items():
        base_section = base.get(key)
        if base_section is not None and entry.value.python_value is None:
            del entries[key]
        else:
            entries[key] = replace(entry, value=_merge_section(entry.value, base_section))
    return replace(sections, entries=entries)


def _merge_section(section: YamlNode, base: YamlNode | None) -> YamlNode:
    """Return a section, completed by keys of the base's section if it declares no kind or the same kind."""
    if not isinstance(section, YamlMapping) or not isinstance(base, YamlMapping):
        return section
    kind = section.get("kind")
    base_kind = base.get("kind")
    is_same_kind = kind is None or (base_kind and kind.python_value == base_kind.python_value)
    return _inherit_entries(section, base) if is_same_kind else section


def _omit_entry(mapping: YamlMapping, omitted_key: str) -> YamlMapping:
    """Return a mapping without the entry of a key."""
    entries = {key: entry for key, entry in mapping.entries.items() if key != omitted_key}
    return replace(mapping, entries=entries)


def _inherit_entries(mapping: YamlMapping, base: YamlMapping) -> YamlMapping:
    """Return a mapping, completed by the entries of the base, behind its own entries."""
    return replace(mapping, entries={**mapping.entries, **base.entries, **mapping.entries})


def _find_unknown_poses(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield an error for each scan pose that is not a named pose of the arm."""
    poses = config.arm.poses_deg
    for name, camera in config.cameras.items():
        for index, pose in enumerate(camera.scan_poses):
            if pose not in poses:
                message = f'the arm has no pose "{pose}"; arm.poses_deg has: {", ".join(poses)}'
                yield file.make_error(("cameras", name, "scan_poses", index), "unknown-pose", message)


def _find_wrong_looks(file: CellFile, config: CellConfig) -> Iterator[Finding]:
    """Yield an error for each class that looks like a class that the cell lacks or that differs in size."""
    for label, section in config.objects.items():
        if not (name := section.looks_like):
            continue
        key_path = ("objects", label, "looks_like")
        look = config.objects.get(name)
        if look is None:
            message = f'the cell has no class "{name}"; it has: {", ".join(config.objects)}'
            yield file.make_error(key_path, "unknown-class", message)
        elif look.looks_like:
            problem = f"{name} looks like {look.looks_like}, so no detector reports {name}"
            message = f"{problem}; name another class"
            yield file.make_error(key_path, "wrong-value", message)
        elif None in (section.mass, look.mass) or _get_size(section) != _get_size(look):
            message = f"{label} looks like {name}, so both need a mass, and equal height, radius and ring"
            yield file.make_error(key_path, "wrong-value", message)


def _get_size(section: ObjectConfig) -> tuple[float, float, float]:
    return section.height, section.radius, section.ring


def _resolve_model_files(
    file: CellFile, config: CellConfig, paths: Mapping[Source, Path]
) -> tuple[CellConfig, list[Finding], list[Path]]:
    """Return the cell with absolute paths of existing models, errors about files outside, and the models.

    A path is relative to the folder of the cell file, base or arm file that contains the path.
    """
    errors = []
    models: list[Path] = []

    def resolve(path: str, *key_path: str | int) -> str:
        folder = paths.get(file.find_span(key_path).source, paths[file.source]).parent
        if path.startswith(PACKAGE_PREFIX):
            return path
        if message := describe_outside_path(folder, path):
            errors.append(file.make_error(key_path, "outside", message))
        elif path and os.path.isfile(folder / path):
            models.append(folder / path)
            return str((folder / path).resolve())
        return path

    objects = {}
    for label, model in config.objects.items():
        urdf = resolve(model.urdf, "objects", label, "urdf")
        mesh = resolve(model.mesh, "objects", label, "mesh")
        variants = tuple(
            resolve(path, "objects", label, "variants", index) for index, path in enumerate(model.variants)
        )
        objects[label] = model.model_copy(update={"urdf": urdf, "mesh": mesh, "variants": variants})
    detectors = {}
    for name, detector in config.detectors.items():
        # The options of a kind are unknown here; one of a base file may be the path of a file beside it.
        options = {}
        for key, value in detector.options.items():
            source = file.find_span(("detectors", name, key)).source
            is_in_base = source in paths and source != file.source
            if is_in_base and isinstance(value, str) and not is_outside_path(value):
                options[key] = resolve(value, "detectors", name, key)
        detectors[name] = detector.model_copy(update=options)
    meshes = []
    for index, pattern in enumerate(config.unknown.meshes):
        keys = ("unknown", "meshes", index)
        folder = paths.get(file.find_span(keys).source, paths[file.source]).parent
        names: list[str] = []
        if not is_outside_path(pattern):
            with suppress(ValueError, IndexError):  # no pattern
                files = (path for path in folder.glob(pattern) if path.suffix.lower() in MESH_SUFFIXES)
                names = sorted(str(path.relative_to(folder)) for path in files)
        meshes += [resolve(name, *keys) for name in names]
        if not names:
            message = f'there is no mesh ({", ".join(MESH_SUFFIXES)}) "{pattern}" beside the cell file'
            errors.append(file.make_error(keys, "robot", message))
    arm = config.arm.model_copy(update={"urdf": resolve(config.arm.urdf, "arm", "urdf")})
    tool = config.tool.replace_paths(lambda path, *keys: resolve(path, "tool", *keys))
    unknown = config.unknown.model_copy(update={"meshes": tuple(meshes)})
    sections = {"objects": objects, "unknown": unknown, "detectors": detectors, "arm": arm, "tool": tool}
    return config.model_copy(update=sections), errors, models


MAX_OVERLAP = 0.0005
"""Maximum overlap without an error [m], for rounding errors of bins whose outer walls touch."""


def find_overlaps(config: CellConfig) -> Iterator[tuple[KeyPath, str]]:
    """Yield keys and message for each bin that is too close to another bin, the workspace or the safe place.

    The centre of an object may be anywhere in the workspace and at the safe place, so each bin must be at
    least the radius of the largest object away from the workspace and the safe place.
    """
    radius = max(object_config.radius for object_config in config.objects.values())
    outlines = {name: _compute_outline(bin) for name, bin in config.bins.items()}
    safe_place = np.array([config.safe_place[:2], config.safe_place[:2]])
    workspace = np.array([config.table.x, config.table.y]).T
    for (name, outline), (other_name, other_outline) in combinations(outlines.items(), 2):
        if (shift := _compute_shift(outline, other_outline)) > MAX_OVERLAP:
            message = f'the bins "{name}" and "{other_name}" overlap; move one of them by {shift:.3f} m'
            yield ("bins", other_name, "position"), message
    for name, outline in outlines.items():
        rule = f'the bin "{name}" must be at least {radius:.3f} m (radius of the largest object) away from'
        if (shift := _compute_shift(outline, workspace, radius)) > MAX_OVERLAP:
            remedy = f"move the bin or the workspace by {shift:.3f} m"
            yield ("bins", name, "position"), f"{rule} the workspace (table.x, table.y); {remedy}"
        if (shift := _compute_shift(outline, safe_place, radius)) > MAX_OVERLAP:
            yield ("safe_place",), f"{rule} the safe place; move the safe place by {shift:.3f} m"


def _compute_outline(bin: BinConfig) -> Array:
    """Return the rows minimum x, y and maximum x, y of a bin with its walls, `(2, 2)` [m]."""
    centre = np.array(bin.position[:2])
    half_size = np.array(bin.size[:2]) / 2 + BIN_THICKNESS
    return np.array([centre - half_size, centre + half_size])


def _compute_shift(outline: Array, other_outline: Array, min_distance: float = 0.0) -> float:
    """Return the shift along x or y after which two outlines `(2, 2)` have the minimum distance [m], or 0."""
    # The gap along an axis is negative if the outlines overlap along this axis.
    gaps = np.maximum(outline[0] - other_outline[1], other_outline[0] - outline[1])
    is_apart = gaps.max() >= 0 and np.linalg.norm(np.maximum(gaps, 0.0)) >= min_distance
    return 0.0 if is_apart else float(min_distance - gaps.max())

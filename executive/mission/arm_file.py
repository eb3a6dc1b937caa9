"""Completion of arm files: limits from the URDF, and one value for each joint from one number."""

from __future__ import annotations

import os.path
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from executive.arms.urdf import JointChain, WrongFlange, read_chain
from executive.cell.arm_config import ArmFile, FlangeConfig, LimitsConfig
from executive.errors import InputError
from executive.geometry import Array
from executive.plugins import PACKAGE_PREFIX
from executive.text.files import describe_outside_path
from executive.text.findings import Finding, MissionError, Source, make_error, sort_findings
from executive.text.validate import KeyPath, find_span, join_keys, validate
from executive.text.yaml_files import YamlEntry, YamlMapping, YamlNode, YamlScalar, YamlSequence, parse_yaml

LIMIT_KEYS = tuple(key for key in LimitsConfig.model_fields if key != "source")
"""Keys of `limits` with one value for each joint."""
MAX_ANGLE_DEG = 360.0
"""Maximum position of a joint [degree]; a joint that turns further is limited to it."""
RANGES = {"velocity_deg": (1.0, 1000.0), "effort": (0.1, 1e5)}
"""Smallest and largest value of a joint that an arm file may contain [degree/s, Nm]; NaN is in no range."""


def complete_arm(root: YamlMapping, folder: Path) -> tuple[YamlMapping, list[Finding]]:
    """Return the tree of an arm file with the limits of its URDF, and the errors in flange and joints.

    `folder` is the folder of the arm file. A tree with invalid keys is not completed; validation reports
    these keys.
    """
    urdf = root.get("urdf")
    flange = root.get("flange")
    limits = root.get("limits")
    if not isinstance(urdf, YamlScalar) or not isinstance(limits, YamlMapping) or flange is None:
        return root, []
    is_package = urdf.text.startswith(PACKAGE_PREFIX)
    path = _resolve_urdf(urdf.text, folder)
    if not is_package and (message := describe_outside_path(folder, urdf.text)):
        return root, [make_error(urdf.span, "outside", message)]
    try:
        flange_config = FlangeConfig.model_validate(flange.python_value)
        chain = read_chain(path, flange_config)
    except ValidationError:
        return root, []
    except InputError as error:
        place = ("flange", "link") if isinstance(error, WrongFlange) else ("urdf",)
        return root, [make_error(find_span(root, place), "robot", str(error))]
    count = len(chain.joints)
    root = repeat_numbers(root, count)
    limits = root.get("limits")
    assert isinstance(limits, YamlMapping), "checked above"
    values_by_key: dict[KeyPath, YamlNode | None] = {("limits", key): limits.get(key) for key in LIMIT_KEYS}
    values_by_key["effort",] = root.get("effort")
    for keys, values in values_by_key.items():
        if isinstance(values, YamlSequence) and values.items and len(values.items) != count:
            names = f'the {count} joints up to the link "{flange_config.link}": {", ".join(chain.joints)}'
            message = (
                f"{join_keys(keys)} has {len(values.items)} values; {urdf.text} needs a value for {names}"
            )
            return root, [make_error(find_span(root, keys), "robot", message)]
    return _insert_limits(root, limits, chain, urdf)


def repeat_numbers(arm: YamlMapping, count: int) -> YamlMapping:
    """Return the tree of an arm with equal numbers where a key has one number for all joints."""
    limits = arm.get("limits")
    if isinstance(limits, YamlMapping):
        limits = _add_values(limits, {key: _repeat(limits.get(key), count) for key in LIMIT_KEYS})
    return _add_values(arm, {"limits": limits, "effort": _repeat(arm.get("effort"), count)})


def read_arm_file(source: Source, folder: Path) -> tuple[YamlMapping, ArmFile]:
    """Return tree and content of an arm file in a folder, with the limits of its URDF.

    Raises:
        MissionError: The file has errors; the exception contains every finding.
    """
    root, findings = parse_yaml(source)
    arm: ArmFile | None = None
    if isinstance(root, YamlMapping) and not findings:
        root, findings = complete_arm(root, folder)
    if root is not None and not findings:
        arm, findings = validate(root, ArmFile)
    if arm is None or not isinstance(root, YamlMapping):
        raise MissionError(sort_findings(findings, source.path))
    return root, arm


def load_arm(source: Source, folder: Path) -> ArmFile:
    """Return the content of an arm file with the path of its URDF; raise the error of `read_arm_file`."""
    _, arm = read_arm_file(source, folder)
    return arm.model_copy(update={"urdf": _resolve_urdf(arm.urdf, folder)})


def _resolve_urdf(urdf: str, folder: Path) -> str:
    """Return the absolute path of a URDF beside its arm file, otherwise its name."""
    if urdf.startswith(PACKAGE_PREFIX) or not os.path.isfile(folder / urdf):
        return urdf
    return str((folder / urdf).resolve())


def _insert_limits(
    root: YamlMapping, limits: YamlMapping, chain: JointChain, urdf: YamlScalar
) -> tuple[YamlMapping, list[Finding]]:
    """Return the tree with the limits of the URDF, and an error for limits that neither of them contains."""
    in_urdf: dict[str, Array] = {}
    if "position_deg" not in limits.entries:
        in_urdf["min_position_deg"] = np.degrees(chain.lower).clip(-MAX_ANGLE_DEG, MAX_ANGLE_DEG)
        in_urdf["position_deg"] = np.degrees(chain.upper).clip(-MAX_ANGLE_DEG, MAX_ANGLE_DEG)
    if "velocity_deg" not in limits.entries:
        in_urdf["velocity_deg"] = np.degrees(chain.velocity)
    if "effort" not in root.entries:
        in_urdf["effort"] = chain.effort
    for key, values in in_urdf.items():
        low, high = RANGES.get(key, (-MAX_ANGLE_DEG, MAX_ANGLE_DEG))
        missing = np.array(chain.joints)[~((low <= values) & (values <= high))].tolist()
        if missing:
            place = key if key == "effort" else f"limits.{key.removeprefix('min_')}"
            joints = f"{'joints' if len(missing) > 1 else 'joint'} {', '.join(missing)}"
            problem = f"the model {urdf.text} has no {place} from {low:g} to {high:g} for the {joints}"
            message = f"{problem}; write {place} in the arm file"
            return root, [make_error(urdf.span, "robot", message)]

    def make_sequence(values: Array) -> YamlNode:
        numbers = [round(value, 9) for value in values.tolist()]
        return YamlSequence(
            urdf.span, tuple(YamlScalar(urdf.span, number, str(number)) for number in numbers)
        )

    trees = {key: make_sequence(values) for key, values in in_urdf.items()}
    effort = {"effort": trees.pop("effort")} if "effort" in trees else {}
    return _add_values(root, {"limits": _add_values(limits, trees), **effort}), []


def _repeat(node: YamlNode | None, count: int) -> YamlNode | None:
    """Return a sequence of equal numbers for a number; other nodes are unchanged."""
    is_number = isinstance(node, YamlScalar) and isinstance(node.value, int | float)
    return YamlSequence(node.span, (node,) * count) if is_number and node is not None else node


def _add_values(mapping: YamlMapping, values: Mapping[str, YamlNode | None]) -> YamlMapping:
    """Return a mapping with new or replaced values; a new key is at the place of the mapping."""
    entries = dict(mapping.entries)
    for key, value in values.items():
        if value is not None:
            entry = entries.get(key)
            name = entry.key if entry else YamlScalar(mapping.span, key, key)
            entries[key] = YamlEntry(name, value)
    return replace(mapping, entries=entries)

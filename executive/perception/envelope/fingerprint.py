"""Fingerprint of a detector in its cell: all declared properties that affect its error rates."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from executive.cell.config import CameraConfig, CellConfig, DetectorConfig
from executive.perception.camera_model import compute_calibration
from executive.perception.detectors.detector_registry import find_detector_kinds

Fingerprint = Mapping[str, str]
"""Text of each property by its name; a measurement applies to all detectors with an equal fingerprint."""


def compute_fingerprint(config: CellConfig, detector: str, base: Path) -> Fingerprint:
    """Return the fingerprint of a detector in its cell.

    The fingerprint contains weights and settings of the detector, the localization method, the classes and
    their sizes, and pose, intrinsics, image size, `table_view` and depth settings of the camera. It does not
    contain bins, the number of objects, light and colours. Paths in the cell file are relative to `base`.
    """
    section = config.detectors[detector]
    options = {key: value for key, value in section.options.items() if key != "threads"}
    return {
        "detector": f"{section.kind} {json.dumps(options, sort_keys=True)}",
        "weights": _digest_weights(section, base),
        "threshold": f"{section.threshold:g}",
        "localization": config.localization,
        **{
            f"class {label}": f"{kind.height * 1000:.1f} mm high, radius {kind.radius * 1000:.1f} mm"
            for label, kind in config.objects.items()
        },
        **_describe_camera(next(iter(config.cameras.values())), config),
    }


def list_changed_properties(measured: Fingerprint, current: Fingerprint) -> str:
    """Return the names of the properties that differ between two fingerprints; "" if none."""
    return ", ".join(
        name for name in dict.fromkeys([*measured, *current]) if measured.get(name) != current.get(name)
    )


def _digest_weights(section: DetectorConfig, base: Path) -> str:
    """Return a digest of the model file of a detector; "" for a detector without a model file."""
    find_weights = getattr(find_detector_kinds()[section.kind].load(), "weights", None)
    path = find_weights(section, base) if find_weights else None
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path and path.is_file() else ""


def _describe_camera(camera: CameraConfig, config: CellConfig) -> dict[str, str]:
    """Return the properties of a camera that affect error rates."""
    matrix, X_MC = compute_calibration(camera)
    poses = (
        {name: config.arm.poses_deg[name] for name in camera.scan_poses} if camera.mount == "wrist" else {}
    )
    return {
        "camera pose": f"{camera.mount} {X_MC.to_rounded_list(4)} {json.dumps(poses)}",
        "camera lens": f"{matrix.round(2).tolist()}",
        "camera image": f"{camera.width} x {camera.height}, searched {list(camera.table_view)}",
        "camera depth": "" if camera.depth is None else camera.depth.model_dump_json(),
    }

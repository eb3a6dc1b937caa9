"""Command `arm`: what the URDF or the arm file of an arm means in a cell."""

from __future__ import annotations

import math
import os.path
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli import shared
from executive.errors import ExitCode, InputError, explain_os_errors

if TYPE_CHECKING:
    from executive.cell.arm_config import ArmFile
    from executive.station.arm_report import ArmReport

DEFAULT_CELL = "overhead"
"""Shipped cell in which an arm is examined if the command names none."""

LINE_WIDTH = 100
"""Maximum length of a line [characters]."""


@click.command(name="arm")
@click.argument("file", metavar="FILE")
@click.option("--flange", default="", help="Link of the URDF at the flange; by default, one is proposed.")
@click.option("--cell", default=DEFAULT_CELL, help="Cell file or shipped cell with table, bins and tool.")
@click.option(
    "--base", type=(float,) * 3, default=(0.0,) * 3, metavar="X Y Z", help="Position of the base [m]."
)
@click.option("--write", "target", type=shared.FILE, help="Arm file to write, beside the URDF or above it.")
@click.option("--picture", type=shared.FILE, help="File (.png) for a picture of the reach, from above.")
@shared.json_option
def arm_command(
    file: str,
    flange: str,
    cell: str,
    base: tuple[float, float, float],
    target: Path | None,
    picture: Path | None,
    as_json: bool,
) -> ExitCode:
    """Examine an arm.

    FILE is a URDF, or an arm file (.yaml) or its shipped name. Prints joints, limits, solver, reach, links
    that can collide with each other, and proposed poses. Exit code 2 if the executive cannot move the arm.
    """
    with shared.keep_stdout_clean():
        from executive.cell.arm_config import BaseConfig
        from executive.cell.device_config import MAX_LENGTH
        from executive.mission.cell_file import load_cell
        from executive.station.arm_report import draw_reach, place_arm, report_arm
        from executive.text.files import find_cell

        if picture is not None and picture.suffix.lower() != ".png":
            raise InputError(f"{picture} is no name of a PNG file; name a file that ends with .png")
        if not all(abs(coordinate) <= MAX_LENGTH for coordinate in base):  # NaN is in no range.
            limits = f"write three numbers from {-MAX_LENGTH:g} to {MAX_LENGTH:g} m"
            raise InputError(f"--base {' '.join(map(str, base))} is no position of an arm; {limits}")
        arm, text = read_arm(file, flange, target)
        cell_config = load_cell(find_cell(cell))
        report = report_arm(place_arm(cell_config, arm, BaseConfig(position=base)))
        if target is not None:
            with explain_os_errors(InputError, f"{target} cannot be written", "name a writable file"):
                target.write_text(text, encoding="utf-8")
        if picture is not None:
            from PIL import Image

            with explain_os_errors(InputError, f"{picture} cannot be written", "name a writable file"):
                Image.fromarray(draw_reach(report)).save(picture, format="PNG")
    shared.print_result(_make_value(report), "\n".join(_list_lines(report)), as_json=as_json)
    return ExitCode.INVALID_INPUT if report.problems else ExitCode.SUCCESS


def read_arm(file: str, flange: str = "", target: Path | None = None) -> tuple[ArmFile, str]:
    """Return an arm, and the text of its arm file, which names a URDF relative to the folder of `target`.

    Raises:
        InputError: The file does not exist, or describes no arm that the executive can move.
    """
    from executive.arms.urdf import find_model
    from executive.mission.arm_file import load_arm
    from executive.plugins import PACKAGE_PREFIX
    from executive.station.arm_report import propose_arm
    from executive.text.files import get_shipped_folder, read_source
    from executive.text.findings import MissionError, Source

    shipped = get_shipped_folder() / "arms" / f"{file}.yaml"
    path = shipped if shipped.is_file() and not os.path.exists(file) else Path(file)
    if path.suffix in (".yaml", ".yml"):
        if flange or target:
            advice = "copy the file, or change flange.link in it"
            raise InputError(f"{file} is an arm file, but --flange and --write are for a URDF; {advice}")
        source = read_source(path)
        return load_arm(source, path.parent), source.text
    is_file = path.is_file() and not file.startswith(PACKAGE_PREFIX)
    urdf = str(path.resolve()) if is_file else file
    name = "".join(c if c.isalnum() else "_" for c in find_model(urdf).stem.lower())
    content = propose_arm(urdf, name, flange)

    try:
        source = Source(file, dump_yaml({**content, "urdf": path.name if is_file else file}))
        arm = load_arm(source, path.parent)
    except MissionError as error:  # The lines of the findings are in no file.
        raise InputError("\n".join(f"{file}: {each.message}" for each in error.findings)) from None
    if target is not None and target.suffix not in (".yaml", ".yml"):
        raise InputError(f"{target} is no name of an arm file; name a file that ends with .yaml")
    if target is not None and target.exists():
        raise InputError(f"{target} exists; name a new file, or delete it first")
    if target is None or not is_file:
        return arm, dump_yaml({**content, "urdf": file})
    relative_path = os.path.relpath(urdf, target.resolve().parent)
    if relative_path.startswith(".."):
        advice = "write the arm file into the folder of the URDF, or a folder above it"
        raise InputError(f"{target} would name a model outside of its folder, {urdf}; {advice}")
    return arm, dump_yaml({**content, "urdf": relative_path})


def dump_yaml(content: Mapping[str, Any]) -> str:
    """Return YAML with lists of numbers in one line."""
    import yaml

    text = yaml.safe_dump(
        dict(content), sort_keys=False, allow_unicode=True, width=100, default_flow_style=None
    )
    return str(text)


def _make_value(report: ArmReport) -> dict[str, Any]:
    """Return the report as a JSON value."""
    arm = report.config.arm
    limits = arm.limits
    rows = zip(report.chain.joints, limits.position_ranges_deg, limits.velocity_deg, arm.effort, strict=True)
    return {
        "arm": arm.arm,
        "urdf": arm.urdf,
        "flange": arm.flange.model_dump(mode="json"),
        "joints": [
            {"name": name, "position_deg": list(positions), "velocity_deg": velocity, "effort": effort}
            for name, positions, velocity, effort in rows
        ],
        "left_out": list(report.chain.left_out),
        "solver": report.solver,
        "reach": report.reach.fractions,
        "best_base": report.reach.best_base.model_dump(mode="json"),
        "reach_from_best_base": report.reach.best_fractions,
        "self_collision_pairs": [list(pair) for pair in report.pairs],
        "poses_deg": report.poses_deg,
        "problems": list(report.problems),
    }


def _list_lines(report: ArmReport) -> list[str]:
    """Return the report as lines of text."""
    value = _make_value(report)
    lines = [f"arm {value['arm']}, flange {value['flange']['link']}, {len(value['joints'])} joints"]
    for number, joint in enumerate(value["joints"], start=1):
        lower, upper = joint["position_deg"]
        turns = "  (may turn all round)" if upper - lower >= math.degrees(math.tau) else ""
        lines.append(
            f"  {number}  {joint['name']:28} {lower:7.1f} to {upper:6.1f} degrees  "
            f"{joint['velocity_deg']:6.1f} degrees/s  {joint['effort']:6.1f} Nm{turns}"
        )
    if value["left_out"]:
        lines.append(f"left out (beyond the flange, or with other joints): {', '.join(value['left_out'])}")
    lines.append(f"solver: {value['solver']}")
    reach = ", ".join(f"{name} {fraction:.0%}" for name, fraction in value["reach"].items())
    text = f"reach from {list(report.config.arm.base.position)}: {reach}"
    lines += textwrap.wrap(text, LINE_WIDTH, subsequent_indent="  ")
    if min(value["reach"].values()) < 1:
        lines.append(f"  {report.reach.advise()}")
    pairs = ", ".join(f"{a} - {b}" for a, b in value["self_collision_pairs"])
    text = f"{len(value['self_collision_pairs'])} pairs of links can collide: {pairs}"
    lines += textwrap.wrap(text, LINE_WIDTH, subsequent_indent="  ")
    lines += [f"proposed pose {name}: {pose}" for name, pose in value["poses_deg"].items()]
    return [*lines, *(f"problem: {problem}" for problem in value["problems"])]

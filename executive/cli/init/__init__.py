"""`executive init`: create a project with a mission, a cell and a skill."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click


@click.command(name="init")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--name", help="Name of the Python package; by default derived from the name of DIR.")
def command(folder: Path, name: str | None) -> None:
    """Create a project with a mission, a cell and a skill.

    The mission can be run at once, and the skill has tests. The folder DIR must be empty or must not exist.
    The project need not be installed: commands that are run in DIR find its skills.
    """
    from executive.cli.init.project import MISSION_FILE, check_package_name, make_package_name, write_project

    package = make_package_name(folder) if name is None else check_package_name(name, f'--name "{name}"')
    files = write_project(folder, package)
    click.echo(f"{folder}: {', '.join(files)}")
    # `uv run executive init` activates the virtual environment only for this command.
    click.echo(f"Type, after `. {shlex.quote(str(Path(sys.prefix) / 'bin' / 'activate'))}`:")
    change_folder = "" if folder.resolve() == Path.cwd() else f"cd {shlex.quote(str(folder))} && "
    click.echo(f"  {change_folder}executive run {MISSION_FILE}")
    click.echo("  pytest")

"""`executive init`: create a project with a mission, a cell and a skill."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click


@click.command(name="init")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--name", help="Name of the package; by default made from the name of DIR.")
def command(folder: Path, name: str | None) -> None:
    """Create a working mission in DIR, with its cell, and a skill with tests.

    DIR must be empty, or not exist. The project need not be installed: in DIR, commands find its skill.
    """
    from executive.cli.init.project import MISSION, package_name, require_free, write_project

    package = package_name(folder) if name is None else require_free(name, f'--name "{name}"')
    written = write_project(folder, package)
    click.echo(f"{folder}: {', '.join(written)}")
    # The environment may not be active in the user's shell: `uv run` activates it only for its command.
    click.echo(f"Type, after `. {shlex.quote(str(Path(sys.prefix) / 'bin' / 'activate'))}`:")
    change_folder = "" if folder.resolve() == Path.cwd() else f"cd {shlex.quote(str(folder))} && "
    click.echo(f"  {change_folder}executive run {MISSION}")
    click.echo("  pytest")

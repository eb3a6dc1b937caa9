"""`executive init`: begin a project of one's own."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click


@click.command(name="init")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--name", help="What the package is called; without it, as DIR is.")
def command(folder: Path, name: str | None) -> None:
    """Fill DIR with a mission, its cell, and a skill with its tests, all working.

    DIR must be empty, or not be there yet. Nothing needs to be installed: below DIR the skill is found.
    """
    from executive.cli.init.project import MISSION, package_name, require_free, write_project

    package = package_name(folder) if name is None else require_free(name, f'--name "{name}"')
    written = write_project(folder, package)
    click.echo(f"{folder}: {', '.join(written)}")
    # The shell that called this need not know what is installed here: `uv run` sees to that by itself.
    click.echo(f"Type, after `. {shlex.quote(str(Path(sys.prefix) / 'bin' / 'activate'))}`:")
    there = "" if folder.resolve() == Path.cwd() else f"cd {shlex.quote(str(folder))} && "
    click.echo(f"  {there}executive run {MISSION}")
    click.echo("  pytest")

"""`executive schema`: what an editor needs to complete mission files and to mark mistakes in them."""

from __future__ import annotations

import click

from executive.cli.output import print_json, stdout_kept_clean


@click.command(name="schema")
@click.option("--cell", "file", flag_value="cell", help="The schema of cell files.")
@click.option("--library", "file", flag_value="library", help="The schema of library files.")
def command(file: str | None) -> None:
    """Print the JSON Schema of mission files, with the skills that are installed.

    A file that begins with `# yaml-language-server: $schema=mission.schema.json` names the schema beside
    it to every editor with the YAML language server.
    """
    with stdout_kept_clean():
        from executive.mission.schema.files import library_schema, mission_schema
        from executive.mission.schema.types import cell_schema
        from executive.skill import discover

        if file == "cell":
            schema = cell_schema()
        else:
            schema = (library_schema if file == "library" else mission_schema)(discover())
    print_json(schema)

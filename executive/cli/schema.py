"""`executive schema`: print the JSON Schemas with which editors complete and check mission files."""

from __future__ import annotations

import click

from executive.cli.streams import print_json, stdout_kept_clean


@click.command(name="schema")
@click.option("--cell", is_flag=True, help="Print the schema of cell files.")
@click.option("--library", is_flag=True, help="Print the schema of library files.")
@click.option("--journal", is_flag=True, help="Print the schema of the lines of a journal.")
def command(cell: bool, library: bool, journal: bool) -> None:
    """Print the JSON Schema of mission files, including the installed skills.

    A file that begins with `# yaml-language-server: $schema=mission.schema.json` names the schema beside it
    to every editor with the YAML language server.
    """
    if cell + library + journal > 1:
        raise click.UsageError("--cell, --library and --journal exclude each other; give one of them")
    with stdout_kept_clean():
        from executive.mission.schema.files import make_library_schema, make_mission_schema
        from executive.mission.schema.types import make_cell_schema
        from executive.plugins import discover
        from executive.record.journal_format import make_journal_schema
        from executive.tree.registry import load_control_nodes

        if cell or journal:
            schema = make_cell_schema() if cell else make_journal_schema()
        else:
            schema = (make_library_schema if library else make_mission_schema)(
                discover(), load_control_nodes()
            )
    print_json(schema)

"""`executive schema`: print JSON Schemas, with which editors complete and check mission files."""

from __future__ import annotations

import click

from executive.cli.streams import keep_stdout_clean, print_json


@click.command(name="schema")
@click.option("--cell", is_flag=True, help="Print the schema of cell files instead.")
@click.option("--library", is_flag=True, help="Print the schema of library files instead.")
@click.option("--journal", is_flag=True, help="Print the schema of the lines of a journal instead.")
def command(cell: bool, library: bool, journal: bool) -> None:
    """Print the JSON Schema of mission files.

    The schema includes the installed skills. Save it as mission.schema.json beside the missions: an editor
    with the YAML language server uses it in files that begin with
    `# yaml-language-server: $schema=mission.schema.json`.
    """
    if cell + library + journal > 1:
        raise click.UsageError("--cell, --library and --journal exclude each other; give one of them")
    with keep_stdout_clean():
        from executive.mission.schema import make_cell_schema, make_library_schema, make_mission_schema
        from executive.plugins import load_skills
        from executive.record.journal_format import make_journal_schema
        from executive.tree.node import load_control_nodes

        if cell:
            schema = make_cell_schema()
        elif journal:
            schema = make_journal_schema()
        else:
            make_schema = make_library_schema if library else make_mission_schema
            schema = make_schema(load_skills(), load_control_nodes())
    print_json(schema)

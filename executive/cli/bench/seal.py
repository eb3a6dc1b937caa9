"""`executive bench seal`: how cups of several sizes would seal."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.output import stdout_kept_clean


@click.command(name="seal")
@click.argument("cell", default="overhead")
@click.option(
    "--out", type=click.Path(path_type=Path, dir_okay=False), default=Path("seal_map.csv"), show_default=True,
    help="File to write.",
)  # fmt: skip
def seal(cell: str, out: Path) -> None:
    """Measure how suction cups of several sizes would seal on the objects of CELL, off-centre by how much."""
    with stdout_kept_clean():
        from executive.cli.cells import load_cells
        from executive.errors import InputError
        from executive.sim.seal_map import measure_map, write_map

        (config,) = load_cells((cell,)).values()
        rows = measure_map(config)
        try:
            write_map(rows, out)
        except OSError as error:
            raise InputError(f'cannot write "{out}": {(error.strerror or "").lower()}') from error
        click.echo(f"{len(rows)} rows in {out}", err=True)

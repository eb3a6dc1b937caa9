"""`executive film`: make a film of a recorded run, with robot and tree side by side."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import FILE, json_option, runs_option, workers_option
from executive.cli.streams import print_json, stdout_kept_clean


@click.command(name="film")
@click.argument("run", metavar="RUN")
@click.option(
    "-o", "--output", type=FILE, metavar="FILE",
    help="File to write, .mp4 or .gif; by default film.mp4 in the run directory.",
)  # fmt: skip
@click.option("--gif", is_flag=True, help="Make an animated GIF, for instance for a README.")
@click.option(
    "--speed", type=click.FloatRange(0.1, 100),
    help="Seconds on the robot's clock per second of the film; by default 1, for a GIF 2.",
)  # fmt: skip
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--quiet", is_flag=True, help="Do not show the progress.")
@workers_option
@runs_option
@json_option
def command(
    run: str, output: Path | None, gif: bool, speed: float | None, force: bool, quiet: bool, workers: int,
    runs: Path, as_json: bool,
) -> None:  # fmt: skip
    """Make a film of RUN (a run directory, or `latest`): the robot, and beside it the tree and every item.

    The world is rebuilt from the run's world.log and rendered again, so this works for every run on a
    simulated cell, also one that was halted, interrupted or resumed. Needs no display.
    """
    with stdout_kept_clean():
        from executive.cli.progress import bar
        from executive.record.run_directory import RunDirectory, find_run
        from executive.view.film.film import END_DURATION, write_film
        from executive.view.film.formats import choose_format, prepare_file
        from executive.view.film.source import FilmSource

        directory = RunDirectory(find_run(run, runs))
        format = choose_format(output, gif)
        file = output or directory.path / f"film{format.suffix}"
        source = FilmSource(directory)
        speed = speed or format.speed
        with prepare_file(file, force=force) as partial_file:
            if not quiet:
                seconds = source.events[-1].clock / speed + END_DURATION
                click.echo(f"making a film of about {seconds:.0f} s", err=True)
            with bar("frames", quiet=quiet, print_lines=True) as progress:
                frames = write_film(
                    source, partial_file, format, speed=speed, workers=workers, progress=progress
                )
        seconds, size = frames / format.frame_rate, file.stat().st_size
        result = {"file": str(file), "frames": frames, "seconds": seconds, "size": size}
        click.echo(f"{file}: {seconds:.1f} s, {size / 1e6:.1f} MB", err=True)
    if as_json:
        print_json(result)

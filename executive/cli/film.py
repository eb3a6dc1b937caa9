"""`executive film`: make a film of a recorded run, with the robot and the tree side by side."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli.options import FILE, json_option, runs_option, workers_option
from executive.cli.streams import keep_stdout_clean, print_json


@click.command(name="film")
@click.argument("run", metavar="RUN")
@click.option("-o", "--output", type=FILE, help="File (.mp4 or .gif) to write; by default film.mp4 in RUN.")
@click.option("--gif", is_flag=True, help="Make an animated GIF, for example for a README.")
@click.option(
    "--speed", type=click.FloatRange(0.1, 100),
    help="Simulated seconds per second of the film; by default 1, or 2 for a GIF.",
)  # fmt: skip
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option("--quiet", is_flag=True, help="Do not print the progress.")
@workers_option
@runs_option
@json_option
def command(
    run: str, output: Path | None, gif: bool, speed: float | None, force: bool, quiet: bool, workers: int,
    runs_folder: Path, as_json: bool,
) -> None:  # fmt: skip
    """Make a film of a recorded run.

    RUN is a run directory or `latest`. The film shows the robot, the tree and all items. The world is
    reconstructed from world.log in the run directory and rendered again. Therefore every run on a simulated
    cell can be filmed, including halted, interrupted and resumed runs. No display is needed.
    """
    with keep_stdout_clean():
        from executive.cli.progress import show_progress
        from executive.record.run_directory import RunDirectory, find_run
        from executive.view.film.film import RESULT_DISPLAY_TIME, write_film
        from executive.view.film.formats import choose_format, prepare_file
        from executive.view.film.run_state import FilmSource

        directory = RunDirectory(find_run(run, runs_folder))
        film_format = choose_format(output, gif)
        film_file = output or directory.path / f"film{film_format.suffix}"
        source = FilmSource(directory)
        speed = speed or film_format.default_speed
        with prepare_file(film_file, force=force) as partial_file:
            if not quiet:
                seconds = source.events[-1].clock / speed + RESULT_DISPLAY_TIME
                click.echo(f"making a film of about {seconds:.0f} s", err=True)
            with show_progress("frames", quiet=quiet, print_lines=True) as progress:
                frame_count = write_film(source, partial_file, film_format, speed, workers, progress)
        seconds, size = frame_count / film_format.frame_rate, film_file.stat().st_size
        click.echo(f"{film_file}: {seconds:.1f} s, {size / 1e6:.1f} MB", err=True)
    if as_json:
        print_json({"file": str(film_file), "frames": frame_count, "seconds": seconds, "size": size})

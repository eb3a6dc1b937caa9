"""`executive sweep`: run a mission for many seeds, and summarize the results."""

from __future__ import annotations

import functools
import re
from contextlib import closing
from pathlib import Path

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.exit_codes import ExitCode


def parse_seed_range(text: str) -> range:
    """Return the seeds for `A:B` (without B), `A-B` (with B), or `A`."""
    match = re.fullmatch(r"(\d{1,10})(?:([-:])(\d{1,10}))?", text)
    if match is None:
        raise click.BadParameter(f'"{text}" is not a range of seeds, for example 0:100 or 0-99')
    first, last = int(match[1]), int(match[3] or match[1]) - (match[2] == ":")
    if last < first:
        end = f"the end {match[3]} is excluded" if match[2] == ":" else f"{last} is less than {first}"
        raise click.BadParameter(f'"{text}" contains no seed: {end}')
    if last > options.MAX_SEED:
        raise click.BadParameter(f'seed {last} in "{text}" is too large; the maximum is {options.MAX_SEED}')
    return range(first, last + 1)


@click.command(name="sweep")
@click.argument("mission", metavar="MISSION", required=False)
@click.option(
    "--seeds", type=parse_seed_range, metavar="A:B",
    help="Seeds from A to B; A:B excludes B, A-B includes B.",
)  # fmt: skip
@options.variations_option
@click.option(
    "--resume", type=options.PATH, metavar="SWEEP",
    help="Execute the missing runs of an interrupted sweep, given by its folder or its file results.sqlite.",
)  # fmt: skip
@options.workers_option
@options.cluster_option
@click.option("--frames", is_flag=True, help="Save the camera images on which decisions are based.")
@options.overrides_option
@options.scene_option
@options.runs_option
@click.option(
    "--require", metavar="EXPR",
    help='Exit with code 1 if the runs do not meet EXPR: "success>=0.99 and p95(robot_time_s)<20".',
)  # fmt: skip
@click.option("--junit", type=options.FILE, help="Write a report in the JUnit XML format to this file.")
@click.option("--export", type=options.FOLDER, help="Write the tables of runs, items and phases as Parquet.")
@options.json_option
@click.pass_context
def command(
    ctx: click.Context, mission: str | None, seeds: range | None, variations: dict[str, tuple[str, ...]],
    resume: Path | None, workers: int, cluster: str | None, frames: bool, overrides: dict[str, str],
    scene: Path | None, runs: Path, require: str | None, junit: Path | None, export: Path | None,
    as_json: bool,
) -> int:  # fmt: skip
    """Run a mission once for every seed and variant, and summarize the runs.

    MISSION is a file or the name of a shipped mission. A new folder below --runs contains results.sqlite, the
    page, and the run directories. A run gets a report if it did not succeed or if the audit disagrees;
    `executive report` writes the report of another run. Exit code 1 if --require is not met. Ctrl-C halts the
    current runs; then the results of the complete runs are printed. A second Ctrl-C quits immediately.
    """
    names = ("mission", "seeds", "variations", "frames", "overrides", "scene")
    sources = map(ctx.get_parameter_source, names)
    has_settings = any(source is not click.core.ParameterSource.DEFAULT for source in sources)
    repeated_keys = ", ".join(variations.keys() & overrides.keys())
    options.check_usage(
        (
            resume is None and (mission is None or seeds is None),
            "give a MISSION and --seeds, or --resume SWEEP",
        ),
        (
            resume is not None and has_settings,
            "--resume takes mission, seeds and settings from the sweep; omit them",
        ),
        (repeated_keys, f"--set and --vary both give {repeated_keys}; omit one of them"),
    )
    with keep_stdout_clean():
        from executive.campaign.results.export import check_exporter, export_tables
        from executive.campaign.results.junit import write_junit
        from executive.campaign.results.requirement import describe_unmet, parse_requirement
        from executive.campaign.results.results_page import SweepResults, write_page
        from executive.campaign.results.sweep_folder import create_sweep, open_sweep
        from executive.campaign.results.sweep_summary import summarize_runs
        from executive.campaign.sweep import list_jobs, make_repeat_command, run_sweep
        from executive.cell.json_values import to_json
        from executive.cli.progress import print_halt, show_progress
        from executive.cli.sweep_tables import print_summary

        comparisons = parse_requirement(require) if require else ()
        if export is not None:
            check_exporter()
        if resume is not None:
            database = open_sweep(resume)
        else:
            assert mission is not None and seeds is not None
            database = create_sweep(mission, seeds, overrides, variations, scene, frames, runs)
        with closing(database):
            settings, folder = database.settings, database.path.parent
            click.echo(f"results: {database.path}", err=True)
            jobs = list_jobs(settings, folder)
            stored = {run.job for run in database.read_runs()}
            missing = [job for job in jobs if job.index not in stored]
            with show_progress(settings.mission, print_lines=True) as progress:
                run_sweep(
                    missing, database, workers=workers, cluster=cluster, progress=progress, on_halt=print_halt
                )
            rows = database.read_runs()
            make_command = functools.partial(make_repeat_command, settings)
            summaries = summarize_runs(rows, database.read_phases(), make_command)
            print_summary(summaries, len(jobs))
            side = SweepResults("", settings, rows, database.read_items(), summaries, len(rows) < len(jobs))
            page = write_page(folder, [side])
            click.echo(f"page: {page}", err=True)
            if junit is not None:
                write_junit(junit, settings.mission_name, rows, make_command)
            if export is not None:
                export_tables(database, export)
        unmet = describe_unmet(comparisons, rows, summaries)
        for message in unmet:
            click.echo(message, err=True)
    if as_json:
        print_json(to_json({
            "settings": settings, "results": str(database.path), "page": str(page),
            "asked": len(jobs), "cut_off": len(rows) < len(jobs), "variants": summaries, "unmet": unmet,
            "runs": rows,
        }))  # fmt: skip
    return ExitCode.HALTED if len(rows) < len(jobs) else ExitCode(int(bool(unmet)))

"""`executive sweep`: run a mission for many seeds, and summarize the results."""

from __future__ import annotations

import functools
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.exit_codes import ExitCode

if TYPE_CHECKING:
    from executive.campaign.results.database import ResultsDatabase
    from executive.campaign.results.sweep_summary import SweepResults


@click.command(name="sweep")
@click.argument("mission", metavar="MISSION", required=False)
@options.variations_option
@click.option(
    "--resume", type=options.PATH, metavar="SWEEP",
    help="Execute the missing runs of an interrupted sweep, given by its folder or its file results.sqlite.",
)  # fmt: skip
@options.add_sweep_options
@click.option(
    "--require", metavar="EXPR",
    help='Exit with code 1 if the runs do not meet EXPR: "success>=0.99 and p95(robot_time_s)<20".',
)  # fmt: skip
@click.option("--junit", type=options.FILE, help="Write a report in the JUnit XML format to this file.")
@click.option("--export", type=options.FOLDER, help="Write the tables of runs, items and phases as Parquet.")
@click.pass_context
def command(
    ctx: click.Context, mission: str | None, seeds: range | None, variations: dict[str, tuple[str, ...]],
    resume: Path | None, workers: int, cluster: str | None, frames: bool, overrides: dict[str, str],
    scene: Path | None, runs: Path, require: str | None, junit: Path | None, export: Path | None,
    as_json: bool,
) -> int:  # fmt: skip
    """Run a mission once for every seed and variant, and summarize the runs.

    MISSION is a file or the name of a shipped mission. A new folder below --runs contains results.sqlite, the
    page results.html, and the run directories. A run gets a report if it did not succeed or if the audit
    disagrees; `executive report` writes the report of another run. Exit code 1 if --require is not met.
    Ctrl-C ends the current runs; then the results of the complete runs are printed. A second Ctrl-C quits
    immediately.
    """
    options.check_resume(
        ctx, has_runs=None not in (mission, seeds), runs_text="a MISSION and --seeds, or --resume SWEEP",
        settings_text="mission, seeds and settings from the sweep",
    )  # fmt: skip
    options.check_distinct("--set and --vary", overrides, variations)
    with keep_stdout_clean():
        from executive.campaign.results.export import check_exporter, export_tables
        from executive.campaign.results.junit import write_junit
        from executive.campaign.results.requirement import describe_unmet_conditions, parse_requirement
        from executive.campaign.results.results_page import write_page
        from executive.campaign.results.sweep_folder import create_sweep, make_settings, open_sweep
        from executive.campaign.sweep import make_repeat_command
        from executive.cell.json_values import to_json
        from executive.cli.progress import print_report
        from executive.cli.sweep_tables import list_summary

        conditions = parse_requirement(require) if require else ()
        if export is not None:
            check_exporter()
        if resume is not None:
            database = open_sweep(resume)
        else:
            assert mission is not None and seeds is not None
            database = create_sweep(make_settings(mission, seeds, overrides, variations, scene, frames), runs)
        with closing(database):
            click.echo(f"results: {database.path}", err=True)
            results = execute_missing_runs(database, "", workers, cluster)
            print_report(list_summary(results.summaries, results.planned_run_count))
            page = write_page(database.path.parent, [results])
            click.echo(f"page: {page}", err=True)
            if junit is not None:
                make_command = functools.partial(make_repeat_command, results.settings)
                write_junit(junit, results.settings.mission_name, results.runs, make_command)
            if export is not None:
                export_tables(database, export)
        unmet = describe_unmet_conditions(conditions, results.runs, results.summaries)
        for message in unmet:
            click.echo(message, err=True)
    if as_json:
        print_json(to_json({
            "settings": results.settings, "results": str(database.path), "page": str(page),
            "asked": results.planned_run_count, "cut_off": results.is_incomplete,
            "variants": results.summaries, "unmet": unmet, "runs": results.runs,
        }))  # fmt: skip
    return ExitCode.HALTED if results.is_incomplete else ExitCode(int(bool(unmet)))


def execute_missing_runs(
    database: ResultsDatabase, name: str, workers: int, cluster: str | None, *, is_halted: bool = False
) -> SweepResults:
    """Execute the missing runs of a sweep, and return the results of all its runs.

    Args:
        database: Database of the sweep.
        name: `A` or `B` in a comparison, else "".
        workers: Number of worker processes.
        cluster: Address of a dask scheduler, whose workers execute the runs, or None.
        is_halted: True after a halt of the comparison; no run is executed.
    """
    from executive.campaign.pool import JobOptions
    from executive.campaign.results.sweep_summary import SweepResults, summarize_runs
    from executive.campaign.results.tables import ITEMS, PHASES, RUNS
    from executive.campaign.sweep import list_jobs, make_repeat_command, run_sweep
    from executive.cli.progress import print_cancellation, print_halt, show_progress

    settings = database.settings
    jobs = list_jobs(settings, database.path.parent)
    stored = {run.job for run in database.read(RUNS)}
    missing = [job for job in jobs if job.index not in stored]
    if not is_halted:
        title = f"{name}: {settings.mission}" if name else settings.mission
        with show_progress(title, print_lines=True) as progress:
            on_halt = print_halt if cluster is None else print_cancellation
            run_sweep(missing, database, JobOptions(workers, progress, on_halt), cluster)
    runs, make_command = database.read(RUNS), functools.partial(make_repeat_command, settings)
    summaries = summarize_runs(runs, database.read(PHASES), make_command)
    return SweepResults(name, settings, runs, database.read(ITEMS), summaries, len(jobs))

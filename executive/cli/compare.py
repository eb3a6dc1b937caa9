"""`executive compare`: run two missions with the same seeds, and estimate the differences."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.cli.sweep import execute_missing_runs
from executive.errors import ExitCode


@click.command(name="compare")
@click.argument("missions", metavar="A [B]", nargs=-1)
@options.make_overrides_option("--set-a", "overrides_a", help="Like --set, but only for A; repeatable.")
@options.make_overrides_option("--set-b", "overrides_b", help="Like --set, but only for B; repeatable.")
@click.option(
    "--resume", type=options.FOLDER, metavar="FOLDER",
    help="Execute the missing runs of the interrupted comparison in this folder.",
)  # fmt: skip
@options.add_sweep_options
@click.pass_context
def command(
    ctx: click.Context, missions: tuple[str, ...], seeds: range | None, overrides_a: dict[str, str],
    overrides_b: dict[str, str], resume: Path | None, workers: int, cluster: str | None, save_images: bool,
    overrides: dict[str, str], scene: Path | None, runs_folder: Path, as_json: bool,
) -> int:  # fmt: skip
    """Run the missions A and B once for every seed, and estimate the differences.

    A and B are files or names of shipped missions. A single mission is used as A and as
    B, and --set-a and --set-b state the difference. The results of both are stored in a/results.sqlite and
    b/results.sqlite in a folder below --runs. Each difference has a 95 % confidence interval.
    Ctrl-C ends the current runs; then the results of the complete pairs are printed.
    """
    options.check_resume(
        ctx, has_missions_and_seeds=len(missions) in (1, 2) and seeds is not None,
        required_arguments="one or two missions and --seeds, or --resume FOLDER",
        resumed_settings_text="missions, seeds and settings from the comparison",
    )  # fmt: skip
    options.check_disjoint(overrides, "--set-a or --set-b", {**overrides_a, **overrides_b})
    with keep_stdout_clean():
        from executive.campaign.results_page import write_missing_reports, write_page
        from executive.campaign.sweep import create_comparison, make_settings, open_comparison, read_results
        from executive.campaign.sweep_summary import SweepResults, compute_differences, pair_runs
        from executive.cell.json_values import to_json
        from executive.cli.progress import print_report
        from executive.cli.sweep_tables import render_differences

        if resume is not None:
            databases = open_comparison(resume)
        else:
            assert seeds is not None
            settings = [
                make_settings(mission, seeds, {**overrides, **own_overrides}, {}, scene, save_images)
                for mission, own_overrides in ((missions[0], overrides_a), (missions[-1], overrides_b))
            ]
            databases = create_comparison(settings, runs_folder)
        sweeps: list[SweepResults] = []
        for side, database in zip("AB", databases, strict=True):
            with closing(database):
                if not any(sweep.is_incomplete for sweep in sweeps):
                    execute_missing_runs(database, workers, cluster, side)
                sweeps.append(read_results(database, side))
        pairs = pair_runs(sweeps[0].runs, sweeps[1].runs)
        differences, changed_pairs = compute_differences(pairs), [pair for pair in pairs if pair.is_changed]
        write_missing_reports(changed_pairs)
        page = write_page(databases[0].path.parents[1], sweeps, differences, changed_pairs)
        print_report(render_differences(differences, changed_pairs, len(pairs)))
        click.echo(f"page: {page}", err=True)
    if as_json:
        print_json(to_json({
            "settings": [sweep.settings for sweep in sweeps],
            "results": [str(database.path) for database in databases], "page": str(page),
            "pair_count": len(pairs), "differences": differences, "changed_pairs": changed_pairs,
            "summaries": [summary for sweep in sweeps for summary in sweep.summaries],
        }))  # fmt: skip
    return ExitCode.HALTED if any(sweep.is_incomplete for sweep in sweeps) else ExitCode.SUCCESS

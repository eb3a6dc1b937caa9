"""`executive sweep`: run a mission for many seeds, and summarize the results."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.exit_codes import ExitCode


def parse_seed_range(text: str) -> range:
    """Return the seeds from A to B (inclusive) for the text `A-B`, or the seed A for the text `A`."""
    match = re.fullmatch(r"(\d{1,10})(?:-(\d{1,10}))?", text)
    if match is None:
        raise click.BadParameter(f'"{text}" is not a range of seeds, for example 0-99')
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise click.BadParameter(f'"{text}" contains no seed: {last} is less than {first}')
    if last > options.MAX_SEED:
        raise click.BadParameter(f'seed {last} in "{text}" is too large; the maximum is {options.MAX_SEED}')
    return range(first, last + 1)


@click.command(name="sweep")
@options.mission_argument
@click.option("--seeds", type=parse_seed_range, metavar="A-B", required=True, help="First and last seed.")
@options.workers_option
@click.option("--frames", is_flag=True, help="Save the camera images on which decisions are based.")
@options.overrides_option
@options.scene_option
@options.runs_option
@options.json_option
def command(
    mission: str, seeds: range, workers: int, frames: bool, overrides: dict[str, str],
    scene: Path | None, runs: Path, as_json: bool,
) -> int:  # fmt: skip
    """Run a mission once for every seed, and summarize the runs.

    MISSION is a file or the name of a shipped mission. Exit code 1 if a run did not succeed, or recorded
    an object outcome that differs from the simulated world. Ctrl-C halts the current runs; then the results
    of the complete runs are printed. A second Ctrl-C quits immediately.
    """
    with keep_stdout_clean():
        from executive.campaign.sweep import SweepJob, run_sweep, summarize_results
        from executive.cell.json_values import to_json
        from executive.cli.progress import print_halt, show_progress
        from executive.mission.load import load_mission
        from executive.plugins import load_cell_kind, load_skills
        from executive.record.run_directory import check_runs_folder

        # The mission and the folder are checked here, so that an error is not reported for every seed.
        loaded_mission = load_mission(mission, load_skills(), overrides, load_cell_kind)
        if scene is not None:
            from executive.cells.sim.scene_file import load_scene

            load_scene(scene, loaded_mission.cell_config)
        check_runs_folder(runs)
        with show_progress(mission) as progress:
            jobs = [SweepJob(mission, seed, overrides, runs, frames, scene) for seed in seeds]
            results = run_sweep(jobs, workers=workers, progress=progress, on_halt=print_halt)
        summary = summarize_results(results, len(seeds))
        click.echo(_describe_summary(summary), err=True)
    if as_json:
        settings = {"mission": mission, "seeds": [seeds[0], seeds[-1]], "scene": scene and str(scene)}
        print_json({**settings, **summary, "results": to_json(results)})
    has_problem = summary["succeeded"] < summary["runs"] or bool(summary["disagreements"])
    return ExitCode.HALTED if summary["cut_off"] else int(has_problem)


def _describe_summary(summary: dict[str, Any]) -> str:
    """Return a text with the summary of a sweep."""
    from executive.view.terminal.summary import describe_end

    run_count, success_count = summary["runs"], summary["succeeded"]
    headline = f"{success_count} of {run_count} runs succeeded"
    if summary["cut_off"]:
        successes = f"; {success_count} of them succeeded" if run_count else ""
        headline = f"{run_count} of {summary['asked']} runs, halted{successes}"
    if not run_count:
        return headline
    objects, robot, wall = summary["objects"], summary["robot_time_s"], summary["wall_time_s"]
    lower_bound, upper_bound = objects["interval_95"]
    lines = [
        headline,
        f"{objects['right']} of {objects['total']} objects correct: {objects['share']:.2%} "
        f"(95 % interval {lower_bound:.2%} to {upper_bound:.2%})",
        f"robot time {robot['median']:.1f} s (median; {robot['least']:.1f} to {robot['most']:.1f}), "
        f"wall time {wall['median']:.1f} s ({wall['least']:.1f} to {wall['most']:.1f})",
    ]
    planning, time_per_object = summary["planning"], summary["robot_time_per_object_s"]
    if time_per_object and planning["motions"]:
        ahead_ratio = planning["ahead"] / planning["motions"]
        planned_ahead = f"{ahead_ratio:.0%} of {planning['motions']} motions planned ahead"
        waiting_time = f"{planning['waited_s']:.1f} s waited for planning"
        lines.append(f"robot time per object {time_per_object:.2f} s; {planned_ahead}, {waiting_time}")
    lines.append(f"ledger and audit disagree in {len(summary['disagreements'])} runs")
    for entry in summary["disagreements"]:
        ledger_text = ", ".join(f"{name} {count}" for name, count in entry["items"].items())
        audit_text = ", ".join(f"{name} {count}" for name, count in entry["audit"].items())
        lines.append(f"  seed {entry['seed']}: ledger: {ledger_text}; audit: {audit_text}; {entry['run']}")
    if summary["failures"]:
        lines.append(f"{len(summary['failures'])} runs did not succeed:")
    keys = ("status", "reason", "node", "message")
    for entry in summary["failures"]:
        # `run` is empty if the process crashed or could not create a run directory.
        directory_text = entry["run"] and f"; {entry['run']}"
        lines.append(f"  seed {entry['seed']}: {describe_end(*map(entry.get, keys))}{directory_text}")
    return "\n".join(lines)

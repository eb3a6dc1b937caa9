"""`executive replay`: repeat the decisions of a recorded run, and report the first difference."""

from __future__ import annotations

from pathlib import Path

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.errors import ExitCode


@click.command(name="replay")
@click.argument("run", metavar="RUN")
@click.option(
    "--mission", "mission_file", type=options.FILE, help="Mission file instead of the recorded mission."
)
@options.video_option
@options.force_option
@options.runs_option
@options.json_option
def command(
    run: str, mission_file: Path | None, video: Path | None, force: bool, runs_folder: Path, as_json: bool
) -> ExitCode:
    """Repeat the decisions of a recorded run.

    RUN is a run directory or `latest`. Nothing moves and nothing is simulated: tree, skills and ledger get
    the recorded inputs from arm, tool, camera, detectors and operator. Exit code 1 if a decision differs
    from the record; the first difference is printed. With --video, the world of the run is simulated again,
    also after a halt or an interruption.
    """
    with keep_stdout_clean():
        from executive.plugins import load_skills
        from executive.record.journal import read_journal
        from executive.record.replayed_run import replay_run
        from executive.record.run_directory import find_run, read_cell

        path = find_run(run, runs_folder)
        if video is not None:
            # The import takes 0.1 s, and only a video needs it.
            from executive.view.video import write_video

            options.check_video(video, read_cell(path).kind, force=force)
            write_video(path, video)
            click.echo(f"video: {video}", err=True)
        result = replay_run(path, read_journal(path / "journal.jsonl"), load_skills(), mission_file)
        comparison = ", all as recorded" if result.is_equal else f" as recorded, then {result.difference}"
        click.echo(f"{result.decisions} decisions{comparison} ({path})", err=True)
    if as_json:
        print_json({"run": str(path), "same": result.is_equal, **result.as_json()})
    return ExitCode.SUCCESS if result.is_equal else ExitCode.FAILURE

"""Report of a sweep in the JUnit XML format, for CI servers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from executive.campaign.results.rows import RunRow
from executive.campaign.results.sweep_summary import RepeatCommandFactory
from executive.record.run_directory import convert_os_errors, write_atomically
from executive.view.text import replace_invalid_xml_characters


def write_junit(
    path: Path, mission_name: str, runs: Sequence[RunRow], make_repeat_command: RepeatCommandFactory
) -> None:
    """Write the report of a sweep of a mission.

    Raises:
        InputError: The file cannot be written.
    """
    with convert_os_errors(f'write the report "{path}"', "name another file with --junit FILE"):
        write_atomically(path, format_junit(mission_name, runs, make_repeat_command))


def format_junit(mission_name: str, runs: Sequence[RunRow], make_repeat_command: RepeatCommandFactory) -> str:
    """Return the report: one test case per run, with the reason of a failure and a command to repeat the run.

    A run with the status FAULT is an error. A run with the status FAILURE or INCOMPLETE is a failure, and so
    is a successful run whose audit contradicts the ledger.
    """
    cases = [_make_case(mission_name, run, make_repeat_command(run)) for run in runs]
    suite = ElementTree.Element(
        "testsuite",
        name=f"executive sweep {mission_name}",
        tests=str(len(cases)),
        failures=str(sum(case.find("failure") is not None for case in cases)),
        errors=str(sum(case.find("error") is not None for case in cases)),
        time=f"{sum(run.wall_time_s for run in runs):.3f}",
    )
    suite.extend(cases)
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{replace_invalid_xml_characters(text)}\n'


def _make_case(mission_name: str, run: RunRow, repeat_command: str) -> ElementTree.Element:
    """Return the test case of a run."""
    name = " ".join((f"seed {run.seed}", *(f"{key}={value}" for key, value in run.variant.items())))
    case = ElementTree.Element("testcase", classname=mission_name, name=name, time=f"{run.wall_time_s:.3f}")
    if run.problem:
        tag, message = "error" if run.status == "FAULT" else "failure", run.explanation or run.status
        element = ElementTree.SubElement(case, tag, type=run.problem, message=message)
        element.text = f"{run.status} {run.problem} {run.node}".strip() + f"\n{message}\n{run.run_directory}"
    ElementTree.SubElement(case, "system-out").text = repeat_command
    return case

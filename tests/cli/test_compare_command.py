"""`executive compare`: its table, its page and its exit codes, with runs of which only the rows exist."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from test_sweep_command import make_record

from executive.campaign.results.database import ResultsDatabase
from executive.campaign.sweep_job import SweepJob
from executive.cli.main import main


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Result]:
    """Function that compares; runs of a mission with `cell.table.objects=[1, 1]` fail for even seeds."""

    def run_sweep(jobs: list[SweepJob], database: ResultsDatabase, *_: object) -> None:
        for job in jobs:
            has_loss = job.settings.overrides.get("cell.table.objects") == "[1, 1]" and job.seed % 2 == 0
            record = make_record(job, "FAILURE" if has_loss else "SUCCESS")
            run = replace(record.run, run_directory=str(tmp_path / f"{database.path.parent.name}{job.seed}"))
            database.append(replace(record, run=run))

    monkeypatch.setattr("executive.campaign.sweep.run_sweep", run_sweep)

    def invoke(*words: str) -> Result:
        runs = () if "--resume" in words else ("--runs", str(tmp_path / "runs"))
        return CliRunner().invoke(main, ("compare", *words, *runs))

    return invoke


class LinkReader(HTMLParser):
    """The elements of a page, and the values of their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))


LOSS = ("sort_fruit", "--seeds", "0:10", "--set", "cell.kind=fake", "--set-b", "cell.table.objects=[1, 1]")


def test_a_loss_is_detected_and_both_reports_are_linked(compare, tmp_path: Path) -> None:
    for side in "ab":
        (tmp_path / f"{side}4").mkdir()
        (tmp_path / f"{side}4" / "report.html").touch()
    shown = compare(*LOSS, "--json")
    assert shown.exit_code == 0, shown.output
    figures = json.loads(shown.stdout)
    success = figures["differences"][0]
    assert (success["difference"], success["high"] < 0) == (-0.5, True)
    assert [pair["seed"] for pair in figures["changed_pairs"]] == [0, 2, 4, 6, 8]
    assert [settings["overrides"] for settings in figures["settings"]] == [
        {"cell.kind": "fake"},
        {"cell.kind": "fake", "cell.table.objects": "[1, 1]"},
    ]
    said = " ".join(shown.stderr.split())
    assert "10 pairs of runs with the same seed" in said and "5 seeds with a different outcome" in said
    assert f"seed 4: A SUCCESS {tmp_path}/a4; B FAILURE Grasp.missed {tmp_path}/b4" in said
    page = Path(figures["page"])
    elements = LinkReader(page.read_text(encoding="utf-8")).elements
    links = {str(attrs["href"]) for tag, attrs in elements if tag == "a"}
    assert {(page.parent / link).resolve() for link in links} == {
        tmp_path / f"{side}4" / "report.html" for side in "ab"
    }
    assert not any(name.startswith("on") or name == "src" for _, attrs in elements for name in attrs)
    assert "script" not in {tag for tag, _ in elements}


def test_a_mission_compared_with_itself_and_resumed(compare) -> None:
    first = compare("sort_fruit", "--seeds", "0:4", "--json")
    figures = json.loads(first.stdout)
    assert [(one["difference"], one["low"], one["high"]) for one in figures["differences"]] == [(0, 0, 0)] * 3
    again = compare("--resume", str(Path(figures["page"]).parent), "--json")
    assert (again.exit_code, json.loads(again.stdout)) == (0, figures)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("sort_fruit",), "give one or two missions and --seeds, or --resume FOLDER"),
        (("a", "b", "c", "--seeds", "0:2"), "give one or two missions and --seeds, or --resume FOLDER"),
        (("--resume", ".", "--set-a", "a=1"), "--resume takes missions, seeds and settings from the comp"),
        (
            ("a", "--seeds", "1", "--set", "x=1", "--set-b", "x=2"),
            "x is set with --set and also with --set-a or --set-b",
        ),
    ],
)
def test_contradicting_options_are_explained(compare, words: tuple[str, ...], message: str) -> None:
    shown = compare(*words)
    assert shown.exit_code == 2
    assert message in " ".join(shown.stderr.replace("│", " ").split())


@pytest.mark.slow
def test_the_page_is_readable_and_loads_nothing(compare, tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("there is no chromium")
    page_file = json.loads(compare(*LOSS, "--json").stdout)["page"]
    with playwright.sync_playwright() as browsers:
        sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
        browser = browsers.chromium.launch(executable_path=chromium, args=sandbox)
        page = browser.new_page(viewport={"width": 375, "height": 800})
        loaded: list[str] = []
        problems: list[str] = []
        page.on("request", lambda request: loaded.append(request.url))
        page.on("console", lambda message: problems.append(message.text))
        page.goto(f"file://{page_file}")
        assert page.inner_text("h1") == "A: 10 of 10 runs succeeded; B: 5 of 10 runs succeeded"
        assert page.evaluate("document.documentElement.scrollWidth") <= 375
        assert page.locator("svg.histogram").count() == page.locator("svg.histogram > title").count() == 2
        assert page.locator("#changed-pairs tbody tr").count() == 5
        assert (loaded, problems) == ([f"file://{page_file}"], [])
        browser.close()

"""A report in a real browser: all of it is to be seen, and nothing is fetched for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.mission.load import load_mission
from executive.plugins import load_skills
from executive.record.recorded_run import record_run
from executive.run.assembly import RunOptions
from executive.view.report.page import write_report

pytestmark = pytest.mark.slow
MISSION = Path(__file__).parents[3] / "missions" / "sort_wrist.yaml"


def test_verdict_pictures_timeline_and_tree_are_to_be_seen(visit, tmp_path: Path) -> None:
    skills = load_skills()
    result = record_run(load_mission(MISSION, skills), RunOptions(3), tmp_path)
    file = write_report(Path(result.run))
    visit.page.goto(f"file://{file.resolve()}")
    assert visit.page.inner_text("h1") == "3 of 3 objects are in their bins."
    assert visit.page.locator("article > img").count() == 3
    drawn = "[...document.images].filter((i) => i.offsetParent).map((i) => i.scrollIntoView() || i.decode())"
    visit.page.evaluate(f"Promise.all({drawn})")
    for what in ("article > img", "svg.timeline", "svg.behaviour-tree"):
        assert visit.page.locator(what).first.is_visible()
        assert visit.colours(what) > 10, what
    assert visit.errors == []
    assert {url.partition(":")[0] for url in visit.fetched} <= {"file", "data"}
    assert len([url for url in visit.fetched if url.startswith("file:")]) == 1

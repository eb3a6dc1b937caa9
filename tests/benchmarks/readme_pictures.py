"""Pictures of README and guides, made in `.github/media`: `python -m tests.benchmarks.readme_pictures`.

`run.gif` is the video of a run, `decision.jpg` a picture of a decision in this run, `tree.svg` the tree of
the mission, and `live.jpg` the live page of the run in Chromium, if it is installed.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

MEDIA = Path(__file__).parents[2] / ".github" / "media"
COMMAND = (sys.executable, "-m", "executive.cli.main")
RUN = ("run", "sort_overhead", "--seed", "5")
PAUSE_TIME = 6.0
"""Time on the clock of the run at which the live page is shown [s]."""
BROWSER_OPTIONS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
"""WebGL without a graphics card, also for root in a container."""


def make_pictures_of_run(runs: Path) -> None:
    """Make `run.gif` and `decision.jpg` from a run, and `tree.svg` from its mission."""
    video = ("--video", MEDIA / "run.gif", "--force")
    subprocess.run([*COMMAND, *RUN, "--quiet", "--runs", runs, *video], check=True)
    (decision,) = runs.glob("*/*/frames/*_cube-1.jpg")
    shutil.copy(decision, MEDIA / "decision.jpg")
    with (MEDIA / "tree.svg").open("w") as tree:
        subprocess.run([*COMMAND, "tree", "sort_overhead", "--fold", "--svg"], check=True, stdout=tree)


def make_picture_of_live_page(runs: Path, browser: str) -> None:
    """Make `live.jpg` from the page of a run, which is paused while it carries an object."""
    run = [*COMMAND, *RUN, "--view", "--paused", "--realtime", "--runs", str(runs)]
    with (
        subprocess.Popen(run, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process,
        sync_playwright() as playwright,
    ):
        assert process.stderr is not None
        address = process.stderr.readline().split()[-1]
        page = playwright.chromium.launch(executable_path=browser, args=BROWSER_OPTIONS).new_page(
            viewport={"width": 1440, "height": 860}
        )
        page.goto(address)
        scene = page.frame_locator("#scene iframe")
        scene.locator("canvas").first.wait_for(timeout=60_000)
        # The scene warns that the browser has no graphics card.
        scene.locator(".mantine-Notification-closeButton").click(timeout=60_000)
        page.click("#resume")
        while float(page.inner_text("#clock").split()[0]) < PAUSE_TIME:
            page.wait_for_timeout(50)
        page.click("#pause")
        page.wait_for_timeout(5_000)  # A browser without a graphics card draws a few frames per second.
        page.screenshot(path=MEDIA / "live.jpg", type="jpeg", quality=80)
        process.terminate()
        process.communicate()


def main() -> None:
    """Make all pictures."""
    with TemporaryDirectory() as folder:
        make_pictures_of_run(Path(folder) / "run")
        if browser := shutil.which("chromium"):
            make_picture_of_live_page(Path(folder) / "live", browser)
        else:
            print("chromium is not installed; live.jpg was not made")


if __name__ == "__main__":
    main()

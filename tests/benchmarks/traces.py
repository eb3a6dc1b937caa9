"""Decisions of the shipped missions, to show that a refactoring changes none of them.

`--out FILE` writes one JSON object per run: mission, kind of cell, seed, status, trace and robot time.
`--compare FILE` runs again and lists each run that differs. The module uses only the command line of the
executive, so `--executive PATH` can record the runs of another checkout. Traces can be compared on one kind
of processor only.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

MISSIONS = Path("missions")
WITHOUT_PHYSICS = {"kit_fasteners", "recycle", "sort_fruit", "tray_instruments"}
"""Missions whose cell file names the fake cell."""

REQUESTS = {"pick_on_request": ["duck", "cube", "sphere", "duck"]}
"""Answers of the operator, by mission."""

SEEDS = {"fake": range(300, 305), "sim": range(300, 303)}
"""Seeds by kind of cell."""

Job = tuple[str, str, int]
"""Mission, kind of cell and seed."""


def main() -> int:
    """Record or compare the runs; return 1 if a run differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="file to write")
    parser.add_argument("--compare", type=Path, help="file that an earlier call wrote")
    parser.add_argument("--keep", type=Path, help="folder in which the run directories stay")
    parser.add_argument("--executive", default=str(Path(sys.executable).with_name("executive")))
    parser.add_argument("--fake-only", action="store_true", help="leave out the simulated runs")
    parser.add_argument("--seeds", type=int, default=5, help="largest number of seeds per mission and cell")
    options = parser.parse_args()
    names = sorted(path.stem for path in MISSIONS.glob("*.yaml"))
    simulated_names = [] if options.fake_only else [name for name in names if name not in WITHOUT_PHYSICS]
    jobs: list[Job] = [(name, "fake", seed) for name in names for seed in SEEDS["fake"][: options.seeds]]
    jobs += [(name, "sim", seed) for name in simulated_names for seed in SEEDS["sim"][: options.seeds]]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        run = partial(run_mission, options.executive, options.keep or Path(folder))
        rows = list(pool.map(run, jobs))
    if options.out:
        options.out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    lines = options.compare.read_text().splitlines() if options.compare else map(json.dumps, rows)
    expected_rows = {_get_job(row): row for row in map(json.loads, lines)}
    different = [row for row in rows if expected_rows.get(_get_job(row)) != row]
    for row in different:
        print(f"{row}, expected {expected_rows.get(_get_job(row))}")
    print(f"{len(rows) - len(different)} of {len(rows)} runs are equal")
    return 1 if different else 0


def _get_job(row: dict[str, Any]) -> Job:
    return row["mission"], row["cell"], row["seed"]


def run_mission(executive: str, runs: Path, job: Job) -> dict[str, Any]:
    """Run a mission in a process of its own; return its result, or the end of its error output."""
    name, kind, seed = job
    command = [executive, "run", str(MISSIONS / f"{name}.yaml"), "--seed", str(seed)]
    command += ["--json", "--quiet", "--runs", str(runs / f"{name}-{kind}-{seed}")]
    command += [f"--request={label}" for label in REQUESTS.get(name, ())]
    if kind == "fake":
        command += ["--set", "cell.kind=fake"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    row: dict[str, Any] = {"mission": name, "cell": kind, "seed": seed}
    if not done.stdout:
        return {**row, "status": "no result", "trace": done.stderr[-300:]}
    result = json.loads(done.stdout)
    return {**row, **{key: result[key] for key in ("status", "trace", "robot_time_s")}}


if __name__ == "__main__":
    sys.exit(main())

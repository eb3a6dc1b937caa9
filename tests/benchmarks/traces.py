"""Traces of the shipped missions, to show that a refactoring changes no decision.

`--out FILE` writes the trace of every run. `--compare FILE` runs again and lists each run with another
trace. The module uses only the command line of the executive, so `--executive PATH` can record the traces of
another checkout. Traces can be compared on one kind of processor only.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

MISSIONS = Path("missions")
WITHOUT_PHYSICS = {"kit_fasteners", "recycle", "sort_fruit", "tray_instruments"}
"""Missions whose cell file names the fake cell."""

REQUESTS = {"pick_on_request": ["duck", "cube", "sphere", "duck"]}
"""Answers of the operator, by mission."""

FAKE_SEEDS = range(300, 305)
SIMULATED_SEEDS = range(300, 303)


def main() -> int:
    """Record or compare the traces; return 1 if a trace differs or a run was not recorded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, help="file to write")
    parser.add_argument("--compare", type=Path, help="file that an earlier call wrote")
    parser.add_argument("--executive", default=str(Path(sys.executable).with_name("executive")))
    parser.add_argument("--fake-only", action="store_true", help="leave out the simulated runs")
    parser.add_argument("--seeds", type=int, default=5, help="largest number of seeds per mission and cell")
    options = parser.parse_args()
    names = sorted(path.stem for path in MISSIONS.glob("*.yaml"))
    jobs = [(name, "fake", seed) for name in names for seed in FAKE_SEEDS[: options.seeds]]
    if not options.fake_only:
        simulated = [name for name in names if name not in WITHOUT_PHYSICS]
        jobs += [(name, "sim", seed) for name in simulated for seed in SIMULATED_SEEDS[: options.seeds]]
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(lambda job: run_mission(options.executive, *job), jobs))
    traces = {" ".join(map(str, job)): result for job, result in zip(jobs, results, strict=True)}
    if options.out:
        options.out.write_text(json.dumps(traces, indent=1) + "\n")
    expected = json.loads(options.compare.read_text()) if options.compare else traces
    different = [run for run in traces if traces[run] != expected.get(run)]
    for run in different:
        print(f"{run}: {traces[run]}, expected {expected.get(run)}")
    print(f"{len(traces) - len(different)} of {len(traces)} traces are equal")
    return 1 if different else 0


def run_mission(executive: str, name: str, kind: str, seed: int) -> Sequence[str]:
    """Run a mission in a process of its own; return its status and trace, or the end of its error output."""
    with tempfile.TemporaryDirectory() as runs:
        command = [executive, "run", str(MISSIONS / f"{name}.yaml"), "--seed", str(seed)]
        command += ["--json", "--quiet", "--runs", runs]
        command += [f"--request={label}" for label in REQUESTS.get(name, ())]
        if kind == "fake":
            command += ["--set", "cell.kind=fake"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        return ["no result", done.stderr[-300:]]
    result = json.loads(done.stdout)
    return [result["status"], result["trace"]]


if __name__ == "__main__":
    sys.exit(main())

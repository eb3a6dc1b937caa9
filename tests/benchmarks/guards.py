"""Guards that break at random moments of a simulated transport; the run ends with `guard.broken`.

In each run, a condition fails from a random tick on, while the arm carries an object. The
arm must come to rest on its path, and ledger and audit must agree.
"""

from __future__ import annotations

import random
import tempfile
from collections import deque
from pathlib import Path
from typing import Any

import click
import numpy as np

from executive.cell.clock import STEP
from executive.cell.protocols import Cell
from executive.cell.workcell import CellWrapper
from executive.events import NodeEnded, TimedEvent
from executive.geometry import Array
from executive.mission.load import load_mission
from executive.motion.joints import JointLimits
from executive.motion.trajectory import Trajectory
from executive.plugins import load_skills
from executive.skill import Skill
from executive.testing.oracle import make_oracle_kind
from executive.testing.run_mission import run_mission
from executive.testing.substitutes import make_substitute
from skills.conditions import IsHolding
from tests.benchmarks.halts import COMMANDS_BEFORE_STOP, WatchedCell, measure_braking
from tests.benchmarks.report import Figures, run_command

MAX_REST_TIME = 0.42
"""Maximum time from the broken guard to rest of the arm [s]."""
MAX_DEVIATION = 1e-6
"""Maximum distance of a joint from the planned trajectory [rad]."""
TRANSPORT_TICKS = 150
"""Upper bound of the random moment [control steps after the start of the guard]; transports take longer."""
MISSION = """
mission: guarded_transport
cell: cells/overhead.yaml
routes: {cube: red_bin, sphere: blue_bin, duck: yellow_bin}
tree:
  - [MoveToScan, Detect, Localize, SelectTarget, Approach, Grasp]
  - guard: {holds: IsHolding, do: Transit}
  - Release
"""


def measure(count: int = 50, seed: int = 0) -> Figures:
    """Break `--count` guards, each at a random moment of a transport with another arrangement of objects."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "guarded_transport.yaml")
        path.write_text(MISSION, encoding="utf-8")
        runs = [measure_run(path, number, rng.randrange(1, TRANSPORT_TICKS)) for number in range(count)]
    return {
        "runs": len(runs),
        "moving": sum(run["moving"] for run in runs),
        "rest_s": max(run["rest_s"] for run in runs),
        "deviation_rad": max(run["deviation_rad"] for run in runs),
        "problems": [f"{text} (seed {run['seed']})" for run in runs for text in run["problems"]],
    }  # fmt: skip


def measure_run(path: Path, seed: int, tick: int) -> Figures:
    """Break a guard at its check number `tick`, and return figures and problems of the run."""
    watch = _Watch()
    substitute = make_condition_that_fails(tick)
    loaded = load_mission(path, load_skills())
    result = run_mission(
        path, lambda *args, **options: watch.wrap(make_oracle_kind()(*args, **options)), seed=seed,
        substitutes={"*/IsHolding": substitute}, observers=[watch.observe],
    )  # fmt: skip
    figures = watch.measure(JointLimits.from_config(loaded.cell_config.arm.limits))
    problems = []
    if (result.status, result.reason) != ("FAILURE", "guard.broken"):
        problems.append(f"the run ended as {result.status} {result.reason}: {result.message}")
    if not result.agrees:
        problems.append(f"the ledger says {dict(result.items)}; the audit {result.audit}")
    if figures["rest_s"] > MAX_REST_TIME:
        problems.append(f"at rest after {figures['rest_s']:.3f} s")
    if figures["deviation_rad"] > MAX_DEVIATION:
        problems.append(f"{figures['deviation_rad']:.2g} rad off the path")
    return {**figures, "seed": seed, "tick": tick, "problems": problems}


def make_condition_that_fails(tick: int) -> type[Skill]:
    """Return a substitute of IsHolding that fails from its check number `tick` on."""
    checks = 0

    def run(self: Skill, cell: Cell) -> None:
        nonlocal checks
        del cell
        checks += 1
        if checks >= tick:
            raise self.failure("empty", f"check {checks}")

    return make_substitute(IsHolding, "Failing", run)


class _Watch:
    """Commands of the arm around the moment at which the guard breaks."""

    def __init__(self) -> None:
        self._commands: deque[Array] | list[Array] = deque(maxlen=COMMANDS_BEFORE_STOP)
        self._before_stop = self._steps = 0
        self._motion: Trajectory | None = None
        self._rest_step: int | None = None
        self._broken_step: int | None = None
        self._cell: Any = None

    def wrap(self, workcell: Any) -> CellWrapper:
        """Return the cell, with a record of each command of its arm."""
        self._cell = workcell
        return WatchedCell(workcell, before=lambda: None, after=self._keep_command)

    def observe(self, timed: TimedEvent) -> None:
        """Note the motion and the step at which the guard breaks."""
        event = timed.event
        if isinstance(event, NodeEnded) and event.reason == "guard.broken" and self._broken_step is None:
            arm = self._cell.cell.arm
            self._broken_step, self._motion = self._steps, None if arm.at_rest else arm._motion
            self._commands, self._before_stop = [*self._commands], len(self._commands)
            self._rest_step = self._steps if arm.at_rest else None

    def _keep_command(self) -> None:
        self._steps += 1
        arm = self._cell.cell.arm
        if self._rest_step is None:
            self._commands.append(arm._commanded_q)
            if self._broken_step is not None and arm.at_rest:
                self._rest_step = self._steps

    def measure(self, limits: JointLimits) -> Figures:
        """Return the time to rest [s], and the distance from the path [rad]."""
        if self._broken_step is None or self._rest_step is None:
            return {"moving": self._motion is not None, "rest_s": np.inf, "deviation_rad": np.inf}
        deviation = 0.0
        if self._motion is not None:
            deviation = measure_braking(self._commands, self._before_stop, self._motion, limits)[
                "deviation_rad"
            ]
        rest_time = (self._rest_step - self._broken_step) * STEP
        return {"moving": self._motion is not None, "rest_s": rest_time, "deviation_rad": deviation}


if __name__ == "__main__":
    run_command(
        measure,
        click.option("--count", type=click.IntRange(min=1), default=50, help="Number of runs."),
        click.option("--seed", type=int, default=0, help="Seed of the moments."),
    )

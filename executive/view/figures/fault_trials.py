"""What fault campaigns have shown: plain values that everything told of them is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Trial:
    """One run in which something went wrong on purpose.

    Attributes:
        numbers: Of the faults that happened in it, those first that the last one needs to happen at all.
        told: The faults in words.
        name: Skill of the node the last fault is about, or what else it is about.
        place: File and line of that node, or "".
        what: The reason it is to fail with, or what happens.
        when: When that happens.
        happened: Whether all faults found their occasion.
        raised: Whether the node failed with the reason; True where none is meant.
        cut: True where the user halted it.
        status: How the run ended.
        reason: What failed, or "".
        message: One sentence.
        node: Path of the node that decided, or "".
        missing: Objects fewer in bins than in an undisturbed run.
        items: The ledger's balance.
        audit: What really became of the objects.
        robot_time: Time on its clock [s].
        entered: Paths of all nodes that ran.
        problems: What was not as it has to be, in sentences.
        remark: What was odd and may be right, or "".
    """

    numbers: tuple[int, ...]
    told: tuple[str, ...]
    name: str
    place: str
    what: str
    when: str
    happened: bool = False
    raised: bool = True
    cut: bool = False
    status: str = ""
    reason: str = ""
    message: str = ""
    node: str = ""
    missing: int = 0
    items: Mapping[str, int] = field(default_factory=dict)
    audit: Mapping[str, int] | None = None
    robot_time: float = 0.0
    entered: frozenset[str] = frozenset()
    problems: tuple[str, ...] = ()
    remark: str = ""

    @property
    def label(self) -> str:
        """What `--fault` repeats it with: `12`, or `3+12`."""
        return "+".join(map(str, self.numbers))

    @property
    def verdict(self) -> str:
        """How it ended in a word or two; `-` where there was no occasion."""
        if self.problems:
            return "!!"
        if not self.happened:
            return "-"
        if self.status in ("SUCCESS", "INCOMPLETE"):
            return f"ok -{self.missing}" if self.missing > 0 else "ok"
        if self.status == "FAILURE":
            return f"FAILURE {self.reason}"
        return self.status


@dataclass(frozen=True)
class Branch:
    """A way on that a mission takes only after a failure, or in the end.

    Attributes:
        place: File and line where it stands.
        what: `catch on Grasp.missed`, `recover`, `choice 2`, `finally`.
        paths: Its nodes in the tree; a subtree that is used twice is there twice.
        entered: How many trials entered it.
    """

    place: str
    what: str
    paths: tuple[str, ...]
    entered: int = 0


@dataclass(frozen=True)
class FaultFigures:
    """A mission in which everything went wrong, one thing at a time, or in pairs.

    Attributes:
        mission: Its name.
        cell: Kind of its cell, and where the detections come from.
        seed: What chance drew from.
        robot_time: Time that an undisturbed run takes on its clock [s].
        listed: Single faults of the mission.
        trials: Every run, in the order of the faults.
        branches: Every way on after a failure, in the order of the tree.
        complete: False where somebody ended the campaign before its last run.
        pairs: True where the runs were to have two faults each.
    """

    mission: str
    cell: str
    seed: int
    robot_time: float
    listed: int
    trials: tuple[Trial, ...]
    branches: tuple[Branch, ...]
    complete: bool
    pairs: bool = False

    @property
    def failed(self) -> tuple[Trial, ...]:
        """The runs that were not as they have to be."""
        return tuple(trial for trial in self.trials if trial.problems)

    @property
    def unentered(self) -> tuple[Branch, ...]:
        """The ways on that no run took."""
        return tuple(branch for branch in self.branches if not branch.entered)


def as_plain(figures: FaultFigures) -> dict[str, Any]:
    """Return the figures as plain values; times in s."""
    plain = {
        name: getattr(figures, name) for name in ("mission", "cell", "seed", "listed", "pairs", "complete")
    }
    return {
        **plain,
        "robot_time_s": figures.robot_time,
        "runs": len(figures.trials),
        "failed": len(figures.failed),
        "branches": [
            {"place": branch.place, "what": branch.what, "entered": branch.entered}
            for branch in figures.branches
        ],
        "trials": [trial_as_plain(trial) for trial in figures.trials],
    }


def trial_as_plain(trial: Trial) -> dict[str, Any]:
    """Return one run as plain values."""
    plain = asdict(trial)
    for name in ("numbers", "name", "cut", "entered", "robot_time"):
        del plain[name]
    more = {"fault": trial.label, "verdict": trial.verdict, "robot_time_s": trial.robot_time}
    return {**plain, **more, "told": list(trial.told), "problems": list(trial.problems)}

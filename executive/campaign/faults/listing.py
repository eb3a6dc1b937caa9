"""Every single fault of a mission, made from its tree and from what its skills declare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from executive.campaign.faults.causes import causes
from executive.campaign.faults.fault import Breakage, Fault, When
from executive.campaign.faults.rehearsal import Rehearsal
from executive.campaign.subject import Subject
from executive.cell.objects import Target
from executive.mission.model import nodes
from executive.skill import HOLDING, Direction, Skill
from executive.testing import faults as effects
from executive.testing.faults.script import Disturbance, after, between, during

SHORT, LONG = 0.5, 5.0
"""How long a detector is slow, hangs or is dead [s]; the longer is also the deadline of one that hangs."""
QUARTERS: tuple[tuple[When, float], ...] = (("first", 0.25), ("middle", 0.5), ("late", 0.75))
"""Shares of an undisturbed run, or of a motion, at which something happens to objects."""
LASTING = tuple(range(1, 21))
"""Activations in which something happens again and again that nothing real would do for ever."""
CARRIES: tuple[tuple[When, float], ...] = (
    ("first", 0.1), ("first", 0.3), ("middle", 0.5), ("late", 0.7), ("late", 0.9),
)  # fmt: skip
"""Shares of a carry at which the tool lets go."""


def list_faults(subject: Subject, rehearsal: Rehearsal) -> tuple[Fault, ...]:
    """Return every single fault of a mission; a fault's number is its place here, from 1.

    In the order of the tree each reason of each node and what its code may raise, then what goes wrong with
    detectors, objects and tool.
    """
    faults = list(_Listing(subject, rehearsal).all())
    return tuple(_linked(faults))


class _Listing:
    """The faults of one mission."""

    def __init__(self, subject: Subject, rehearsal: Rehearsal) -> None:
        self._skills, self._rehearsal = subject.skills, rehearsal
        self._table = subject.loaded.cell_config.table
        self._causes = causes(self._table)
        self._nodes = skill_nodes(subject)

    def all(self) -> Iterator[Fault]:
        for node in self._nodes:
            yield from self._reasons(node)
        for node in self._nodes:
            yield from self._errors(node)
        yield from self._detector()
        yield from self._objects()
        yield from self._tool()

    def _reasons(self, node: nodes.SkillNode) -> Iterator[Fault]:
        """Yield every reason of a node: physically where that may be, and as said by the skill itself."""
        skill = self._skills[node.skill]
        for reason in skill.reasons:
            cause = self._causes.get(reason)
            for when, starts in self._starts(node):
                base = self._fault(node, reason, when, reason=True)
                breakage = Breakage(node.path, "fails", reason, starts or LASTING)
                said = replace(base, means="the skill says so", breakages=(breakage,))
                if cause is None or not cause.can(skill):
                    yield said
                    continue
                nth = starts or (() if cause.lasts else LASTING)
                happening = during(node.path, cause.effect, nth=nth)
                yield replace(base, means=cause.means, happenings=(happening,))
                yield replace(said, instead_of=-1)

    def _starts(self, node: nodes.SkillNode) -> Iterator[tuple[When, tuple[int, ...]]]:
        """Yield when things go wrong at a node, and in which of its activations."""
        count = len(self._rehearsal.activations.get(node.path, ()))
        yield "first", (1,)
        if count >= 3:
            yield "middle", (1 + count // 2,)
        yield "lasting", ()

    def _errors(self, node: nodes.SkillNode) -> Iterator[Fault]:
        """Yield what the code of a skill may raise: at once, on the way, and when it is halted."""
        ticks = self._rehearsal.activations.get(node.path, ())
        yield self._error(node, "raises", "first", Breakage(node.path, "raises", starts=(1,)))
        start, longest = max(enumerate(ticks, 1), key=lambda one: one[1], default=(1, 0))
        if longest >= 2:
            later = Breakage(node.path, "raises", starts=(start,), after=longest // 2)
            yield self._error(node, "raises", "middle", later)
        if longest >= 2 or not ticks:
            halted = Breakage(node.path, "raises when halted", starts=(start,), after=longest // 2)
            yield self._error(node, "halted", "middle", halted)

    def _error(self, node: nodes.SkillNode, what: str, when: When, breakage: Breakage) -> Fault:
        means = f"its code raises {'when it is halted ' if what == 'halted' else ''}{breakage.after} ticks on"
        return self._fault(node, what, when, means=means, breakages=(breakage,))

    def _detector(self) -> Iterator[Fault]:
        """Yield detectors that are slow, hang or are dead, from the first look and from half-way on."""
        half = self._rehearsal.robot_time / 2
        starts: tuple[tuple[When, float], ...] = (("first", 0.0), ("middle", half))
        for when, start in starts:
            for by in (SHORT, LONG):
                yield _detector(f"slow by {by:g} s", when, after(start, effects.detector_slow(by)))
            for lasts in (SHORT, LONG):
                end = start + lasts
                hangs = between(start, end, effects.detector_hangs())
                dead = between(start, end, effects.detector_dead())
                unsure = between(start, end, effects.detector_unsure())
                yield _detector(f"hangs for {lasts:g} s", when, hangs)
                yield _detector(f"unsure for {lasts:g} s", when, unsure, "unsure")
                yield _detector(f"dead for {lasts:g} s", when, dead)
            yield _detector("hangs for ever", when, after(start, effects.detector_given_up(LONG)))
            yield _detector("dead for ever", when, after(start, effects.detector_dead()))
            yield _detector("unsure for ever", when, after(start, effects.detector_unsure()), "unsure")

    def _objects(self) -> Iterator[Fault]:
        """Yield objects taken away and bumped aside, on the table and under the arm that comes for them."""
        table = self._table
        for when, share in QUARTERS:
            start = share * self._rehearsal.robot_time
            bumped = effects.object_bumped(table.x, table.y, "nearest")
            yield _other("object", "taken", when, after(start, effects.object_removed("nearest")))
            yield _other("object", "bumped", when, after(start, bumped))
        for node in self._nodes:
            if not _goes_to_target(self._skills[node.skill]) or not self._runs(node):
                continue
            nth = 1 + len(self._rehearsal.activations[node.path]) // 2
            for when, share in QUARTERS:
                taken = effects.object_removed("node", share)
                bumped = effects.object_bumped(table.x, table.y, "node", share)
                for what, effect in (("target taken", taken), ("target bumped", bumped)):
                    happening = during(node.path, effect, nth=nth)
                    yield self._fault(node, what, when, means=f"at {share:g}", happenings=(happening,))

    def _tool(self) -> Iterator[Fault]:
        """Yield seals that break on the way, and that do not come about."""
        for node in self._nodes:
            if not _carries(self._skills[node.skill]) or not self._runs(node):
                continue
            for when, share in CARRIES:
                happening = during(node.path, effects.seal_breaks(share), nth=1)
                yield self._fault(node, "lets go", when, means=f"at {share:g}", happenings=(happening,))
            over = during(node.path, effects.seal_breaks_over_wrong_bin())
            yield self._fault(
                node, "lets go over another bin", "lasting", means="every time", happenings=(over,)
            )
        half = self._rehearsal.robot_time / 2
        for lasts in (SHORT, LONG):
            happening = between(half, half + lasts, effects.seal_fails())
            yield _other("tool", f"no seal for {lasts:g} s", "middle", happening)
        for number in (1, 2):
            refuses = after(0.0, effects.object_refuses(number))
            yield _other("tool", f"no seal on object {number}", "lasting", refuses)

    def _fault(self, node: nodes.SkillNode, what: str, when: When, **more: object) -> Fault:
        place = f"{node.mark.source.path}:{node.mark.line}"
        fault = Fault(node.path, node.label or node.skill, place, what, when, "", behind=not self._runs(node))
        return replace(fault, **more)  # type: ignore[arg-type]

    def _runs(self, node: nodes.SkillNode) -> bool:
        return node.path in self._rehearsal.activations


def skill_nodes(subject: Subject) -> list[nodes.SkillNode]:
    """Return the nodes of a mission's tree that run a skill, in its order."""
    return [node for node in subject.loaded.tree.walk() if isinstance(node, nodes.SkillNode)]


def _other(about: str, what: str, when: When, happening: Disturbance) -> Fault:
    start = getattr(happening.when, "start", 0.0)
    return Fault(about, about, "", what, when, f"from {start:.2f} s on", happenings=(happening,))


def _detector(what: str, when: When, happening: Disturbance, leads_to: str = "unavailable") -> Fault:
    return replace(_other("detector", what, when, happening), leads_to=leads_to)


def _goes_to_target(skill: type[Skill]) -> bool:
    inputs = [port for port in skill.ports.values() if port.direction is Direction.IN]
    return skill.moves and any(port.type is Target for port in inputs)


def _carries(skill: type[Skill]) -> bool:
    return skill.moves and skill.tool_state[0] is HOLDING


def _linked(faults: Sequence[Fault]) -> Iterator[Fault]:
    """Yield the faults, those that stand in for the one before them with its number."""
    for number, fault in enumerate(faults, 1):
        yield replace(fault, instead_of=number - 1) if fault.instead_of else fault

"""The shipped mission with two detectors: it fuses their looks, and asks one where the other is silent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from executive.cell.frame import Detection
from executive.events import FrameSearched
from executive.testing.fake_cell import FakeCell
from executive.testing.run_mission import MissionResult, run_mission

Answers = Callable[[int, Sequence[Detection]], Sequence[Detection] | str]
"""From the number of a look and the true detections to an answer, or a sentence for none."""


def sort(**answers: Answers) -> MissionResult:
    """Run the mission with detectors that answer so."""

    def arrange(cell: FakeCell) -> None:
        for name, given in answers.items():
            cell.detectors[name].make_answer = given

    return run_mission("two_detectors", seed=1, arrange=arrange)


def asked(result: MissionResult) -> list[str]:
    """Return the name of the detector of every look, in order."""
    return [one.event.detector for one in result.events if isinstance(one.event, FrameSearched)]


def assert_all_right(result: MissionResult) -> None:
    assert (result.status, result.message) == ("SUCCESS", "")
    assert result.audit is not None
    assert result.agrees
    assert result.items["placed"] == result.audit["right"] == result.items["seen"] >= 3


def silent(look: int, true: Sequence[Detection]) -> str:
    return "no answer, as the test wants it"


def wrong_at_first(look: int, true: Sequence[Detection]) -> Sequence[Detection]:
    """Return the true detections; in the first look each has another class."""
    other = {"cube": "sphere", "sphere": "duck", "duck": "cube"}
    return [replace(one, label=other[one.label]) for one in true] if look == 1 else true


def test_a_choice_rests_on_a_look_of_each_detector() -> None:
    result = sort()
    assert_all_right(result)
    looks = asked(result)
    assert looks == ["embedded", "second"] * (len(looks) // 2)
    # One round of two looks is enough for each object and for the empty table.
    assert len(looks) == 2 * (result.items["placed"] + 1)


def test_a_wrong_class_of_one_detector_is_outvoted() -> None:
    result = sort(embedded=wrong_at_first)
    assert_all_right(result)
    # Two looks that disagree leave doubt.
    assert result.list_failure_reasons("*/SelectTarget")[0] == "doubtful"


def test_where_one_detector_is_silent_the_other_is_asked() -> None:
    result = sort(embedded=silent)
    assert_all_right(result)
    assert set(asked(result)) == {"second"}
    assert "unavailable" in result.list_failure_reasons("*/Detect")


def test_where_both_detectors_are_silent_the_mission_ends_with_the_reason() -> None:
    result = sort(embedded=silent, second=silent)
    assert (result.status, result.reason) == ("FAILURE", "Detect.unavailable")
    assert "detector second: no answer, as the test wants it" in result.message

"""The journal, its reader, and the hash over every decision of a run."""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import closing
from pathlib import Path

import pytest
from events import at, detected, frame_searched, item_changed, read, run_ended, run_started, skill_ended

from executive import events as kinds
from executive.errors import Fault, InputError, RecordLost
from executive.events import InputRead, NodeEnded, NodeStarted, RunResumed, TargetSelected, ToolCommanded
from executive.record import journal
from executive.record.journal import (
    EVENT_CLASSES,
    Journal,
    Trace,
    encode_event,
    find_run_end,
    make_journal_schema,
    read_journal,
)

NODE, END = NodeStarted("a"), run_ended()
FIRST = encode_event(at(1, run_started()))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "journal.jsonl"


@pytest.fixture
def syncs(monkeypatch):
    """The sizes of the file at every fsync."""
    sizes = []
    monkeypatch.setattr(os, "fsync", lambda file: sizes.append(os.fstat(file).st_size))
    return sizes


def write(path, *events, resume=False):
    with closing(Journal(path, resume=resume)) as journal:
        for event in events:
            journal(event)


def test_writes_an_object_per_line_with_its_kind_and_time_first_and_nothing_once_it_is_closed(path):
    journal = Journal(path)
    journal(at(3, NodeStarted("größe"), 0.0125))
    journal.close()
    journal.close()
    journal(at(4, END))
    text = '{"kind":"NodeStarted","tick":3,"clock":0.0125,"node":"größe"}\n'
    assert path.read_text() == text


@pytest.mark.parametrize(
    ("event", "synced"),
    [
        (ToolCommanded("close"), True),
        (item_changed("cube-1", "placed"), True),
        (item_changed("cube-1", "held"), False),
        (NODE, False),
        (read("arm.q", []), False),
        (END, True),
    ],
)
def test_commands_of_the_tool_placements_and_the_end_are_on_the_disk_at_once(path, syncs, event, synced):
    with closing(Journal(path)) as journal:
        journal(at(1, event))
        assert syncs == [path.stat().st_size] * synced


@pytest.mark.parametrize("taken", [0, 17])
@pytest.mark.parametrize("resume", [False, True])
def test_a_full_disk_is_one_fault_then_silence_and_no_part_of_a_line(
    path, monkeypatch, full_disk, resume, taken
):
    path.write_bytes(FIRST[:-1] * resume)
    journal = Journal(path, resume=resume)
    journal(at(0, NODE))
    before = path.read_bytes()
    write, parts = os.write, iter([taken] * (taken > 0))
    monkeypatch.setattr(os, "write", lambda file, line: write(file, line[: next(parts, None) or full_disk()]))
    with pytest.raises(RecordLost, match="cannot be written: no space left on device; the run stops"):
        journal(at(1, NODE))
    journal(at(1, END))
    journal.close()
    assert path.read_bytes() == before == FIRST * resume + encode_event(at(0, NODE))


def test_what_reaches_the_disk_only_at_the_close_is_not_believed_unseen(path, monkeypatch, full_disk):
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(Fault, match="may lack its last lines: no space left on device"):
        write(path, at(0, NODE))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda path: path.unlink(), "another program deleted it"),
        (lambda path: path.with_name("new").replace(path), "another program replaced it"),
        (lambda path: os.truncate(path, 5), "another program changed its length"),
    ],
)
@pytest.mark.parametrize("event", [ToolCommanded("open"), END])
def test_a_change_by_another_program_is_a_fault_at_the_next_command_of_the_tool_or_the_end(
    path, change, problem, event
):
    path.with_name("new").write_bytes(b"")
    journal = Journal(path)
    journal(at(0, NODE))
    change(path)
    journal(at(1, NODE))
    with pytest.raises(RecordLost, match=problem):
        journal(at(2, event))
    journal.close()


@pytest.mark.parametrize(("name", "value"), [("camera.image", {"size": [1, 2]}), ("arm.q", ["far"])])
def test_an_answer_that_cannot_be_replayed_is_refused(path, name, value):
    write(path, at(0, run_started()), at(0, read(name, value)))
    with pytest.raises(InputError, match=f':2: .* the format of the input "{name}"'):
        list(read_journal(path))


LAST = encode_event(at(2, NodeStarted("ä")))[:-1]
ENDS = {
    FIRST: 1,
    FIRST + LAST: 2,
    FIRST + LAST + b"\n": 2,
    FIRST + LAST + b"\0\0\0": 2,
    b"\0" * 5000: 0,
    FIRST + LAST[:-1]: 1,
    FIRST + LAST[:9] + b"\0" * 9: 1,
    LAST[:5]: 0,
}
"""What a kill or a power cut may leave, and how many entries that is."""


@pytest.mark.parametrize("content", ENDS)
def test_a_torn_end_is_left_out_and_cut_off_where_the_journal_goes_on(path, content):
    path.write_bytes(content)
    ticks = [1, 2][: ENDS[content]]
    assert [timed.tick for timed in read_journal(path)] == ticks
    resumed = at(3, RunResumed(3, "", {}))
    write(path, resumed, resume=True)
    if ticks:
        assert [timed.tick for timed in read_journal(path)] == [*ticks, 3]
    else:
        assert path.read_bytes() == encode_event(resumed)


def test_a_new_run_needs_a_new_journal_and_one_that_goes_on_an_old_one(path):
    with pytest.raises(InputError, match="there is no file"):
        list(read_journal(path))
    with pytest.raises(InputError, match="cannot open the journal"):
        Journal(path, resume=True)
    assert list(path.parent.iterdir()) == []
    path.write_bytes(FIRST)
    with pytest.raises(InputError, match="the journal of another run"):
        Journal(path)
    assert path.read_bytes() == FIRST


def test_a_journal_that_is_being_written_is_refused(path):
    with closing(Journal(path)), pytest.raises(InputError, match="is in use: another process"):
        Journal(path, resume=True)
    Journal(path, resume=True).close()


HALTED = '{"kind": "RunHalted", "tick": 1, "clock": 0.1, "is_tree_ticked": true}'


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b'{"tick"', "EOF while parsing"),
        (b"[1]", "it contains no JSON object"),
        (HALTED.replace("RunHalted", "status").encode(), "allowed are BinsEmptied"),
        (HALTED.replace("is_tree", "is_pine").encode(), '"is_tree_ticked" of RunHalted'),
        (HALTED.replace('"tick": 1', '"tick": 1.0').encode(), '"tick" is 1.0'),
        (HALTED.replace('"tick": 1', '"tick": 1000000001').encode(), '"tick" is 1000000001'),
        (HALTED.replace("0.1", '"0"').encode(), "\"clock\" is '0'"),
        (HALTED.replace("0.1", "-0.1").encode(), '"clock" is -0.1'),
        (HALTED.replace("0.1", "3.0").encode(), '"tick" 1 and "clock" 3.0 contradict'),
        (encode_event(at(1, read("clock", "now"))), "the clock is 'now'"),
        (encode_event(at(1, skill_ended("a"))).replace(b"SUCC", b"ODDN"), '"status" of NodeEnded'),
        (encode_event(at(0, run_started())).replace(b'"format":5', b'"format":2'), '"format" of RunStarted'),
    ],
)
def test_a_line_that_is_no_event_is_an_error_with_its_number(path, line, why):
    path.write_bytes(FIRST + line.rstrip() + b"\n" + encode_event(at(2, NODE)))
    with pytest.raises(InputError) as raised:
        list(read_journal(path))
    assert str(raised.value).startswith(f"{path}:2: this line is no event (")
    assert why in str(raised.value)


def test_an_event_that_is_too_long_for_a_journal_is_a_fault() -> None:
    with pytest.raises(Fault, match=r"InputRead of tool\.load has .* at most 1000000 are allowed"):
        encode_event(at(1, read("tool.load", "x" * 5_000_000)))


def test_inputs_of_an_earlier_format_are_read_as_they_are(path: Path) -> None:
    start = encode_event(at(0, run_started())).replace(b'"format":5', b'"format":3')
    path.write_bytes(start + encode_event(at(1, read("observations", [["a value of five parts"]]))))
    assert [type(timed.event).__name__ for timed in read_journal(path)] == ["RunStarted", "InputRead"]


@pytest.mark.parametrize(
    ("kinds", "ended"), [("", False), ("run node end", True), ("run end resume node", False)]
)
def test_a_run_has_ended_if_nothing_comes_after_its_end(kinds, ended):
    samples = {"run": run_started(), "node": NODE, "end": END, "resume": RunResumed(1, "", {})}
    events = [at(tick, samples[kind]) for tick, kind in enumerate(kinds.split())]
    assert find_run_end(events) == (END if ended else None)


def test_every_kind_of_event_comes_back_as_it_was(path):
    value = {"q": [0.1 + 0.2, -0.0, 5e-324], "text": "ä\n", "off": None, "n": 2**70, "on": True}
    events = [
        run_started(requests=["cube"], params={"a": [1, 0.5]}), NODE,
        skill_ended("a/Grasp", outputs={"x": [1]}),
        kinds.BranchChosen("a", "again", "Grasp.missed", "no seal"),
        frame_searched(detected("cube"), unknown_labels=["x"]),
        item_changed("cube-1"), kinds.BinsEmptied(["red_bin"]),
        kinds.UnexplainedChanged("unexplained-1", "a thing", [0.5, 0.1, 0.0], 3, [1.0, 2.0, 3.0, 4.0]),
        TargetSelected("cube-1", "cube", 1, "red_bin"), ToolCommanded("close"),
        kinds.MotionPlanned(True, 0.0, 1.5), InputRead("sensor", 1, value), kinds.OperatorAsked(["cube"]),
        kinds.RequestGiven(None),
        kinds.FaultInjected("grip_lost", "a", "cube-1", "cube", [0.5]), kinds.RunHalted(True),
        RunResumed(3, "close", {"python": "3.11"}), kinds.FaultRaised("Traceback"), END,
    ]  # fmt: skip
    timed = [at(tick, event) for tick, event in enumerate(events)]
    write(path, *timed)
    assert repr(list(read_journal(path))) == repr(timed)
    assert {type(event).__name__ for event in events} == EVENT_CLASSES.keys()


def test_a_journal_is_read_as_a_stream(path):
    write(path, at(0, run_started()))
    with path.open("ab") as file:
        file.write(b"no event\n")
    assert next(read_journal(path)) == at(0, run_started())


def test_the_schema_that_ships_describes_the_events():
    shipped = Path(journal.__file__).with_name("journal.schema.json")
    made = "executive schema --journal > executive/record/journal.schema.json"
    assert json.loads(shipped.read_text(encoding="utf-8")) == make_journal_schema(), f"run: {made}"


FAILED = NodeEnded("sort/Grasp", "FAILURE", "Grasp", "cube-1", "missed", "no seal")
EVENTS = [
    at(0, run_started()),
    at(1, NodeStarted("sort")),
    at(2, NodeStarted("sort/Grasp", "Grasp", "cube-1")),
    at(3, FAILED),
    at(3, NodeEnded("sort/Look", "SUCCESS", "Look", outputs={"p": [0.1, 0.2]})),
    at(3, NodeEnded("sort", "FAILURE", reason="Grasp.missed", message="no seal", origin="sort/Grasp")),
    at(4, frame_searched()),
    at(5, TargetSelected("cube-1", "cube", 1, "red_bin")),
    at(6, item_changed("cube-1", "placed", bin="red_bin", label="größe", position=[0.3333, 0.0, 0.0])),
]
HASHED = [
    [1, "status", "sort", "RUNNING", None, None, None],
    [2, "status", "sort/Grasp", "RUNNING", "", "cube-1", None],
    [3, "status", "sort/Grasp", "FAILURE", "missed", "cube-1", None],
    [3, "status", "sort/Look", "SUCCESS", "", "", {"p": [0.1, 0.2]}],
    [3, "status", "sort", "FAILURE", "Grasp.missed", None, None],
    [5, "decision", "cube-1", "cube", 1],
    [6, "item", "cube-1", "placed", "größe", [0.3333, 0.0, 0.0], "red_bin"],
]


def digest(*events):
    trace = Trace()
    for event in events:
        trace(event)
    return trace.hexdigest()


def test_one_line_of_compact_json_is_hashed_per_decision():
    lines = [json.dumps(line, sort_keys=True, separators=(",", ":")) + "\n" for line in HASHED]
    assert digest(*EVENTS) == hashlib.sha256("".join(lines).encode()).hexdigest()[:16]

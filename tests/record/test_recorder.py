"""The observer that keeps the record: what it lacks is told, and ends nothing that can go on."""

from __future__ import annotations

import os

from events import at, run_ended

from executive.events import NodeStarted
from executive.record.journal import read_journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory


def test_a_picture_that_cannot_be_drawn_is_reported_and_the_run_continues(tmp_path, monkeypatch):
    # No event can be asked for its data.
    monkeypatch.setattr(PictureRecorder, "__call__", lambda self, event: event["kind"])
    directory = RunDirectory(tmp_path)
    recorder = Recorder(directory)
    recorder(at(0, NodeStarted("a")))
    recorder(at(1, run_ended()))
    recorder.close()
    assert recorder.problem.startswith("not every picture was drawn: TypeError: ")
    assert len(read_journal(directory.journal)) == 2


def test_the_pictures_are_waited_for_whatever_became_of_the_journal(tmp_path, monkeypatch, full_disk):
    closed = []
    monkeypatch.setattr(PictureRecorder, "close", lambda self, wait: closed.append(wait))
    monkeypatch.setattr(PictureRecorder, "problem", "no pictures were drawn")
    monkeypatch.setattr(os, "fsync", full_disk)
    recorder = Recorder(RunDirectory(tmp_path))
    recorder(at(0, NodeStarted("a")))
    recorder.close(wait=False)
    recorder.close()
    assert closed == [False, True]
    journal_problem, _, picture_problem = recorder.problem.rpartition("; ")
    assert "may lack its last lines" in journal_problem
    assert picture_problem == "no pictures were drawn"

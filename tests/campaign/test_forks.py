"""Children of this process: what they find comes back, and however they end, their parent goes on."""

from __future__ import annotations

import os
import signal

from executive.campaign.forks import Forks


def test_a_child_tells_what_it_found_and_changes_nothing_here() -> None:
    forks, lived = Forks(10.0), ["parent"]
    answer = forks.fork()
    if answer is None:
        lived.append("child")
        forks.tell({"lived": lived, "in_child": forks.in_child})
    assert answer == ({"lived": ["parent", "child"], "in_child": True}, "")
    assert lived == ["parent"]
    assert not forks.in_child


def test_one_child_after_the_other() -> None:
    forks, found = Forks(10.0), []
    for number in range(3):
        answer = forks.fork()
        if answer is None:
            forks.tell("x" * number * 100_000)
        found.append(len(answer[0]))
    assert found == [0, 100_000, 200_000]


def test_a_child_that_dies_is_told_by_its_signal() -> None:
    forks = Forks(10.0)
    answer = forks.fork()
    if answer is None:
        os.kill(os.getpid(), signal.SIGKILL)
    assert answer == (None, "its process ended with the signal SIGKILL and told nothing")


def test_a_child_that_ends_without_a_word_is_told_by_its_exit_code() -> None:
    forks = Forks(10.0)
    answer = forks.fork()
    if answer is None:
        os._exit(0)
    assert answer == (None, "its process ended with exit code 0 and told nothing")


def test_a_child_that_tells_nothing_is_ended() -> None:
    forks = Forks(0.1)
    answer = forks.fork()
    if answer is None:
        signal.pause()
    assert answer == (None, "it told nothing for 0.1 s and was ended")


def test_what_cannot_be_told_ends_the_child_with_an_exit_code() -> None:
    forks = Forks(10.0)
    answer = forks.fork()
    if answer is None:
        forks.tell(lambda: None)
    assert answer == (None, "its process ended with exit code 1 and told nothing")

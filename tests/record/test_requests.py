"""What the operator asked for, as it can be asked for again."""

from __future__ import annotations

import pytest

from executive.events import Event
from executive.record.requests import Requests


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ([], []),
        (["cube", "rescan", "duck"], ["cube", "rescan", "duck"]),
        (["cube", None, "duck", None, None], ["cube", "quit", "duck"]),
        ([None], ["quit"]),
    ],
)
def test_the_end_of_the_list_is_a_wish_to_quit_and_goes_without_saying(wanted, words):
    requests = Requests()
    requests(Event("asking", 0, 0.0, {"choices": ["cube", "duck"]}))
    for word in wanted:
        requests(Event("request", 0, 0.0, {"wanted": word}))
    assert requests.words == words

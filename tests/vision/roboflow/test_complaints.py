"""Sentences about a server that gave no usable answer."""

from __future__ import annotations

import pytest

from executive.vision.detectors.roboflow.complaints import failed, late, plain
from executive.vision.detectors.roboflow.options import RoboflowOptions

OPTIONS = RoboflowOptions(url="https://serverless.roboflow.com/", model_id="shapes/1")


def test_somebody_elses_words_become_one_short_line():
    assert plain("<html>\n\x1b[31m  red\x00 </html>") == "<html> [31m red </html>"
    assert plain("a" * 1000) == "a" * 100 + "..."


def test_a_sentence_says_what_where_and_what_to_look_at():
    failure = {"failure": "status", "status": 404, "said": "no such\nmodel"}
    assert failed(failure, OPTIONS) == (
        "https://serverless.roboflow.com has no model shapes/1 (404: no such model); check model_id and url"
    )
    assert failed({"failure": "status", "status": 599, "said": ""}, OPTIONS) == (
        "https://serverless.roboflow.com gave no answer (599); look at its log"
    )


@pytest.mark.parametrize(
    ("repeats", "end"),
    [
        ((), "; look at its log and the network, or give it a longer deadline"),
        (
            (None, 429),
            ", which has been asked too often (429); ask less often, or look at the plan of the account",
        ),
        ((599,), ", which gave no answer (599); look at its log"),
        ((None,), ", to which there was no connection; is it running, and is url right?"),
    ],
)
def test_a_deadline_that_has_passed_is_told_with_what_the_server_said_meanwhile(repeats, end):
    assert late(repeats, OPTIONS) == f"no answer within 1.0 s from https://serverless.roboflow.com{end}"

"""Sentences about a server that gave no usable answer."""

from __future__ import annotations

from executive.vision.detectors.roboflow.complaints import failed, late, plain
from executive.vision.detectors.roboflow.options import RoboflowOptions

HOST = "https://serverless.roboflow.com"
OPTIONS = RoboflowOptions(url=f"{HOST}/", model_id="shapes/1")


def test_somebody_elses_words_become_one_short_line():
    assert plain("<html>\n\x1b[31m  red\x00 </html>") == "<html> [31m red </html>"
    assert plain("a" * 1000) == "a" * 100 + "..."


def test_a_sentence_says_what_where_and_what_to_look_at():
    refused = {"failure": "status", "status": 404, "said": "no such\nmodel"}
    assert failed(refused, OPTIONS) == (
        f"{HOST} has no model shapes/1 (404: no such model); check model_id and url"
    )
    unknown = {"failure": "status", "status": 599, "said": ""}
    assert failed(unknown, OPTIONS) == f"{HOST} gave no answer (599); look at its log"


def test_a_deadline_that_has_passed_is_told_with_what_the_server_said_meanwhile():
    for repeats, end in (
        ((), "; look at its log and the network, or give it a longer deadline"),
        (
            (None, 429),
            ", which has been asked too often (429); ask less often, or look at the plan of the account",
        ),
        ((599,), ", which gave no answer (599); look at its log"),
        ((None,), ", to which there was no connection; is it running, and is url right?"),
    ):
        assert late(repeats, OPTIONS) == f"no answer within 1.0 s from {HOST}{end}"

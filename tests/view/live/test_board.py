"""What browsers are told of a run."""

from __future__ import annotations

import base64

import cv2
import numpy as np

from executive.view.live.board import Board


def status(node: str, word: str, **more: str) -> tuple[str, dict[str, object]]:
    return "status", {"clock": 1.5, "node": node, "status": word, **more}


def test_who_comes_late_is_shown_everything_and_then_only_news() -> None:
    board = Board()
    board.take(("tree", {"mission": "sort", "svg": "<svg/>"}))
    board.take(("run", {"clock": 0.0, "mission": "sort", "seed": 7}))
    board.take(status("tree/Grasp", "RUNNING"))
    assert board.news()["tree"] == "<svg/>"
    board.take(status("tree/Grasp", "FAILURE", reason="missed", message="no seal", item="cube-1"))
    grasp = {
        "done": 0,
        "failed": 1,
        "halted": 0,
        "status": "failure",
        "said": "missed: no seal",
        "item": "cube-1",
    }
    assert board.news() == {"clock": 1.5, "nodes": {"tree/Grasp": grasp}}
    assert board.news() == {}
    everything = board.everything()
    assert everything["run"] == {"mission": "sort", "seed": 7}
    assert everything["nodes"] == {"tree/Grasp": grasp}


def test_every_end_of_a_node_is_counted() -> None:
    board = Board()
    for word in ("RUNNING", "SUCCESS", "RUNNING", "SUCCESS", "RUNNING", "INVALID"):
        board.take(status("tree", word))
    node = board.everything()["nodes"]["tree"]
    assert (node["done"], node["failed"], node["halted"], node["status"]) == (2, 0, 1, "invalid")


def test_a_question_stands_until_it_is_answered_or_the_run_ends() -> None:
    board = Board()
    for end in ("request", "end"):
        board.take(("asking", {"clock": 1.0, "choices": ["cube", "duck"]}))
        assert board.everything()["asking"] == ["cube", "duck"]
        board.take((end, {"clock": 1.0}))
        assert board.everything()["asking"] is None
    assert board.everything()["over"] is True


def test_an_image_is_shown_with_what_the_arm_hides_darker() -> None:
    board = Board()
    image = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    hidden = np.zeros((48, 64), bool)
    hidden[:, 32:] = True
    board.take(("look", {"image": image, "hidden": hidden, "frame": 3, "camera": "wrist", "found": []}))
    look = board.everything()["look"]
    assert (look["width"], look["height"], look["frame"], look["camera"]) == (64, 48, 3, "wrist")
    assert "image" not in look
    data = base64.b64decode(look["source"].removeprefix("data:image/jpeg;base64,"))
    shown = cv2.cvtColor(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.allclose(shown[24, 8], (200, 100, 50), atol=6)
    assert np.allclose(shown[24, 56], (110, 55, 27), atol=6)


def test_items_notes_and_the_end_are_kept() -> None:
    board = Board()
    board.take(("item", {"clock": 1.0, "item": "cube-1", "state": "held"}))
    board.take(("note", {"sentence": "one"}))
    board.take(("note", {"sentence": "two"}))
    board.take(("result", {"status": "SUCCESS"}))
    board.take(("poses", {"clock": 2.0, "bodies": {}}))
    everything = board.everything()
    assert everything["items"]["cube-1"]["state"] == "held"
    assert everything["notes"] == ["one", "two"]
    assert everything["result"] == {"status": "SUCCESS"}
    assert everything["clock"] == 2.0

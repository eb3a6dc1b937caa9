"""Answers of a server, checked before anybody believes them, and sentences about those that are none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from executive.cell.frame import Detection
from executive.perception.detectors.roboflow.detector import (
    RoboflowOptions,
    describe_failure,
    describe_invalid_answer,
    describe_missed_deadline,
    shorten_to_line,
)
from executive.perception.detectors.roboflow.inference_process import read_answer, read_output

CUBE = {"x": 50.0, "y": 40.0, "width": 20, "height": 10.0, "confidence": 0.9, "class": "cube", "class_id": 0}


def answer(*predictions, **further):
    return {"time": 0.1, "image": {"width": 100, "height": 80}, "predictions": list(predictions), **further}


def test_boxes_by_centre_and_size_become_boxes_by_corners_cut_off_where_they_stick_out():
    found = read_answer(answer(CUBE, {**CUBE, "x": 2.0}), (100, 80))
    assert found[0] == Detection("cube", 0.9, (40.0, 35.0, 60.0, 45.0))
    assert found[1].box == (0.0, 35.0, 12.0, 45.0)
    assert read_answer({"predictions": []}, (100, 80)) == []


UNKNOWN = answer(image={"width": None, "height": None})
PLACE = {"offset_x": 40, "offset_y": 35, "width": 100, "height": 80}
IN_CROP = {**CUBE, "x": 10, "y": 5, "parent_origin": PLACE}
NESTED = {**IN_CROP, "parent_origin": {**PLACE, "offset_x": 9, "width": 60}}
OF_CROP = answer(IN_CROP, image={"width": 30, "height": 20})


@pytest.mark.parametrize(
    ("spoilt", "text"),
    [
        (None, "of type NoneType, not an object with the key"),
        ({"foo": 1}, "predictions: field required"),
        (answer(7), r"predictions\[0\]: input should be a valid dictionary$"),
        (answer(CUBE, {**CUBE, "x": float("nan")}), r"predictions\[1\].x: input should be a finite number"),
        (answer({**CUBE, "x": "SECRET"}), r"predictions\[0\].x: input should be a valid number$"),
        (answer({**CUBE, "width": 0.0}), r"predictions\[0\].width: input should be greater than 0"),
        (answer({**CUBE, "height": float("inf")}), r"predictions\[0\].height: input should be a finite"),
        (answer({**CUBE, "confidence": 1.1}), r"predictions\[0\].confidence: .* less than or equal to 1"),
        (answer({**CUBE, "class": ""}), r"predictions\[0\].class: string should have at least 1"),
        (answer({**CUBE, "x": 4.0, "width": 30.0}), r"box from \(-11, 35\) to \(19, 45\) in an image"),
        (answer({**CUBE, "x": 96.0, "width": 30.0}), r"box from \(81, 35\) to \(111, 45\)"),
        (answer({**CUBE, "y": 4.0, "height": 26.0}), r"box from \(40, -9\) to \(60, 17\)"),
        (answer({**CUBE, "y": 76.0, "height": 26.0}), r"box from \(40, 63\) to \(60, 89\)"),
        (answer({**CUBE, "x": -5.0, "width": 8.0}), r"box from \(-9, 35\) to \(-1, 45\)"),
        (answer({**CUBE, "width": 0.1, "height": 0.2}), r"predictions\[0\] is a box of 0.1 x 0.2 pixels"),
        (answer(*[CUBE] * 301), "predictions: list should have at most 300 items"),
        (answer(CUBE, image={"width": 1, "height": 1}), "1 x 1 pixels, but the sent image has 100 x 80"),
        # Outputs of workflows
        ({"image": {"width": None, "height": 80}, "predictions": []}, r"image\.width: input should be"),
        ([NESTED], "60 x 80 pixels, but the sent image has 100 x 80"),
        ([[CUBE], []], "predictions per crop without the place of the crop"),
        ([IN_CROP, CUBE], "predictions per crop without the place of the crop"),
        (answer(IN_CROP, CUBE, image={"width": 50, "height": 40}), "50 x 40 pixels, but the sent image"),
        ([answer(CUBE, image={"width": 50, "height": 40})], "50 x 40 pixels, but the sent image"),
        ({"predictions": answer({**CUBE, "x": -30.0})}, r"box from \(-40, 35\) to \(-20, 45\)"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place_and_without_values_that_may_be_secret(spoilt, text):
    with pytest.raises(ValueError, match=text) as caught:
        read_output(spoilt, (100, 80))
    assert "SECRET" not in str(caught.value)


OUTPUTS = [
    answer(CUBE), [CUBE], {"inference_id": "1", "predictions": answer(CUBE)},
    [IN_CROP], [[IN_CROP], [], None], [OF_CROP, UNKNOWN], [{"predictions": OF_CROP}], [answer(CUBE), UNKNOWN],
    [[answer({**NESTED, "root_parent_origin": PLACE})], [None]],
    answer({**IN_CROP, "parent_origin": {"offset_x": 40, "offset_y": 35}}),
]  # fmt: skip


@pytest.mark.parametrize("output", OUTPUTS)
def test_the_output_of_a_workflow_is_read_in_every_form_also_of_crops(output):
    assert read_output(output, (100, 80)) == read_answer(answer(CUBE), (100, 80))


@pytest.mark.parametrize(("angle", "x", "y"), [(90, 5, 10), (-30, 11.16, 9.33)])
def test_an_oriented_box_becomes_the_box_around_it(angle, x, y):
    (found,) = read_answer(answer({**CUBE, "angle": angle}), (100, 80))
    assert found.box == pytest.approx((50 - x, 40 - y, 50 + x, 40 + y), abs=1e-2)
    corners = cv2.boxPoints(((50.0, 40.0), (20.0, 10.0), float(angle)))
    assert sorted(found.outline) == pytest.approx(np.array(sorted(corners.tolist())), abs=1e-4)


def test_the_polygon_of_a_mask_is_the_outline_also_in_a_crop():
    points = [{"x": 1, "y": 2.5}, {"x": 19, "y": 3}, {"x": 9, "y": 9}]
    (found,) = read_output([{**IN_CROP, "points": points, "angle": 30}], (100, 80))
    assert found.outline == ((41, 37.5), (59, 38), (49, 44))
    with pytest.raises(ValueError, match=r"predictions\[0\].points\[1\].y: input should be a finite"):
        read_answer(answer({**CUBE, "points": [points[0], {"x": 1, "y": float("nan")}]}), (100, 80))


@pytest.mark.parametrize(
    ("host", "variable", "exempt", "is_named"),
    [
        ("lab", "HTTP_PROXY", "", True), ("lab", "HTTPS_PROXY", "", False),
        ("127.lan", "HTTP_PROXY", "", True),
        ("127.0.0.1", "HTTP_PROXY", "", False), ("10.0.0.5", "HTTP_PROXY", "10.0.0.0/8", False),
    ],
)  # fmt: skip
def test_a_message_names_the_proxy_of_a_server(monkeypatch, host, variable, exempt, is_named):
    monkeypatch.setenv(variable, "http://user:SECRET@proxy:3128")
    monkeypatch.setenv("NO_PROXY", exempt)
    message = describe_failure({"failure": "refused"}, RoboflowOptions(url=f"http://{host}:9001"))
    assert ("through the proxy in HTTP_PROXY" in message, "SECRET" in message) == (is_named, False)


HOST = "https://serverless.roboflow.com"
OPTIONS = RoboflowOptions(url=f"{HOST}/", model_id="shapes/1")
WORKFLOW = RoboflowOptions(api="workflow", workspace="acme", workflow_id="sorting", workflow_output="boxes")


def test_somebody_elses_words_become_one_short_line():
    assert shorten_to_line("<html>\n\x1b[31m  red\x00 </html>") == "<html> [31m red </html>"
    assert shorten_to_line("a" * 1000) == "a" * 100 + "..."


@pytest.mark.parametrize(
    ("failure", "options", "sentence"),
    [
        ({"status": 404, "detail": "no such\nmodel"}, OPTIONS,
         "has no model shapes/1 (404: no such model); check model_id and url"),
        ({"status": 599, "detail": ""}, OPTIONS, "reported an unexpected status (599); check its log"),
        ({"status": 400, "detail": ""}, WORKFLOW,
         "rejected the request (400); check workspace and workflow_id and api"),
        ({"failure": "no output", "detail": "top"}, WORKFLOW,
         'ran workflow acme/sorting, which has no output "boxes" (top); check workflow_output'),
    ],
)  # fmt: skip
def test_a_sentence_says_what_where_and_what_to_look_at(failure, options, sentence):
    assert describe_failure(failure, options) == f"{HOST} {sentence}"


def test_an_impossible_answer_is_reported_with_the_advice_to_check():
    assert "sent an invalid answer: no box; is shapes/1 a" in describe_invalid_answer("no box", OPTIONS)
    assert 'no box; is "boxes" the predictions' in describe_invalid_answer("no box", WORKFLOW)


@pytest.mark.parametrize(
    ("repeats", "end"),
    [
        ((), "; check its log and the network, or increase deadline"),
        ((None, 429), ", which received too many requests (429); reduce the request rate"),
        ((None,), ", which is not reachable; check that the server is running"),
    ],
)
def test_a_passed_deadline_is_reported_with_the_answers_of_the_server(repeats, end):
    assert describe_missed_deadline(repeats, OPTIONS).startswith(f"no answer within 1.0 s from {HOST}{end}")

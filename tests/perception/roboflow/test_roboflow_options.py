"""What a cell file says about a Roboflow model, and where the key comes from."""

from __future__ import annotations

import pytest

from executive.cell.config import DetectorConfig
from executive.errors import InputError
from executive.perception.detectors.roboflow.detector import RoboflowDetector, RoboflowOptions
from executive.perception.detectors.roboflow.inference_process import ApiKey

SECRET = "SECRET1234567890"


def configured(**options):
    return DetectorConfig(kind="roboflow", **{"model_id": "shapes/1", **options})


@pytest.mark.parametrize(
    ("options", "option", "text"),
    [
        (
            {"model_id": ""},
            "model_id",
            "^api: auto needs model_id: project/version, or a name such as rfdetr-",
        ),
        ({"model_id": "a b"}, "model_id", "^model_id must be a name or project/version, without"),
        (
            {"workflow_id": "a"},
            "workflow_id",
            "^api: auto does not use workflow_id; write api: workflow, or d",
        ),
        (
            {"api": "v1", "workflow_output": "boxes", "workspace": "acme"},
            "workspace",
            "^api: v1 does not use workspace, workflow_output; write .* delete workspace, workflow_output$",
        ),
        (
            {"api": "workflow", "workspace": "acme"},
            "workflow_id",
            "^api: workflow needs workspace and workflow_id; workflow_id is missing$",
        ),
        ({"api": "workflow", "workflow_id": "a"}, "workspace", "workflow_id; workspace is missing$"),
        (
            {"api": "workflow", "workspace": "acme", "workflow_id": "a/b"},
            "workflow_id",
            "^workflow_id must be a name without /, ",
        ),
        (
            {"api": "workflow", "workspace": "acme", "workflow_id": "a", "workflow_output": ""},
            "workflow_output",
            "at least 1 character",
        ),
        ({"model_id": "shapes/", "api": "v0"}, "model_id", 'project/version for v0, or .*, not "shapes/"'),
        ({"model_id": "a/b/c", "api": "v0"}, "model_id", 'project/version for v0, or .*, not "a/b/c"'),
        ({"api": "v2"}, "api", "'auto', 'v0', 'v1' or 'workflow'"),
        ({"url": "127.0.0.1:9001"}, "url", "an address such as http://127.0.0.1:9001"),
        ({"url": "ftp://there"}, "url", "an address such as"),
        ({"url": "http://"}, "url", "an address such as"),
        ({"url": "http://there:port"}, "url", "an address such as"),
        ({"url": f"http://there?api_key={SECRET}"}, "url", "a user, query or fragment; .*ROBOFLOW_API_KEY"),
        ({"url": f"http://me:{SECRET}@there"}, "url", "a user, query or fragment"),
        ({"deadline": 0}, "deadline", "greater than 0"),
        ({"deadline": 61}, "deadline", "less than or equal to 60"),
        ({"class_map": {"a": 1}}, "class_map", "valid string"),
        (
            {"labels": ["a"], "class_map": {"b": "cube"}},
            "class_map",
            "contains b, .* the model are a$",
        ),
        ({"full": "half"}, "full", "'whole' or 'tiles'"),
        ({"colour": 1}, "colour", "not permitted; the options are model_id"),
        (
            {"api_key": SECRET},
            "api_key",
            "does not belong in a cell file.*set the environment variable ROBOFL",
        ),
        ({"Token": SECRET}, "Token", "does not belong in a cell file"),
    ],
)
def test_a_wrong_option_is_said_in_a_sentence_that_tells_no_secret(tmp_path, options, option, text):
    ((found, sentence),) = RoboflowDetector.check(configured(**options), tmp_path, {})
    assert found == option
    assert SECRET not in sentence
    with pytest.raises(InputError, match=text) as caught:
        RoboflowDetector.from_config(configured(**options), None)
    assert str(caught.value) == sentence


def test_addresses_of_servers_are_right_and_the_hosted_service_is_asked_without_one(tmp_path):
    for url in ("http://127.0.0.1:9001", "https://serverless.roboflow.com/", "http://[::1]:9001"):
        assert list(RoboflowDetector.check(configured(url=url), tmp_path, {})) == []
    assert RoboflowOptions(model_id="shapes/1").url == "https://serverless.roboflow.com"


def test_a_workflow_needs_two_names_and_takes_a_model_id_from_a_base(tmp_path):
    names = {"api": "workflow", "workspace": "acme", "workflow_id": "sorting"}
    assert list(RoboflowDetector.check(configured(**names), tmp_path, {})) == []
    assert list(RoboflowDetector.check(DetectorConfig(kind="roboflow", **names), tmp_path, {})) == []


def test_the_classes_are_known_where_labels_are_given(tmp_path):
    given = configured(labels=["ball", "cube"], class_map={"ball": "sphere"})
    assert RoboflowDetector.labels(given, tmp_path) == ("sphere", "cube")
    assert RoboflowDetector.labels(configured(class_map={"ball": "sphere"}), tmp_path) is None
    assert RoboflowDetector.labels(configured(labels=["ball"], api="v2"), tmp_path) is None


def test_a_key_is_hidden_wherever_it_stands():
    key = ApiKey({"ROBOFLOW_API_KEY": SECRET})
    assert key.redact(f"?api_key={SECRET}&x and {SECRET}") == "?api_key=***&x and ***"
    assert repr(key) == "ApiKey(***)"
    assert key.is_set
    odd = ApiKey({"ROBOFLOW_API_KEY": 'SECRET"\\12345'})
    assert odd.redact(r'{"said": "SECRET\"\\12345"}') == '{"said": "***"}'
    # A stand-in for a key is no secret.
    assert ApiKey({"ROBOFLOW_API_KEY": "x"}).redact('{"x": 1}') == '{"x": 1}'
    assert not ApiKey({}).is_set

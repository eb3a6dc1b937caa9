"""What a cell file says about a Roboflow model, and where the key comes from."""

from __future__ import annotations

import pytest

from executive.cell.config import DetectorConfig
from executive.errors import InputError
from executive.perception.detectors.roboflow.detector import RoboflowDetector
from executive.perception.detectors.roboflow.inference_process import ApiKey

SECRET = "SECRET1234567890"


def configure(**options):
    return DetectorConfig(kind="roboflow", **{"model_id": "shapes/1", **options})


WORKFLOW = {"api": "workflow", "workspace": "acme", "workflow_id": "sorting"}


@pytest.mark.parametrize(
    ("options", "option", "text"),
    [
        ({"model_id": ""}, "model_id", "^api: auto needs model_id"),
        ({"model_id": "a b"}, "model_id", "^model_id must be a name or project/version, without"),
        ({"workflow_id": "a"}, "workflow_id", "^api: auto does not use workflow_id; write api: workflow"),
        ({**WORKFLOW, "api": "v1"}, "workspace", "^api: v1 does not use workspace, workflow_id; write"),
        (
            {**WORKFLOW, "workflow_id": ""},
            "workflow_id",
            "workspace and workflow_id; workflow_id is missing$",
        ),
        ({**WORKFLOW, "workspace": ""}, "workspace", "workflow_id; workspace is missing$"),
        ({**WORKFLOW, "workflow_id": "a/b"}, "workflow_id", "^workflow_id must be a name without /, "),
        ({**WORKFLOW, "workflow_output": ""}, "workflow_output", "at least 1 character"),
        ({"model_id": "shapes/", "api": "v0"}, "model_id", 'project/version for v0, or .*, not "shapes/"'),
        ({"model_id": "a/b/c", "api": "v0"}, "model_id", 'project/version for v0, or .*, not "a/b/c"'),
        ({"url": "127.0.0.1:9001"}, "url", "an address such as http://127.0.0.1:9001"),
        ({"url": "ftp://there"}, "url", "an address such as"),
        ({"url": "http://"}, "url", "an address such as"),
        ({"url": "http://there:port"}, "url", "an address such as"),
        ({"url": f"http://there?api_key={SECRET}"}, "url", "a user, query or fragment; .*ROBOFLOW_API_KEY"),
        ({"url": f"http://me:{SECRET}@there"}, "url", "a user, query or fragment"),
        ({"deadline": 0}, "deadline", "greater than 0"),
        ({"deadline": 61}, "deadline", "less than or equal to 60"),
        ({"labels": ["a"], "class_map": {"b": "cube"}}, "class_map", "contains b, .* the model are a$"),
        ({"colour": 1}, "colour", "not permitted; the options are model_id"),
        ({"api_key": SECRET}, "api_key", "does not belong in a cell file.*the environment variable ROBOFL"),
        ({"Token": SECRET}, "Token", "does not belong in a cell file"),
    ],
)
def test_a_wrong_option_is_said_in_a_sentence_that_tells_no_secret(tmp_path, options, option, text):
    ((found, sentence),) = RoboflowDetector.check(configure(**options), tmp_path, {})
    assert found == option
    assert SECRET not in sentence
    with pytest.raises(InputError, match=text) as caught:
        RoboflowDetector.from_config(configure(**options), None)
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    "options",
    [{"url": "http://127.0.0.1:9001"}, {"url": "http://[::1]:9001"}, {}, {**WORKFLOW, "model_id": ""}],
)
def test_addresses_and_workflows_are_right(tmp_path, options):
    assert list(RoboflowDetector.check(configure(**options), tmp_path, {})) == []


def test_the_classes_are_known_where_labels_are_given(tmp_path):
    given = configure(labels=["ball", "cube"], class_map={"ball": "sphere"})
    assert RoboflowDetector.labels(given, tmp_path) == ("sphere", "cube")
    assert RoboflowDetector.labels(configure(class_map={"ball": "sphere"}), tmp_path) is None
    assert RoboflowDetector.labels(configure(labels=["ball"], api="v2"), tmp_path) is None


def test_a_key_is_hidden_wherever_it_stands():
    key = ApiKey({"ROBOFLOW_API_KEY": SECRET})
    assert key.redact(f"?api_key={SECRET}&x and {SECRET}") == "?api_key=***&x and ***"
    assert (repr(key), key.is_set, ApiKey({}).is_set) == ("ApiKey(***)", True, False)
    odd = ApiKey({"ROBOFLOW_API_KEY": 'SECRET"\\12345'})
    assert odd.redact(r'{"said": "SECRET\"\\12345"}') == '{"said": "***"}'
    # A stand-in for a key is no secret.
    assert ApiKey({"ROBOFLOW_API_KEY": "x"}).redact('{"x": 1}') == '{"x": 1}'

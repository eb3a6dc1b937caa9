"""What `executive doctor` says of an installation."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from executive.cli.doctor import command


@pytest.mark.parametrize(
    ("key", "sentence"),
    [
        ("SECRET1234567890", "ROBOFLOW_API_KEY is set"),
        ("", "ROBOFLOW_API_KEY is not set; models that Roboflow hosts want it"),
    ],
)
def test_it_says_whether_there_is_a_key_and_never_which(key: str, sentence: str) -> None:
    ended = CliRunner().invoke(command, env={"ROBOFLOW_API_KEY": key})
    assert sentence in ended.output.splitlines()
    assert "SECRET" not in ended.output

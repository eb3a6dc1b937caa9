"""Which detectors are installed, and what is known of them before a run."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import pytest

from executive.cell_config import DetectorConfig
from executive.errors import InputError
from executive.vision.detectors import registry
from executive.vision.detectors.registry import build_detectors, known_labels, wrong_detectors


class Oracle:
    """A kind of detector that says nothing about itself."""


@pytest.fixture
def oracle_installed(monkeypatch):
    """The kind `oracle` is installed beside the shipped ones."""
    found = registry.installed()
    oracle = EntryPoint("oracle", f"{__name__}:Oracle", registry.GROUP)
    monkeypatch.setattr(registry, "installed", lambda: {**found, "oracle": oracle})


def test_a_kind_that_is_not_installed_is_found_before_and_at_the_start(tmp_path):
    configs = {"first": DetectorConfig(kind="embedded"), "second": DetectorConfig(kind="yolo")}
    sentence = 'detector "second" is of kind "yolo", which is not installed; installed: embedded, rfdetr'
    assert list(wrong_detectors(configs, tmp_path)) == [(("detectors", "second", "kind"), sentence)]
    with pytest.raises(InputError) as caught:
        build_detectors({"second": configs["second"]}, camera=None, clock=None, base=tmp_path)
    assert str(caught.value) == sentence


def test_a_wrong_option_is_found_at_its_key(tmp_path):
    configs = {"mine": DetectorConfig(kind="rfdetr", model_path="m.onnx", labels=["cube"])}
    ((keys, sentence),) = wrong_detectors(configs, tmp_path)
    assert keys == ("detectors", "mine", "model_path")
    assert sentence.startswith(f"there is no model file {tmp_path / 'm.onnx'}; check the path")


def test_the_labels_of_a_kind_that_does_not_say_them_are_not_known(tmp_path, oracle_installed):
    kinds = ("embedded", "oracle", "yolo")
    configs = {kind: DetectorConfig(kind=kind) for kind in kinds}
    known = known_labels(configs, tmp_path)
    assert list(known) == list(kinds)
    assert set(known["embedded"]) == {"cube", "sphere", "duck"}
    assert known["oracle"] is known["yolo"] is None
    assert [keys for keys, _ in wrong_detectors(configs, tmp_path)] == [("detectors", "yolo", "kind")]

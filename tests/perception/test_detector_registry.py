"""Which detectors are installed, and what is known of them before a run."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import ClassVar

import pytest

from executive.cell.config import DetectorConfig
from executive.errors import InputError
from executive.perception.detectors import detector_registry
from executive.perception.detectors.detector_registry import build_kinds, find_detector_errors

INSTALLED = ", ".join(sorted(detector_registry.find_detector_kinds()))


class Oracle:
    """A kind of detector of somebody else's, that says nothing about itself."""

    made: ClassVar = []

    def __init__(self, config, context):
        self.config, self.context, self.closed = config, context, False
        self.other = context.get_detector(config.options["beside"]) if "beside" in config.options else None
        Oracle.made.append(self)
        if config.options.get("broken"):
            raise InputError("it is broken")

    @classmethod
    def from_config(cls, config, context):
        return cls(config, context)

    def detect(self, frame, view):
        return []

    def close(self):
        self.closed = True


class Former:
    """A kind of detector of a former version."""

    def request(self, frame, view):
        raise NotImplementedError


def oracle(**options):
    return DetectorConfig(kind="oracle", **options)


def build(base=None, **configs):
    return build_kinds(configs, camera=None, cell_folder=base, seed=7)


@pytest.fixture
def oracle_installed(monkeypatch):
    """The kinds `oracle` and `former` are installed beside the shipped ones."""
    found = detector_registry.find_detector_kinds()
    own = {
        kind.__name__.lower(): EntryPoint(kind.__name__, f"{__name__}:{kind.__name__}", "executive.detectors")
        for kind in (Oracle, Former)
    }
    monkeypatch.setattr(detector_registry, "find_detector_kinds", lambda: {**found, **own})
    monkeypatch.setattr(Oracle, "made", [])


def test_a_kind_that_is_not_installed_is_found_before_and_at_the_start(tmp_path):
    configs = {"first": DetectorConfig(kind="embedded"), "second": DetectorConfig(kind="yolo")}
    sentence = f'detector "second" is of kind "yolo", which is not installed; installed: {INSTALLED}'
    assert list(find_detector_errors(configs, tmp_path)) == [(("detectors", "second", "kind"), sentence)]
    with pytest.raises(InputError, match='"yolo", which is not installed'):
        build(second=configs["second"])


def test_detectors_are_built_once_in_the_order_of_the_file(oracle_installed, tmp_path):
    built = build(tmp_path, first=oracle(beside="second"), second=oracle())
    assert list(built) == ["first", "second"]
    context = built["first"].context
    assert (context.name, context.cell_folder, context.seed) == ("first", tmp_path, 7)
    assert built["first"].other is built["second"]
    assert len(Oracle.made) == 2


@pytest.mark.parametrize(
    ("beside", "text"),
    [("a", "the detectors a -> b -> a depend on each other"), ("c", 'no detector "c"; it has: a, b')],
)
def test_a_detector_cannot_rest_on_itself_or_on_nobody(oracle_installed, beside, text):
    with pytest.raises(InputError, match=text):
        build(a=oracle(beside="b"), b=oracle(beside=beside))


def test_where_one_cannot_be_built_the_others_are_closed(oracle_installed):
    with pytest.raises(InputError, match="it is broken"):
        build(a=oracle(), b=oracle(broken=True))
    assert Oracle.made[0].closed


def test_a_kind_that_has_no_method_detect_is_told_what_to_write(oracle_installed, tmp_path):
    configs = {"eye": DetectorConfig(kind="former")}
    ((place, message),) = find_detector_errors(configs, tmp_path)
    assert place == ("detectors", "eye", "kind")
    with pytest.raises(
        InputError, match=r"no method `detect` .*; replace `request` by `detect\(frame, view\)`"
    ) as caught:
        build(**configs)
    assert str(caught.value) == message

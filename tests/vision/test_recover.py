"""From an exported model back to the checkpoint it was made from, where the extra `train` is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executive.errors import InputError
from executive.vision.detectors.embedded import MODEL

onnx = pytest.importorskip("onnx")
pytest.importorskip("torch")


def test_the_shipped_model_comes_back_bit_for_bit_when_it_is_exported_again(tmp_path: Path) -> None:
    from executive.vision.training.compress import widened
    from executive.vision.training.export import export_onnx
    from executive.vision.training.recover import recover

    recover(MODEL, tmp_path / "start.pth")
    export_onnx(tmp_path / "start.pth", 3, tmp_path / "again.onnx", None)
    before, after = (widened(onnx.load(str(path))) for path in (MODEL, tmp_path / "again.onnx"))
    assert before.keys() == after.keys()
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_a_model_of_another_architecture_is_refused(tmp_path: Path) -> None:
    from executive.vision.training.recover import recover

    helper, weight = onnx.helper, np.ones((4, 4), np.float32)
    node = helper.make_node("MatMul", ["x", "weight"], ["y"])
    ports = [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [4, 4]) for name in ("x", "y")]
    graph = helper.make_graph(
        [node], "other", ports[:1], ports[1:], [onnx.numpy_helper.from_array(weight, "weight")]
    )
    onnx.save(helper.make_model(graph), str(tmp_path / "other.onnx"))
    with pytest.raises(InputError, match=r"other\.onnx is of another architecture than the small RF-DETR"):
        recover(tmp_path / "other.onnx", tmp_path / "start.pth")


def test_what_is_no_onnx_file_is_refused(tmp_path: Path) -> None:
    from executive.vision.training.recover import recover

    (tmp_path / "other.onnx").write_text("weights")
    with pytest.raises(InputError, match=r"other\.onnx is no ONNX file"):
        recover(tmp_path / "other.onnx", tmp_path / "start.pth")


def test_a_checkpoint_is_started_from_as_it_is(tmp_path: Path) -> None:
    from executive.vision.training.start import checkpoint

    assert checkpoint(None, tmp_path) is None
    assert checkpoint(tmp_path / "old.pth", tmp_path) == tmp_path / "old.pth"


def test_steps_are_smaller_the_more_is_known(tmp_path: Path) -> None:
    from executive.vision.training.start import learning_rate

    assert learning_rate(None, ["cube"]) == 3e-4
    assert learning_rate(MODEL, ["bolt", "nut", "washer"]) == 3e-4
    assert learning_rate(MODEL, ["cube", "sphere", "duck"]) == 1e-4
    (tmp_path / "labels.txt").write_text("bolt\nnut\n")
    assert learning_rate(tmp_path / "checkpoint_best_total.pth", ["bolt", "nut"]) == 1e-4
    assert learning_rate(tmp_path / "checkpoint_best_total.pth", ["nut", "bolt"]) == 3e-4

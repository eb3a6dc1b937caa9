"""Training: what is refused, its card, and the parts that need torch or onnx, where they are installed."""

from __future__ import annotations

import importlib.util
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from executive.errors import InputError
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations
from executive.training.evaluation.metrics import Distribution, Evaluation
from executive.training.train import read_epochs, render_card
from executive.training.train import Settings, choose_learning_rate, load_dataset, train


def test_a_training_that_cannot_start_is_refused(tmp_path):
    with pytest.raises(InputError, match="split train contains no labelled images"):
        load_dataset(tmp_path)
    with pytest.raises(InputError, match=r"no model .*old\.pth to start from"):
        train({}, tmp_path / "out", Settings(tmp_path / "old.pth"))


def test_a_training_goes_on_in_smaller_steps_if_the_checkpoint_knows_its_labels(tmp_path):
    start = tmp_path / "checkpoint_best_total.pth"
    assert choose_learning_rate(None, ["bolt"]) == choose_learning_rate(start, ["bolt", "nut"]) == 3e-4
    (tmp_path / "labels.txt").write_text("bolt\nnut\n")
    assert (choose_learning_rate(start, ["bolt", "nut"]), choose_learning_rate(start, ["nut", "bolt"])) == (
        1e-4,
        3e-4,
    )


@pytest.mark.skipif(importlib.util.find_spec("torch") is not None, reason="the extra is installed")
def test_training_without_the_extra_says_how_to_install_it(tmp_path):
    for split in ("train", "valid"):
        save_image(build_image_path(tmp_path, "coco", split, "a.jpg"), np.zeros((64, 64, 3), np.uint8))
    boxes = ((10.0, 10.0, 30.0, 30.0),)
    entries = [DatasetEntry(split, "a.jpg", (64, 64), ("cube",), boxes) for split in ("train", "valid")]
    write_annotations(tmp_path, "coco", entries, ["cube"])
    with pytest.raises(
        InputError,
        match='package "torch"; install the extra, about 3 GB to download on Linux: uv sync --extra train',
    ):
        train(load_dataset(tmp_path), tmp_path / "out", Settings())
    assert not (tmp_path / "out").exists()


def test_a_training_tells_of_every_batch_and_of_every_epoch(monkeypatch):
    lightning = ModuleType("pytorch_lightning")
    lightning.Callback = object
    monkeypatch.setitem(sys.modules, "pytorch_lightning", lightning)
    # What is loaded with the stand-in is not to be found by anybody else.
    monkeypatch.setitem(sys.modules, "executive.training.progress_reporter", None)
    del sys.modules["executive.training.progress_reporter"]
    from executive.training.progress_reporter import ProgressReporter

    reported = []
    report = ProgressReporter(lambda *epoch: reported.append(epoch), lambda *batch: reported.append(batch))
    trainer = SimpleNamespace(max_epochs=2, num_training_batches=3, callback_metrics={"loss": 1})
    for trainer.current_epoch in range(2):
        for batch in range(3):
            report.on_train_batch_end(trainer, None, None, None, batch)
        report.on_train_epoch_end(trainer, None)
    one, two = (1, {"loss": 1.0}), (2, {"loss": 1.0})
    assert reported == [(1, 6), (2, 6), (3, 6), one, (4, 6), (5, 6), (6, 6), two]


def test_the_labels_of_an_exported_model_lie_beside_it_under_its_name(tmp_path):
    (tmp_path / "embedded.labels.txt").write_text("bolt\n")
    assert choose_learning_rate(tmp_path / "embedded.onnx", ["bolt"]) == 1e-4


def test_a_model_restored_from_its_export_gives_the_same_answers(tmp_path):
    pytest.importorskip("torch")
    onnx = pytest.importorskip("onnx")
    import onnxruntime

    from executive.perception.detectors.embedded import MODEL_PATH
    from executive.training.compress import export_model
    from executive.training.restore import restore_model

    onnx.save(export_model(restore_model(MODEL_PATH), tmp_path), str(tmp_path / "again.onnx"))
    image = np.random.default_rng(0).normal(size=(1, 3, 256, 256)).astype(np.float32)
    first, again = (onnxruntime.InferenceSession(str(path)) for path in (MODEL_PATH, tmp_path / "again.onnx"))
    (name,) = (one.name for one in first.get_inputs())
    for ours, theirs in zip(first.run(None, {name: image}), again.run(None, {name: image}), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-5)


@pytest.mark.parametrize("element", range(8))
def test_each_of_eight_symmetries_moves_boxes_with_the_pixels(element):
    torch = pytest.importorskip("torch")
    from executive.training.architecture import declare_missing_operators

    declare_missing_operators()
    pytest.importorskip("rfdetr")
    from executive.training.lightning import SYMMETRY_COUNT, transform_boxes, transform_image

    square = torch.arange(16.0).reshape(4, 4)
    others = [transform_image(square, other) for other in range(SYMMETRY_COUNT) if other != element]
    assert not any(torch.equal(transform_image(square, element), other) for other in others)
    image = torch.zeros(3, 64, 64)
    image[:, 10:20, 30:50] = 1
    box = torch.tensor([[40, 15, 20, 10]]) / 64
    rows, columns = np.nonzero(transform_image(image, element)[0].numpy())
    x, y, width, height = (transform_boxes(box, element)[0] * 64).tolist()
    assert (columns.min(), columns.max() + 1) == pytest.approx((x - width / 2, x + width / 2))
    assert (rows.min(), rows.max() + 1) == pytest.approx((y - height / 2, y + height / 2))
    assert transform_boxes(torch.zeros(0, 4), element).shape == (0, 4)


def test_narrow_weights_are_smaller_and_give_nearly_the_same_outputs():
    onnx = pytest.importorskip("onnx")
    import onnxruntime

    from executive.training.compress import compress_weights

    rng = np.random.default_rng(0)
    weights = {"wide": (64, 128), "transposed": (32, 128), "added": (64, 32)}
    nodes = [
        onnx.helper.make_node("MatMul", ["x", "wide"], ["hidden"]),
        onnx.helper.make_node("Gemm", ["hidden", "transposed"], ["z"], transB=1),
        onnx.helper.make_node("Add", ["z", "added"], ["y"]),
    ]
    graph = onnx.helper.make_graph(
        nodes,
        "tiny",
        [onnx.helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [64, 64])],
        [onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [64, 32])],
        [
            onnx.numpy_helper.from_array(rng.normal(size=shape).astype(np.float32), name)
            for name, shape in weights.items()
        ],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=10)
    small = compress_weights(model)
    stored = {one.name: one.data_type for one in small.graph.initializer}
    kinds = onnx.TensorProto
    assert (stored["wide_int8"], stored["transposed_int8"], stored["added_half"]) == (
        kinds.INT8, kinds.INT8, kinds.FLOAT16,
    )  # fmt: skip
    x = rng.normal(size=(64, 64)).astype(np.float32)
    runs = [
        onnxruntime.InferenceSession(one.SerializeToString()).run(None, {"x": x})[0] for one in (model, small)
    ]
    assert small.ByteSize() < 0.35 * model.ByteSize()
    assert runs[1] == pytest.approx(runs[0], abs=2e-2 * float(np.abs(runs[0]).max()))
    assert not np.array_equal(*runs)


EVALUATION = Evaluation(
    threshold=0.5, images=300, objects=900, precision=0.991, recall=0.99, map50=0.995, map50_95=0.8,
    centre=Distribution(0.6, 1.5, 2.9, 5.0),
)  # fmt: skip


def test_epochs_are_put_together_from_the_rows_a_trainer_spreads_them_over(tmp_path):
    path = tmp_path / "metrics.csv"
    path.write_text(
        "epoch,step,train/loss,train/lr,val/mAP_50,val/mAP_50_95\n"
        "0,49,,0.1,,\n0,99,,,0.5,0.25\n0,99,6.5,,,\n1,199,,,0.75,0.5\n1,199,4.5,,,\n"
    )
    assert read_epochs(path) == [
        {"train/loss": 6.5, "val/mAP_50": 0.5, "val/mAP_50_95": 0.25},
        {"train/loss": 4.5, "val/mAP_50": 0.75, "val/mAP_50_95": 0.5},
    ]


def test_a_card_states_settings_and_figures():
    text = render_card(
        title="Small model",
        summary="Finds cubes.",
        settings={"seed": "1"},
        epochs=[{"train/loss": 6.5, "val/mAP_50": 0.5}],
        accuracy=EVALUATION,
    )
    assert text.startswith("# Small model\n\nFinds cubes.\n")
    assert "| seed | 1 |" in text
    assert (
        "| validation images | 300 | 900 | 0.9910 | 0.9900 | 0.9950 | 0.8000 | 0.60 / 1.50 / 2.90 |  |"
        in text
    )
    assert "at confidence 0.5" in text
    assert "| 1 | 6.5000 | 0.5000 |  |  |  |" in text

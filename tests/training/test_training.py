"""Training: what is refused, its card, and the parts that need torch, where it is installed."""

from __future__ import annotations

import numpy as np
import pytest

from executive.errors import InputError
from executive.training.metrics import Distribution, Evaluation
from executive.training.train import choose_learning_rate, load_dataset, read_epochs, render_card, train


def test_a_training_that_cannot_start_is_refused(tmp_path):
    with pytest.raises(InputError, match="split train contains no labelled images"):
        load_dataset(tmp_path)
    with pytest.raises(InputError, match=r"no model .*old\.pth to start from"):
        train({}, tmp_path / "out", start_model=tmp_path / "old.pth")


def test_a_training_goes_on_in_smaller_steps_if_the_start_model_has_the_same_labels(tmp_path):
    start = tmp_path / "checkpoint_best_total.pth"
    assert choose_learning_rate(None, ["bolt"]) == choose_learning_rate(start, ["bolt", "nut"]) == 3e-4
    (tmp_path / "labels.txt").write_text("bolt\nnut\n")
    assert choose_learning_rate(start, ["bolt", "nut"]) == 1e-4
    assert choose_learning_rate(start, ["nut", "bolt"]) == 3e-4
    (tmp_path / "embedded.labels.txt").write_text("bolt\n")
    assert choose_learning_rate(tmp_path / "embedded.onnx", ["bolt"]) == 1e-4


def test_a_model_restored_from_its_export_gives_the_same_answers(tmp_path):
    pytest.importorskip("rfdetr")
    import onnx
    import onnxruntime

    from executive.perception.detectors.rfdetr import MODEL_PATH
    from executive.training.model import compress_weights, export_model, restore_model

    exported = export_model(restore_model(MODEL_PATH), tmp_path)
    onnx.save(exported, str(tmp_path / "again.onnx"))
    image = np.random.default_rng(0).normal(size=(1, 3, 256, 256)).astype(np.float32)
    first, again = (onnxruntime.InferenceSession(str(path)) for path in (MODEL_PATH, tmp_path / "again.onnx"))
    (name,) = (one.name for one in first.get_inputs())
    for ours, theirs in zip(first.run(None, {name: image}), again.run(None, {name: image}), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-5)
    assert compress_weights(exported).ByteSize() < 0.35 * exported.ByteSize()


@pytest.mark.parametrize("element", range(8))
def test_each_of_eight_symmetries_moves_boxes_with_the_pixels(element):
    pytest.importorskip("rfdetr")
    import torch

    from executive.training.model import SYMMETRY_COUNT, transform_boxes, transform_image

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
    centre = Distribution(0.6, 1.5, 2.9, 3.4)
    accuracy = Evaluation(900, 0.991, 0.99, 0.5, 300, 0.995, 0.8, centre=centre)
    epochs = [{"train/loss": 6.5, "val/mAP_50": 0.5}]
    text = render_card("Small model", "Finds cubes.", {"seed": "1"}, epochs, accuracy)
    assert text.startswith("# Small model\n\nFinds cubes.\n")
    assert "| seed | 1 |" in text
    assert "| 300 | 900 | 0.9910 | 0.9900 | 0.9950 | 0.8000 | 0.60 / 1.50 / 2.90 |  |" in text
    assert "at confidence 0.5" in text
    assert "| 1 | 6.5000 | 0.5000 |  |  |  |" in text

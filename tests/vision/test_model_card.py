"""The text that goes with a trained model."""

from __future__ import annotations

from executive.vision.evaluation.figures import Evaluation, Spread
from executive.vision.model_card import ModelCard, read_epochs

EVALUATION = Evaluation(
    threshold=0.5, images=300, objects=900, precision=0.991, recall=0.99, map50=0.995, map50_95=0.8,
    centre=Spread(0.6, 1.5, 2.9, 5.0),
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
    text = ModelCard(
        title="Small model",
        summary="Finds cubes.",
        settings={"seed": "1"},
        epochs=[{"train/loss": 6.5, "val/mAP_50": 0.5}],
        measured={"overhead": EVALUATION},
    ).text()
    assert text.startswith("# Small model\n\nFinds cubes.\n")
    assert "| seed | 1 |" in text
    assert "| overhead | 300 | 900 | 0.9910 | 0.9900 | 0.9950 | 0.8000 | 0.60 / 1.50 / 2.90 |  |" in text
    assert "at confidence 0.5" in text
    assert "| 1 | 6.5000 | 0.5000 |  |  |  |" in text

"""What is printed of a detector's figures."""

from __future__ import annotations

import pytest

from executive.campaign.evaluation import list_metrics
from executive.cli.shared import print_report
from executive.training.metrics import ClassMetrics, CountedRate, Distribution, Evaluation, MeasuredErrorRates

MEASURED = Evaluation(
    threshold=0.5, images=300, objects=900, precision=0.991, recall=0.98, map50=0.995, map50_95=0.8,
    latency=Distribution(15, 16, 17, 18),
    by_class={"cube": ClassMetrics(900, 0.991, 0.98)},
    confusion={"cube": {"cube": 882, "nothing": 18}, "nothing": {"cube": 8, "nothing": 0}},
    answered_by={"eye": 300},
    reliability=MeasuredErrorRates(
        CountedRate.estimate_proportion(2, 800),
        CountedRate.estimate_proportion(0, 798),
        CountedRate.estimate_mean_count(8, 300),
        jitter=0.5, repeated=0.8, bias=0.001,
    ),
)  # fmt: skip


@pytest.fixture
def printed(capsys):
    """A function that prints figures and returns the lines, their inner space collapsed."""

    def lines(evaluation):
        print_report(list_metrics("overhead", "eye", evaluation))
        captured = capsys.readouterr()
        assert captured.out == ""
        return [" ".join(line.split()) for line in captured.err.splitlines()]

    return lines


def test_rates_classes_and_confusions_are_printed(printed):
    lines = printed(MEASURED)
    assert lines[0] == "overhead, detector eye"
    assert set(lines) >= {
        "900 objects on 300 images, threshold 0.5",
        "precision 99.10%, recall 98.00%, mAP50 0.9950, mAP50-95 0.8000",
        "cube 900 99.10% 98.00%", "true \\ detected cube nothing", "cube 882 18", "nothing 8",
        "time from frame to detections [ms] 15.00 16.00 17.00 18.00",
        "miss_rate 0.0079, confusion_rate 0.0038, false_detections 0.049, "
        "jitter 0.5, repeated 0.8, bias 0.001",
    }  # fmt: skip
    assert not any("unavailable" in line for line in lines)

"""`executive sweep` in a process of its own, interrupted long before its last seed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_it_says_at_once_that_it_halts_and_then_how_far_it_came(tmp_path: Path, how: signal.Signals) -> None:
    words = ["sweep", "sort_fruit", "--seeds", "1-400", "--workers", "1", "--json", "--runs", str(tmp_path)]
    # What a shell runs in the background begins with SIGINT ignored, and so does what this test starts there.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    command = [sys.executable, "-c", f"{listening}; from executive.cli.main import main; main()", *words]
    sweep = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with sweep:
        while not list(tmp_path.glob("*/*/result.json")):
            assert sweep.poll() is None
            time.sleep(0.02)
        sweep.send_signal(how)
        shown, said = sweep.communicate()
    assert sweep.returncode == 130
    figures = json.loads(shown)
    assert (figures["asked"], figures["cut_off"]) == (400, True)
    assert 1 <= figures["runs"] < 400
    halting, summary = said.index("halting: no new runs start"), said.index(" of 400 runs, halted; ")
    assert halting < summary
    assert f"{figures['runs']} of 400 runs, halted; {figures['succeeded']} of them succeeded" in said

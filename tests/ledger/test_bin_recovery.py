"""Objects that a resumed run finds in the bins are items of the ledger."""

from __future__ import annotations

from ledger_bench import Bench


def test_each_object_in_a_forbidden_bin_is_an_item(bench: Bench) -> None:
    bench.look(("sphere", 0.5, 0.0))
    bench.ledger.record_grasp("sphere-1")
    bench.ledger.record_interruption()
    bench.look(("sphere", 0.2, -0.44), ("sphere", 0.22, -0.39), view="full")
    bench.ledger.record_bin_contents()
    reason = "found in red_bin when the run was resumed"
    assert [row.reason for row in bench.ledger.list_items()] == [reason, reason]
    assert {state for state, _ in bench.end().values()} == {"rejected"}

"""What falls on its way is sought in the bins, and believed there where it came down."""

from __future__ import annotations

import numpy as np
import pytest
from ledger_bench import Bench

OVER = np.array([0.2, -0.44, 0.025])
"""The middle of the red bin, which no part of the image below shows."""


def dropped(bench: Bench, landing: np.ndarray | None) -> dict[str, object]:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1", landing)
    for _ in range(3):
        bench.look()
    bench.ledger.close()
    (row,) = bench.ledger.rows()
    return row


def test_what_came_down_in_its_bin_is_there_though_no_look_shows_it(bench: Bench) -> None:
    row = dropped(bench, OVER)
    assert (row["state"], row["bin"], row["why"]) == ("placed", "red_bin", "it fell there")


@pytest.mark.parametrize(
    "landing",
    [None, np.array([0.5, 0.0, 0.025]), np.array([0.3, -0.44, 0.025]), np.array([-0.2, 0.44, 0.025])],
    ids=["nobody knows where", "on the table", "on the wall of its bin", "in a bin of another class"],
)
def test_what_may_have_come_down_elsewhere_and_is_not_found_is_lost(
    bench: Bench, landing: np.ndarray | None
) -> None:
    row = dropped(bench, landing)
    assert (row["state"], row["bin"]) == ("lost", "")


def test_a_look_into_the_bin_that_does_not_show_it_takes_that_back(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1", OVER)
    bench.look(view="full")
    bench.ledger.close()
    assert bench.ledger.rows()[0]["state"] == "lost"


def test_a_look_that_shows_it_there_settles_it(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1", OVER)
    bench.look(("cube", 0.2, -0.44), view="full")
    (row,) = bench.ledger.rows()
    assert (row["state"], row["bin"], row["why"]) == ("placed", "red_bin", "")


def test_dropped_again_elsewhere_it_is_not_sought_where_it_fell_first(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1", OVER)
    bench.look(("cube", 0.55, 0.1))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1", np.array([0.5, 0.2, 0.025]))
    for _ in range(3):
        bench.look()
    bench.ledger.close()
    assert bench.ledger.rows()[0]["state"] == "lost"


def test_what_leans_on_the_wall_of_its_bin_is_in_it(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0), ("cube", 0.6, 0.1))
    bench.ledger.held("cube-1")
    bench.ledger.placed("cube-1", "red_bin")
    bench.ledger.held("cube-2")
    bench.ledger.dropped("cube-2", OVER)
    bench.look(("cube", 0.2, -0.44), ("cube", 0.2, -0.44 + 0.12 + 0.003), view="full")
    assert bench.ledger.balance()["placed"] == 2


def test_what_must_have_fallen_into_a_bin_takes_a_place_there(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1", OVER)
    assert bench.ledger.objects_in("red_bin") == 1
    bench.look(view="full")
    assert bench.ledger.objects_in("red_bin") == 0, "a look shows that it is not there"
    bench.look(("cube", 0.2, -0.44), view="full")
    assert bench.ledger.objects_in("red_bin") == 1


def test_what_was_given_up_where_nobody_knows_is_found_in_its_bin_all_the_same(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.ledger.rejected("cube-1", "12 attempts failed")
    assert not bench.ledger.is_open("cube-1")
    bench.look(("cube", 0.2, -0.44), view="full")
    (row,) = bench.ledger.rows()
    assert (row["state"], row["bin"], row["why"]) == ("placed", "red_bin", "")


def test_found_on_the_table_it_stays_given_up(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.ledger.rejected("cube-1", "12 attempts failed")
    assert bench.look(("cube", 0.55, 0.1)) == []
    (row,) = bench.ledger.rows()
    assert (row["state"], row["position"][:2], row["why"]) == ("rejected", [0.55, 0.1], "12 attempts failed")


def test_given_up_and_never_found_it_is_lost(bench: Bench) -> None:
    bench.look(("cube", 0.5, 0.0))
    bench.ledger.held("cube-1")
    bench.ledger.dropped("cube-1")
    bench.ledger.rejected("cube-1", "12 attempts failed")
    bench.ledger.close()
    assert bench.ledger.rows()[0]["state"] == "lost"

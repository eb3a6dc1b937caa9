"""Who is let in to the live page, and who is not."""

from __future__ import annotations

import pytest
from aiohttp.test_utils import make_mocked_request

from executive.view.live.guard import Guard

TOKEN, PORT = "a-token", 8123
HERE = f"http://127.0.0.1:{PORT}"
GUARD = Guard(TOKEN, PORT)


def problem(path: str = f"/{TOKEN}/", **headers: str) -> str:
    named = {"Host": f"127.0.0.1:{PORT}"} | {key.replace("_", "-"): value for key, value in headers.items()}
    return GUARD.problem(make_mocked_request("GET", path, headers=named))


def test_the_page_itself_is_let_in() -> None:
    assert problem() == ""
    assert problem(Origin=HERE, Upgrade="websocket") == ""


@pytest.mark.parametrize(
    "path", ["/", "", "*", "/another/", "/a-toke/", "/a-token2/", "//a-token/", "/A-TOKEN/", "/live", "/%ff/"]
)
def test_without_the_token_nobody_is(path: str) -> None:
    said = "the address lacks the token of this run; take it from the terminal that the run is in"
    assert problem(path) == said


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "null",
        "",
        f"https://127.0.0.1:{PORT}",
        "http://127.0.0.1:8124",
        f"{HERE}.evil.example",
    ],
)
def test_a_page_of_another_origin_is_not_even_with_the_token(origin: str) -> None:
    assert problem(Origin=origin) == "another page may neither see nor command this run"


def test_a_socket_that_does_not_say_whose_it_is_is_not() -> None:
    assert problem(Upgrade="WebSocket") == "a connection must say which page it is of"


@pytest.mark.parametrize("host", ["evil.example", f"localhost:{PORT}", "127.0.0.1", f"127.0.0.1:{PORT}.evil"])
def test_a_name_that_leads_here_is_not(host: str) -> None:
    assert problem(Host=host) == "this page goes by the address of this machine only"

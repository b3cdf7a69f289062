"""Only the person who started the server enters, by its own name and from its own page."""

from __future__ import annotations

import pytest

from tests.interfaces.app.server import Served


def test_the_token_is_exchanged_for_a_cookie_of_this_site_alone(server: Served) -> None:
    status, headers, _ = server.request("GET", server.address.removeprefix(server.base), Cookie="", Origin="")
    assert status in (200, 404, 500)
    assert "HttpOnly" in headers["set-cookie"]
    assert "SameSite=Strict" in headers["set-cookie"]


@pytest.mark.parametrize("query", ["", "?token=", "?token=wrong", "?token=%ff"])
def test_nobody_enters_with_another_token(server: Served, query: str) -> None:
    status, headers, body = server.request("GET", f"/{query}", Cookie="", Origin="")
    assert status == 401
    assert "set-cookie" not in headers
    assert b"token" in body


@pytest.mark.parametrize("cookie", ["", "a=b", "modalscope=1", '"', "=;=;"])
def test_no_cookie_no_answer(server: Served, cookie: str) -> None:
    assert server.request("GET", "/api/start", Cookie=cookie)[0] == 401


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "localhost", "127.0.0.1", ""])
def test_another_name_is_refused(server: Served, host: str) -> None:
    assert server.request("GET", "/api/start", Host=host)[0] == (200 if not host else 403)


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://localhost:1", "https://127.0.0.1"])
def test_another_page_is_refused(server: Served, origin: str) -> None:
    assert server.request("POST", "/api/open", {"files": []}, Origin=origin)[0] == 403
    assert server.request("GET", "/api/start", Origin=origin)[0] == 403


def test_a_change_must_say_where_it_comes_from(server: Served) -> None:
    assert server.request("POST", "/api/open", {"files": []}, Origin="")[0] == 403
    assert server.request("GET", "/api/start", Origin="", Sec_Fetch_Site="cross-site")[0] == 403


def test_every_answer_forbids_what_comes_from_elsewhere(server: Served) -> None:
    for path, cookie in (("/api/start", server.cookie), ("/api/start", "")):
        _, headers, _ = server.request("GET", path, Cookie=cookie)
        assert "default-src 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"

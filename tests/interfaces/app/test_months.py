"""The report of a store at an address of its own, behind the guard of the page."""

from __future__ import annotations

from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from modalscope.analysis.monitoring import History, Store
from tests.interfaces.app.server import Served, until


@pytest.mark.slow
def test_a_store_is_shown_with_what_came_to_it_to_who_has_the_token(tmp_path: Path) -> None:
    pytest.importorskip("uvicorn", reason="the extra `app` is not installed")
    from modalscope.interfaces.app.months import MonthsReport
    from modalscope.interfaces.app.serve import alone, server_of

    with Store(tmp_path / "a.modes") as store:
        for first in (0, 30):
            hours = np.arange(first, first + 30)
            store.add_modes(History(times=3600 * hours, record=range(30), frequencies=1 + 1e-3 * np.sin(hours)))
            if not first:
                made = alone(MonthsReport(store.path))
                server = server_of(made)
                thread = Thread(target=server.run, args=([made.socket],), daemon=True)
                thread.start()
                until(lambda server=server: server.started)
                told = Served(made.address, None)
            status, headers, text = told.request("GET", f"/?{made.address.partition('?')[2]}")
            assert (status, f"{first + 30} used" in text.decode()) == (200, True)
            assert "unsafe-inline" in headers["content-security-policy"]
    cookie = headers["set-cookie"].partition(";")[0]
    for status, path, more in (
        (401, "/", {}),
        (401, "/?token=x", {}),
        (200, "/", {"Cookie": cookie}),
        (404, "/other", {"Cookie": cookie}),
        (403, "/", {"Cookie": cookie, "Host": "example.org"}),
        (403, "/", {"Cookie": cookie, "Origin": "http://example.org"}),
    ):
        assert told.request("GET", path, **more)[0] == status
    server.should_exit = True
    thread.join(20)

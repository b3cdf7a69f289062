"""The report of a store at an address of its own."""

from __future__ import annotations

from pathlib import Path
from threading import Thread
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest

from modalscope.app.months import MonthsServer
from modalscope.monitoring import History, Store


def test_a_store_is_shown_with_what_came_to_it(tmp_path: Path) -> None:
    with Store(tmp_path / "a.modes") as store:
        for first in (0, 30):
            hours = np.arange(first, first + 30)
            store.add_modes(History(times=3600 * hours, record=range(30), frequencies=1 + 1e-3 * np.sin(hours)))
            if not first:
                server = MonthsServer(store.path, "127.0.0.1", 0)
                Thread(target=server.serve_forever, daemon=True).start()
            assert f"{first + 30} used" in urlopen(server.address).read().decode()
    with pytest.raises(HTTPError, match="404"):
        urlopen(server.address[:-1])
    server.shutdown()
    server.server_close()

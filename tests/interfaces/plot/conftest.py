from __future__ import annotations

from collections.abc import Iterator

import pytest
from matplotlib import pyplot


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")

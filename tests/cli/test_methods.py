"""modalscope methods: the whole table."""

from __future__ import annotations

import modalscope as ms
from modalscope.cli import main


def test_methods_prints_the_whole_table(capsys):
    assert main(["methods"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 1 + len(ms.methods())

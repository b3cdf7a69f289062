"""modalscope methods: the whole table."""

from __future__ import annotations

import modalscope as ms
from modalscope.interfaces.cli import main


def test_methods_prints_the_whole_table(capsys):
    assert main(["methods"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 1 + len(ms.methods())


def test_methods_prints_the_row_of_a_name_in_the_literature(capsys):
    assert main(["methods", "TLS-DMD"]) == 0
    assert "alternate" in capsys.readouterr().out
    assert main(["methods", "opt-dmd"]) == 2
    assert "modalscope.refine(data, modes)" in capsys.readouterr().err

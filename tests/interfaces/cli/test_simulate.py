"""modalscope simulate: every kind of test it writes can be identified."""

from __future__ import annotations

import pytest

from modalscope.interfaces.cli import main


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["frf", "impulse", "records", "ambient"])
def test_every_kind_of_simulated_test_is_identified(kind, tmp_path):
    path = tmp_path / "test.npz"
    assert main(["simulate", "heavy4", "--kind", kind, "-o", str(path)]) == 0
    assert main(["identify", str(path)]) == 0


@pytest.mark.parametrize("options", [["--samples", "-4"], ["--samples", "0"], ["--seed", "-1", "--noise", "40"]])
def test_simulating_nothing_is_refused(options, tmp_path, capsys):
    assert main(["simulate", "chain5", *options, "-o", str(tmp_path / "test.npz")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("modalscope: ")
    assert "needs a whole number" in said
    assert list(tmp_path.iterdir()) == []

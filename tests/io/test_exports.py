"""Any export is read: verdicts on files of the grammar, a few here and a thousand in the study."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.exports import remedies, several
from benchmarks.exports.draw import HALVES, SHARED, draw_choices
from benchmarks.exports.measure import by_dimension, measure, table
from benchmarks.exports.verdict import COSTS, dead_ends, message, suggestions, tried
from benchmarks.exports.words import FAR, NEAR
from benchmarks.exports.write import write
from modalscope.interfaces.cli import main
from tests.support import DATA

#: Seeds of the quick test, and of the study, whose seeds were looked at by nobody while the reader was made.
_QUICK, _FIRST, _COUNT = 24, 980_000, 1000


def test_every_dimension_has_five_values_and_the_halves_share_none() -> None:
    for name in ("makers", "extras", "oddities", "axes", "heads", "sensors", "forces", "time", "frequency"):
        near, far = set(getattr(NEAR, name)), set(getattr(FAR, name))
        assert min(len(near), len(far)) >= 5
        assert not near & far
    assert all(len(values) >= 2 for values in SHARED.values())
    assert set(HALVES) == {"near", "far"}


def test_a_file_is_drawn_again_from_its_seed() -> None:
    assert draw_choices(np.random.default_rng([7, 0]), "near") == draw_choices(np.random.default_rng([7, 0]), "near")


@pytest.mark.slow
@pytest.mark.parametrize("half", HALVES)
def test_no_export_ends_in_a_crash(tmp_path: Path, half: str) -> None:
    words = [tried(tmp_path, 10_000 + seed, half)[1] for seed in range(_QUICK)]
    assert "crash" not in words
    assert set(words) <= set(COSTS)


@pytest.mark.slow
@pytest.mark.parametrize("half", HALVES)
def test_every_printed_option_reads_the_file_or_asks_one_thing_more(tmp_path: Path, half: str) -> None:
    for seed in range(20_000, 20_000 + _QUICK):
        drawn = write(tmp_path, seed, draw_choices(np.random.default_rng([seed, 0]), half))
        assert not dead_ends(drawn.path, message(drawn.path), drawn.truth.rate), message(drawn.path)


def test_an_option_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    path = tmp_path / "bare.csv"
    path.write_text("1.5,2\n0.5,-1\n2.5,0\n")
    said = message(path)
    assert dead_ends(path, said) == []  # one further question, as a rate is, is none
    assert dead_ends(path, said + ', or --columns "time=9"') == ["--columns time=9"]


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "standins").is_dir(), reason="the stand-ins are not there")
@pytest.mark.parametrize(
    ("command", "options", "several"),
    [("info", [], set()), ("identify", ["--orders", "2:20:6", "--no-refine", "-v"], {("--all",), ("--each",)})],
)
def test_every_option_that_is_printed_is_obeyed_word_for_word(
    command: str, options: list[str], several: set[tuple[str, ...]], capsys: pytest.CaptureFixture[str]
) -> None:
    """Of all files of a stand-in together, in the command line; a rate that a person fills in is filled in."""
    failed, count = [], 0
    for truth in sorted((DATA / "standins").glob("*/truth.json")):
        files = [str(truth.parent / name) for name in json.loads(truth.read_text())["files"]]
        plain = [command, *files, *options]
        capsys.readouterr()
        main(plain)
        said = "".join(capsys.readouterr())
        for way in {tuple(way) for line in said.splitlines() for way in suggestions(line)} - several:
            count += 1
            if main([*plain, *("1000" if word == "HZ" else word for word in way)]):
                failed.append((truth.parent.name, way))
    assert count > 25
    assert not failed


@pytest.mark.slow
def test_no_test_of_several_files_or_in_one_is_wrong_in_silence() -> None:
    verdicts = {word for _, word in several.measure(30_000, _QUICK)}
    assert verdicts <= {"right", "wrong and said", "refused, remedy works"}


@pytest.mark.slow
def test_options_printed_for_tests_of_the_grammar_work_at_the_first_try() -> None:
    found = remedies.measure(40_000, _QUICK)
    assert len(found) > _QUICK
    assert share([str(works) for _, works, _ in found], "True") >= 95


@pytest.mark.study("reading")
def test_fresh_options_work_at_the_first_try(study) -> None:
    found = remedies.measure(_FIRST, _COUNT // 4)
    of = study("options that info prints, obeyed word for word", f"{_COUNT // 2} tests, seeds from {_FIRST}")
    works = share([str(works) for _, works, _ in found], "True")
    of.row(f"of {len(found)} options work at the first try", works, least=95, form=".1f", unit=" %")


@pytest.mark.study("reading")
def test_fresh_tests_of_several_files_and_in_one(study) -> None:
    rows = several.measure(_FIRST, _COUNT)
    print(several.table(rows))
    of = study("several files of one test, several tests in one file", f"{len(rows)} tests, seeds from {_FIRST}")
    words = [word for _, word in rows]
    of.row(
        "right, or what is printed makes it so",
        100 - share(words, "wrong in silence", "refused", "crash"),
        least=95,
        form=".1f",
        unit=" %",
    )
    of.row("wrong in silence", share(words, "wrong in silence", "crash"), most=3, form=".1f", unit=" %")
    for kind in (*several.FILES, *several.TESTS):
        own = [word for name, word in rows if name == kind]
        of.row(f"{kind} ({len(own)}): right unasked", share(own, "right"), form=".0f", unit=" %")


def share(words: list[str], *these: str) -> float:
    """Return how many of some words are these, in percent."""
    return 100 * sum(word in these for word in words) / max(1, len(words))


@pytest.mark.study("reading")
def test_fresh_exports(study) -> None:
    """Shares of the verdicts in each half, and of what is right at every value of every dimension."""
    rows = measure(_FIRST, _COUNT)
    print(table(rows))
    seeds = f"seeds from {_FIRST}"
    for half in HALVES:
        words = [word for word, own, _ in rows if own == half]
        share = {word: 100 * words.count(word) / len(words) for word in COSTS}
        of = study(f"exports, {half} half of the words", f"{len(words)} files, {seeds}")
        of.row(
            "right, or a name or unit lost",
            share["right"] + share["names or units lost"],
            least=90,
            form=".1f",
            unit=" %",
        )
        of.row("wrong in silence", share["wrong in silence"], most=1, form=".1f", unit=" %")
        of.row("crash, or more than 20 s", share["crash"], most=0, form=".1f", unit=" %")
        for word in ("names or units lost", "wrong and said", "refused, remedy works", "refused"):
            of.row(word, share[word], form=".1f", unit=" %")
    of = study("exports that are refused", seeds)
    refused = [word for word, _, _ in rows if word.startswith("refused")]
    if refused:
        works = 100 * refused.count("refused, remedy works") / len(refused)
        of.row(f"{len(refused)} that can be read: a remedy works when obeyed", works, least=90, form=".0f", unit=" %")
    for name, values in by_dimension(rows).items():
        of = study(f"exports by {name}", f"{len(rows)} files, {seeds}")
        for value, words in values.items():
            good = sum(word in ("right", "names or units lost") for word in words)
            of.row(
                f"{value} ({len(words)} files): right, or a name or unit lost",
                100 * good / len(words),
                form=".0f",
                unit=" %",
            )

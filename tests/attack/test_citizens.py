"""Results are ordinary objects of Python: they pickle, copy and compare, and threads and processes that share them do no harm."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import modalscope as ms
from tests.data.test_frozen import arrays_of

CHAIN = ms.systems.chain5()
ORDERS = range(8, 13, 2)


@cache
def lines() -> ms.FrequencyResponse:
    return CHAIN.frequency_response(np.linspace(0.2, 8, 120), quantity="acceleration", noise=0.02, seed=1)


@cache
def result() -> ms.Result:
    return ms.analyze(lines(), orders=ORDERS)


@cache
def pipeline(domain: str) -> Any:
    return ms.factor(ms.prepare(lines(), method="polyreference", domain=domain), 10)


PUBLIC: dict[str, Callable[[], Any]] = {
    "result": result,
    "modes": lambda: result().modes,
    "a mode": lambda: result().modes[0],
    "a note": lambda: result().notes[0],
    "settings": lambda: result().settings,
    "document": lambda: result().analysis,
    "diagram": lambda: result().diagram,
    "comparison": lambda: ms.compare(lines(), methods=["era", "polyreference"], orders=ORDERS),
    "certificate": lambda: ms.certify(result(), replicates=2),
    "findings": lambda: ms.preprocess.examine(lines()),
    "a structure": lambda: CHAIN,
    "a model": lambda: CHAIN.state_space(),
    "a problem": lambda: ms.prepare(lines(), method="era"),
    "factors in s": lambda: pipeline("s"),
    "factors in z": lambda: pipeline("z"),
    "a cut": lambda: next(iter(ms.sweep(pipeline("z")))),
    "a row of the table": lambda: ms.methods()[0],
    "an error": lambda: ms.DataError("this was", "there is that", "Do so."),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLIC)
def test_public_objects_pickle_copy_and_compare(name: str) -> None:
    thing = PUBLIC[name]()
    locked = [array.flags.writeable for array in arrays_of(thing)]
    for again in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing), copy.copy(thing)):
        assert type(again) is type(thing)
        assert str(again) == str(thing) or " at 0x" in str(thing)
        assert [array.flags.writeable for array in arrays_of(again)] == locked
        assert (again == thing) in (True, False)
        assert (thing == thing) is True
        assert (thing != again) in (True, False)


@pytest.mark.slow
def test_what_was_pickled_goes_on_as_before() -> None:
    again, before = pickle.loads(pickle.dumps(pipeline("s"))), pipeline("s")
    for one, other in zip(ms.sweep(again), ms.sweep(before), strict=True):
        np.testing.assert_array_equal(one.modes.poles, other.modes.poles)


def picture(path: Path) -> bytes:
    """Draw a diagram into a file, without the date in it."""
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    ms.plot.response(lines(), None, 0, 0, ax=ax)
    ax.figure.savefig(path, metadata={"Software": None})
    plt.close("all")
    return path.read_bytes()


@pytest.mark.slow
def test_pictures_drawn_in_threads_are_the_same(tmp_path: Path) -> None:
    alone = picture(tmp_path / "a.png")
    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(picture, [tmp_path / f"{k}.png" for k in range(12)])) == {alone}


SUFFIXES = (".npz", ".csv", ".uff", ".mat", ".h5")


def _write(folder: str, value: float) -> None:
    """Write one file after the other, each several times."""
    data = ms.Signals(outputs=np.full((2000, 2), value), sampling_rate=8.0)
    for suffix in SUFFIXES:
        for _ in range(8):
            ms.write(Path(folder) / f"a{suffix}", data)


@pytest.mark.slow
def test_of_two_processes_that_write_one_file_one_wins(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write, args=(str(tmp_path), value)) for value in (1.0, 2.0)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    for suffix in SUFFIXES:
        assert np.unique(ms.read(tmp_path / f"a{suffix}").outputs).size == 1
    assert sorted(each.suffix for each in tmp_path.iterdir()) == sorted(SUFFIXES)

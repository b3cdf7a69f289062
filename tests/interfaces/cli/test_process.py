"""The program around a command: closed pipes, full disks, poor terminals and signals cost one line, and never a file."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from tests.studies import Study

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes, limits and signals of POSIX")

PROGRAM = [sys.executable, "-m", "modalscope"]
FORMATS = [".uff", ".csv", ".npz", ".mat", ".h5"]


def program(*words: object, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=120, **options)  # type: ignore[call-overload,no-any-return]


def small_disk() -> None:
    """No file may grow over 2000 bytes, as on a disk that is full."""
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_full_disk_is_one_line_and_leaves_the_earlier_file(tmp_path: Path, test_file: Path, suffix: str) -> None:
    if suffix == ".h5":
        pytest.importorskip("h5py")
    target = tmp_path / f"out{suffix}"
    assert main(["convert", str(test_file), str(target)]) == 0
    before = target.read_bytes()
    run = program("convert", test_file, target, preexec_fn=small_disk)
    assert run.returncode == 2
    assert re.fullmatch(r"modalscope: writing .* the system refuses: [^\n]*\n", run.stderr), run.stderr
    assert target.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {test_file.name, target.name}


@pytest.mark.slow
def test_a_closed_pipe_loses_no_file(tmp_path: Path, test_file: Path) -> None:
    target = tmp_path / "same.npz"
    command = f"{' '.join(PROGRAM)} convert {test_file} {target} | true; echo ${{PIPESTATUS[0]}}"
    run = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=120, check=True)
    assert run.stdout == "0\n"
    assert not run.stderr
    assert len(ms.read(target).output_dofs) == 4


@pytest.mark.slow
def test_a_closed_pipe_for_json_loses_no_other_output(tmp_path: Path, test_file: Path) -> None:
    target = tmp_path / "modes.json"
    words = f"identify {test_file} --no-refine --method era --domain z --orders 8:10:2 -o - -o {target}"
    run = subprocess.run(["bash", "-c", f"{' '.join(PROGRAM)} {words} 2>/dev/null | true"], timeout=120, check=True)
    assert run.returncode == 0
    assert len(ms.read(target)) > 0


@pytest.mark.slow
def test_results_that_cannot_be_printed_are_one_line(test_file: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full on this system")
    with Path("/dev/full").open("w") as full:
        command = [*PROGRAM, "info", str(test_file)]
        run = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert run.returncode == 2
    assert run.stderr == "modalscope: the system refuses: no space left on device\n"


@pytest.mark.parametrize(
    "setting",
    [
        pytest.param({"PYTHONIOENCODING": "ascii"}, marks=pytest.mark.slow),
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_a_terminal_of_ascii_gets_escapes(tmp_path: Path, setting: dict[str, str]) -> None:
    name = tmp_path / "messung-µ.npz"
    ms.write(name, ms.Signals(outputs=np.ones((3, 1)), sampling_rate=1.0, output_dofs=["µ\x1b[2J"]))
    run = program("info", name, env={**os.environ, **setting})
    assert run.returncode == 0
    assert not run.stderr
    assert run.stdout.isascii()
    assert "\x1b" not in run.stdout


@pytest.mark.slow
def test_a_name_of_300_letters_or_with_signs_of_no_alphabet_is_one_line(tmp_path: Path, test_file: Path) -> None:
    for name in ("a" * 300 + ".json", "a\x1b[2J\n.xyz"):
        run = program("convert", test_file, tmp_path / name)
        assert run.returncode == 2
        assert run.stderr.count("\n") == 1
        assert run.stderr.rstrip("\n").isprintable()
        assert len(run.stderr) <= 620
    assert [path.name for path in tmp_path.iterdir()] == [test_file.name]


def heard() -> None:
    """Let signals end a program: where tests run in the background, a shell has told them to ignore Ctrl-C."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


def stopped(
    words: list[str], number: int, when: Callable[[subprocess.Popen[str]], None], program: list[str] = PROGRAM
) -> tuple[int, str]:
    """Return status and stderr of a command that gets a signal as soon as `when` returns."""
    process = subprocess.Popen(
        [*program, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=heard
    )
    when(process)
    process.send_signal(number)
    _, told = process.communicate(timeout=120)
    return process.returncode, told


#: The program on a disk that takes a minute to move a file into place.
SLOW_DISK = """
import sys, time
from pathlib import Path
Path.replace = lambda self, target: time.sleep(60)
from modalscope.interfaces.cli import main
sys.exit(main())
"""


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_a_signal_is_one_line_and_no_temporary_file(tmp_path: Path, test_file: Path, number: int) -> None:
    target = tmp_path / "out.csv"

    def writing(process: subprocess.Popen[str]) -> None:
        while process.poll() is None and not any(path.name.startswith(".out-") for path in tmp_path.iterdir()):
            time.sleep(0.001)

    program = [sys.executable, "-c", SLOW_DISK]
    status, told = stopped(["convert", str(test_file), str(target)], number, writing, program)
    assert status == 128 + number
    assert told == "modalscope: stopped; every output file is complete or unchanged\n"
    assert {path.name for path in tmp_path.iterdir()} == {test_file.name}


def test_ctrl_c_stops_a_background_job_where_no_terminal_can_send_it(tmp_path: Path, test_file: Path) -> None:
    """Shells let the jobs of a script ignore it; who sends it to a process without a terminal means that process."""
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW_DISK, "convert", str(test_file), str(tmp_path / "out.csv")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    while process.poll() is None and not any(path.name.startswith(".out-") for path in tmp_path.iterdir()):
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60)[1].count("\n") == 1
    assert process.returncode == 130


@pytest.mark.parametrize("foreground", [True, False])
def test_what_a_terminal_may_send_to_others_stays_ignored(monkeypatch: pytest.MonkeyPatch, foreground: bool) -> None:
    from modalscope.interfaces.cli import process

    before = {number: signal.getsignal(number) for number in process._signals()}
    monkeypatch.setattr(process, "_in_foreground", lambda: foreground)
    try:
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        process.take_over()
        now = {number: signal.getsignal(number) is signal.SIG_IGN for number in before}
        assert now == {number: number != signal.SIGINT or foreground for number in before}
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


#: The program on a small machine that keeps sums after every stretch, and takes a minute for the second one.
SLOW_SUMS = """
import sys, time
from modalscope.io import stored as of_files
from modalscope.data import stored
from modalscope.numerics import sums as saved_sums
stored._MIN_RECORDS_IN_MEMORY = of_files._PARTS_OF_MEMORY = 10**9
saved_sums._MIN_SECONDS_BETWEEN = saved_sums._MIN_MULTIPLE_OF_WRITING = 0.0
add = saved_sums.SavedSums.add
saved_sums.SavedSums.add = lambda self, task, *more: time.sleep(60) if task else add(self, task, *more)
from modalscope.interfaces.cli import main
sys.exit(main())
"""


@pytest.mark.slow
def test_ctrl_c_says_that_kept_sums_are_gone_on_from(tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    record, sums = tmp_path / "long.h5", tmp_path / "sums"
    ms.write(record, ms.systems.chain5().simulate(inputs="ambient", duration=100.0, sampling_rate=20.0))

    def kept(process: subprocess.Popen[str]) -> None:
        while process.poll() is None and not any(sums.glob("sums-*.npz")):
            time.sleep(0.001)

    program = [sys.executable, "-c", SLOW_SUMS]
    status, told = stopped(["identify", str(record), "-q", "--resume", str(sums)], signal.SIGINT, kept, program)
    assert status == 128 + signal.SIGINT
    assert told == (
        "modalscope: stopped; every output file is complete or unchanged; "
        "the same command resumes from the saved sums\n"
    )
    assert len(list(sums.iterdir())) == 1


@pytest.mark.study("robustness")
@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=["INT", "TERM", "KILL"])
def test_fifty_kills_at_any_time_lose_nothing(
    tmp_path: Path, suffix: str, number: int, study: Callable[[str, str], Study]
) -> None:
    """The earlier file or the complete new one stands there; but for SIGKILL, which nobody can answer, there is no other file.

    Ctrl-C while Python starts ends in Python's own words.
    """
    source, target = tmp_path / "in.npz", tmp_path / f"out{suffix}"
    data = ms.Signals(outputs=np.random.default_rng(0).standard_normal((20000, 10)), sampling_rate=100.0)
    ms.write(source, data)
    words = ["convert", str(source), str(target)]
    begun = time.monotonic()
    assert program(*words).returncode == 0
    lasts, whole = time.monotonic() - begun, target.read_bytes()
    told, lost = [], 0
    for delay in np.linspace(0.0, lasts, 50):
        status, line = stopped(words, number, lambda _, delay=delay: time.sleep(delay))
        told.append((float(delay), status, line))
        lost += target.read_bytes() != whole
    left = {path.name for path in tmp_path.iterdir()} - {source.name, target.name}
    table = study(f"convert to {suffix}, signal {signal.Signals(number).name}", f"50 times, from 0 to {lasts:.2f} s")
    table.row("files that are neither the earlier nor the complete one", lost, most=0)
    table.row("other files left", len(left), most=None if number == signal.SIGKILL else 0)
    table.row("tracebacks, of Python's own start", sum("Traceback" in line for *_, line in told))
    assert not table.missed
    assert any(status for _, status, _ in told)
    if number != signal.SIGKILL:
        # until Python has started nobody can answer, and a shell reports the same 128 + number
        assert {status for _, status, _ in told} <= {0, 128 + number, -number}, told

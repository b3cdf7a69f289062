"""What only some systems have (signals, fork, rights) is used behind a guard: the package runs on Windows, too."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support import ROOT

SOURCE = ROOT / "src" / "modalscope"

#: Modules that Windows has not, and what `os` and `signal` have not there.
MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
NAMES = {
    "os": {
        "chown", "fchmod", "fchown", "fork", "forkpty", "getegid", "geteuid", "getgid", "getgroups", "getpgid", "getuid", "killpg",
        "lchown", "mkfifo", "mknod", "nice", "pipe2", "posix_spawn", "setegid", "seteuid", "setgid", "setpgid", "setsid", "setuid",
        "statvfs", "sync", "uname", "wait", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "SCHED_OTHER", "sched_getaffinity",
    },
    "signal": {
        "SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGPROF", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGVTALRM", "SIGXCPU",
        "alarm", "pause", "pthread_kill", "pthread_sigmask", "setitimer", "siginterrupt", "sigwait",
    },
}  # fmt: skip


def unguarded(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and name of what is used outside of a guard: `if hasattr(...)`, the platform's name, or a `try` around it."""

    def visit(node: ast.AST, guarded: bool) -> Iterator[tuple[int, str]]:
        if isinstance(node, ast.If | ast.IfExp):
            test = ast.unparse(node.test)
            guarded = guarded or any(word in test for word in ("hasattr", "platform", "os.name"))
        if isinstance(node, ast.Try):
            caught = " ".join(ast.unparse(handler.type) for handler in node.handlers if handler.type)
            guarded = guarded or "ImportError" in caught or "AttributeError" in caught
        named = []
        if isinstance(node, ast.Import):
            named = [alias.name for alias in node.names if alias.name in MODULES]
        if isinstance(node, ast.ImportFrom) and node.module:
            named = [node.module] if node.module in MODULES else []
            named += [f"{node.module}.{a.name}" for a in node.names if a.name in NAMES.get(node.module, ())]
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            named = [f"{node.value.id}.{node.attr}"] if node.attr in NAMES.get(node.value.id, ()) else []
        if not guarded:
            yield from ((node.lineno, name) for name in named)  # type: ignore[attr-defined]
        for child in ast.iter_child_nodes(node):
            yield from visit(child, guarded)

    yield from visit(tree, False)


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted(SOURCE.rglob("*.py")), ids=lambda file: file.relative_to(SOURCE).as_posix())
def test_what_only_some_systems_have_is_guarded(file: Path) -> None:
    assert list(unguarded(ast.parse(file.read_text(encoding="utf-8")))) == []


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("import os\nos.fork()", 1),
        ("import resource", 1),
        ("from os import fork", 1),
        ("import signal\nsignal.alarm(1)", 1),
        ("import os\nif hasattr(os, 'fork'):\n    os.fork()", 0),
        ("try:\n    import resource\nexcept ImportError:\n    resource = None", 0),
        ("import os\nos.replace('a', 'b')", 0),
    ],
)
def test_guards_are_seen(text: str, count: int) -> None:
    assert len(list(unguarded(ast.parse(text)))) == count

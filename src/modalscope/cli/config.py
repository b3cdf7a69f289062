"""Read options from a file: `--config options.toml`, with a table for each command.

    [identify]
    band = [100, 4500]
    exclude = ["3:+Z"]
    no-refine = true

Every entry is the option of that name; true is an option without a value, a list gives several values, a list of lists the
option several times. What stands on the command line counts more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

_OPTION = "--config"
#: What every command takes, without a value; short ones may stand together.
_COMMON, _TOGETHER = ("--quiet", "--verbose"), re.compile(r"-[qv]+\Z")


def command_first(words: Sequence[str]) -> list[str]:
    """Return the words of a command line with the command first: what every command takes may stand before it, too.

    Examples
    --------
    >>> command_first(["-q", "--config", "a.toml", "identify", "a.csv"])
    ['identify', '-q', '--config', 'a.toml', 'a.csv']
    >>> command_first(["-vq", "identify", "a.csv"])
    ['identify', '-vq', 'a.csv']
    """
    at = 0
    while at < len(words) and (
        words[at] in _COMMON or _TOGETHER.match(words[at]) or words[at].split("=")[0] == _OPTION
    ):
        at += 2 if words[at] == _OPTION else 1
    return [words[at], *words[:at], *words[at + 1 :]] if at < len(words) else []


def configured(words: Sequence[str]) -> list[str]:
    """Return the words of a command line with those that its file of options adds.

    Raises `DataError`: A file that cannot be read, that is no TOML, or whose tables are no commands.
    """
    at = next((k for k, word in enumerate(words) if word.split("=")[0] == _OPTION), None)
    if at is None or words[at : at + 2] == [_OPTION]:
        return list(words)
    name = words[at].partition("=")[2] or words[at + 1]
    given = {word.split("=")[0] for word in words}
    table = _read(Path(name)).get(words[0], {})
    return [*words, *(word for key, value in table.items() if f"--{key}" not in given for word in _words(key, value))]


def _read(path: Path) -> dict[str, dict[str, Any]]:
    import tomllib

    from modalscope.cli.commands import names
    from modalscope.data import DataError

    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(
            f"{_OPTION} {path} was asked", f"the system refuses: {(error.strerror or '').lower()}", "Check the name."
        ) from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"{_OPTION} {path} was asked", f"it is no TOML: {error}", "Correct that line.") from None
    for name, table in tables.items():
        if name not in names() or not isinstance(table, dict):
            raise DataError(
                f"{_OPTION} {path} was asked",
                f"{name!r} is no table of a command",
                f"Use tables [{'], ['.join(names())}].",
            )
    return tables


def _words(key: str, value: Any) -> Iterator[str]:
    """Yield an entry as words of a command line."""
    if isinstance(value, list) and value and all(isinstance(each, list) for each in value):
        for each in value:
            yield from _words(key, each)
    elif isinstance(value, list):
        yield from (f"--{key}", *(str(each) for each in value))
    elif value is True:
        yield f"--{key}"
    elif value is not False:
        yield f"--{key}={value}"

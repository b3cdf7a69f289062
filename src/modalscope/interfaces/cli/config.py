"""Read options from a file, `--config options.toml`, with a table for each command.

    [identify]
    band = [100, 4500]
    exclude = ["3:+Z"]
    no-refine = true

Every entry is the option of that name: true is an option without a value, a list gives several values, a list of lists repeats the
option. The command line takes precedence.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

_OPTION = "--config"
#: Options of every command with a value.
_VALUED = (_OPTION, "--log")
#: Options of every command without a value; short ones may be combined.
_LONG_FLAGS, _SHORT_FLAGS = ("--quiet", "--verbose"), re.compile(r"-[qv]+\Z")


def command_first(words: Sequence[str]) -> list[str]:
    """Return the arguments with the command first: options of every command may precede it.

    Examples
    --------
    >>> command_first(["-q", "--config", "a.toml", "identify", "a.csv"])
    ['identify', '-q', '--config', 'a.toml', 'a.csv']
    >>> command_first(["-vq", "identify", "a.csv"])
    ['identify', '-vq', 'a.csv']
    """
    at = 0
    while at < len(words) and (
        words[at] in _LONG_FLAGS or _SHORT_FLAGS.match(words[at]) or words[at].split("=")[0] in _VALUED
    ):
        at += 2 if words[at] in _VALUED else 1
    return [words[at], *words[:at], *words[at + 1 :]] if at < len(words) else []


def configured(words: Sequence[str]) -> list[str]:
    """Return the arguments with those that the file of options adds.

    Raises `DataError`: a file that cannot be read, is no TOML, or has a table that is no command.
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

    from modalscope.data import DataError
    from modalscope.interfaces.cli.commands import names

    asked = f"{_OPTION} {path}:"
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(asked, f"the system refuses: {(error.strerror or '').lower()}", "Check the name.") from None
    except (ValueError, RecursionError) as error:
        raise DataError(asked, f"it is no TOML: {error}", "Correct that line.") from None
    for name, table in tables.items():
        if name not in names() or not isinstance(table, dict):
            raise DataError(asked, f"{name!r} is no table of a command", f"Use tables [{'], ['.join(names())}].")
    return tables


def _words(key: str, value: Any) -> Iterator[str]:
    """Yield an entry as arguments."""
    if isinstance(value, list) and value and all(isinstance(item, list) for item in value):
        for item in value:
            yield from _words(key, item)
    elif isinstance(value, list):
        yield from (f"--{key}", *map(str, value))
    elif value is True:
        yield f"--{key}"
    elif value is not False:
        yield f"--{key}={value}"

"""What is printed: text from files can hold commands to the terminal, which must not reach it."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Iterator
from typing import Any, TextIO

# Control characters but line feed and tabulator, what hides or turns text around, and halves of characters.
_COMMANDS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]"
)


def printable(text: str) -> str:
    r"""The text with everything that a terminal would obey written out, as `\x1b`."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


@contextlib.contextmanager
def plain_output() -> Iterator[None]:
    """Within it, standard output and standard error take nothing but printable text."""
    with contextlib.redirect_stdout(_Plain(sys.stdout)), contextlib.redirect_stderr(_Plain(sys.stderr)):
        yield


class _Plain:
    """A text stream that writes out what the terminal would obey, and what its encoding lacks."""

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream  # rich writes colours: a console of its own takes care of the text

    def write(self, text: str) -> int:
        encoding = self.rich_proxied_file.encoding or "utf-8"
        self.rich_proxied_file.write(printable(text).encode(encoding, "backslashreplace").decode(encoding))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)

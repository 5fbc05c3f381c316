"""Messages that stay short whatever they name: long paths, long lists, what another program said."""

from __future__ import annotations

from collections.abc import Sequence

LONGEST_MESSAGE = 300
"""Characters that a message to the user may have."""


def shortened(text: str, longest: int) -> str:
    """The text in one line, without its middle if it is longer than `longest` characters.

    >>> shortened("a very long path", 9)
    'a v...ath'
    """
    line = " ".join(text.split())
    if len(line) <= longest:
        return line
    first = (longest - 3) // 2
    return f"{line[:first]}...{line[len(line) - (longest - 3 - first) :]}"


def listed(names: Sequence[object], most: int = 5, longest: int = 40, separator: str = ", ") -> str:
    """Names for a sentence: the first few of them, each shortened, and how many more there are.

    >>> listed(range(8), most=3)
    '0, 1, 2 and 5 more'
    """
    first = separator.join(shortened(str(name), longest) for name in names[:most])
    return f"{first} and {len(names) - most} more" if len(names) > most else first

"""Errors that a user can act on: each message is one sentence that ends with the remedy."""

import difflib
from collections.abc import Iterable


class DataError(ValueError):
    """Unreadable or impossible data or recipe; the command line ends with exit code 3."""


class UsageError(ValueError):
    """An argument that is missing, contradictory or out of range; exit code 2."""


def did_you_mean(word: str, known: Iterable[str], cutoff: float = 0.5) -> str:
    """Return ` (did you mean ...?)` with the known word most like `word`, or an empty string.

    `cutoff` is the least similarity, 0 to 1, as `difflib.get_close_matches` defines it.

    >>> did_you_mean("thicknes", ["thickness", "angle"])
    " (did you mean 'thickness'?)"
    """
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return f" (did you mean {close[0]!r}?)" if close else ""


def install_command(extra: str) -> str:
    """The command that installs the packages of an extra, for an installed pellicle and for a clone."""
    return f"pip install 'pellicle[{extra}]' (in a clone of the repository: pip install -e '.[{extra}]')"

"""Errors that a user can act on: each message is one sentence that ends with the remedy."""

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

_LONG = re.compile(r"\S{1000,}|'[^'\n]{300,}'")
"""Words and quoted texts that are longer than any path, such as a cell of 10 MB of a damaged file."""


def _readable(message: str) -> str:
    return _LONG.sub(lambda long: f"{long[0][:60]}… ({len(long[0])} characters)", message)


class DataError(ValueError):
    """Unreadable or impossible data or recipe; the command line ends with exit code 3."""

    def __init__(self, message: str = ""):
        super().__init__(_readable(message))


class UsageError(ValueError):
    """An argument that is missing, contradictory or out of range; exit code 2."""

    def __init__(self, message: str = ""):
        super().__init__(_readable(message))


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


@contextmanager
def needs(
    extra: str, what: str, remedy: str = "", kind: type[DataError | UsageError] = UsageError
) -> Iterator[None]:
    """Turn the failing import of a package of an extra into an error, with the command that installs it.

    `what` begins the sentence, as in "maps of cubes need"; `remedy` ends it.
    """
    try:
        yield
    except ImportError as missing:
        package = (missing.name or "").partition(".")[0]
        raise kind(f"{what} {package}: {install_command(extra)}{remedy}") from None


@contextmanager
def decoding(what: str, remedy: str) -> Iterator[None]:
    """Turn an error of any kind, as readers of other packages raise on damaged files, into a DataError:
    `what`, the reason in brackets, `remedy`."""
    try:
        yield
    except (ImportError, DataError, UsageError):
        raise
    except Exception as error:
        # without hints at options of the other package, and addresses of buffers
        plain = re.sub(r" (\(hint.*|<_io\.BytesIO.*?>)", "", " ".join(str(error).split()))
        reason = plain[:200].rstrip(".")
        raise DataError(f"{what} ({reason or type(error).__name__}); {remedy}") from None

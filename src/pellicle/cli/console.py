"""Text on consoles that do not print UTF-8: signs that they lack are written out, as chi for χ."""

import codecs
import io
import sys
import unicodedata

_SIGNS = {"−": "-", "–": "-", "≤": "<=", "≥": ">=", "≈": "~", "→": "->", "∞": "inf", "√": "sqrt", "∂": "d"}
_SIGNS |= {"·": "*", "×": "x", "±": "+-", "°": " deg", "‖": "||", "“": '"', "”": '"', "’": "'"}


def print_every_sign() -> None:
    """Let stdout and stderr write out what their encoding lacks, instead of raising an error."""
    codecs.register_error("pellicle", _written_out)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # not where another program has put its own
            stream.reconfigure(errors="pellicle")


def _written_out(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_ascii, error.object[error.start : error.end])), error.end


def _ascii(sign: str) -> str:
    """A sign in letters: from the table, without its accent or height, a Greek one by its name, else `?`."""
    plain = unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode()
    words = unicodedata.name(sign, "?").split()
    greek = words[-1].lower() if words[:2] == ["GREEK", "SMALL"] else words[-1].capitalize()
    return _SIGNS.get(sign) or plain or (greek if words[0] == "GREEK" else "u" if sign == "µ" else "?")

"""Fields of a page for options of reading a file, and messages that name them."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pellicle.data.options import ReadingOptions
from pellicle.errors import UsageError

FIELDS = ("signal", "wavelength_unit", "signal_unit", "columns", "range", "spectrum", "polarisation", "noise")
"""Options that a file of a spectrum may need."""
OF_SAMPLES = ("columns", "noise")
"""Those of BRDF samples."""
_ARGUMENT = re.compile(r"`(\w+)(?:=([^`]*))?`")


def described(names: Sequence[str] = FIELDS) -> list[dict[str, Any]]:
    """Return the name, label, help and words of each field."""
    fields = []
    for name in names:
        option = ReadingOptions.declared()[name][1]
        known = option.words if option.find is None else option.find("")[1]
        form = option.metavar.replace("SIGMA", "") or ", ".join(known[:3])
        about = {"name": name, "label": _label(name), "help": option.help, "form": form}
        fields.append(about | {"words": [word for word in known if word != "brdf"]})
    return fields


def options_of(texts: Any) -> dict[str, Any]:
    """Return the options of the texts of fields, by name; an empty text is not given. Raises UsageError."""
    if not isinstance(texts, Mapping) or not all(isinstance(text, str) for text in texts.values()):
        raise UsageError("options of reading are texts by name")
    options = {}
    for name, text in texts.items():
        if name not in FIELDS:
            raise UsageError(f"no option {name!r}; known: {', '.join(FIELDS)}")
        if not text.strip():
            continue
        option = ReadingOptions.declared()[name][1]
        try:
            value = text.strip() if option.parse is None else option.parse(text.strip(), f"`{name}`")
            options[name] = option.check(value)
        except ValueError as error:
            raise UsageError(str(error) if "`" in str(error) else f"`{name}` {error}") from None
    return options


def texts_of(options: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts of fields for options, the inverse of `options_of`."""
    return {name: _text(name, value) for name, value in options.items() if name in FIELDS}


def in_words(message: str) -> str:
    """Return a message on one line, with labels of fields for the arguments that stand in backticks."""

    def field(found: re.Match[str]) -> str:
        name, value = found[1], (found[2] or "").strip("()[]")
        if name not in FIELDS:
            return found[0]
        value = value.replace('"', "").replace(", ", ":" if name == "range" else ",")
        return f"{_label(name)} {value}".rstrip()

    message = message.replace(
        "give the file as `layer` or `substrate`", "drop it on a layer or the substrate"
    )
    return " ".join(_ARGUMENT.sub(field, message).replace("`", "").split())


def named_in(message: str) -> list[str]:
    """Return the fields that a message names as arguments in backticks."""
    return list(dict.fromkeys(x[1] for x in _ARGUMENT.finditer(message) if x[1] in FIELDS))


def _label(name: str) -> str:
    return name.replace("_", " ")


def _text(name: str, value: Any) -> str:
    several = value if isinstance(value, list | tuple) else [value]
    words = [f"{x:g}" if isinstance(x, float | int) else str(x) for x in several]
    return (":" if name == "range" else ",").join(words)

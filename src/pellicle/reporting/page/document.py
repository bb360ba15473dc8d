"""Page of a result: template, style, script, figures and pictures in one file."""

import gzip
import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

_ASSETS = files("pellicle.reporting.page") / "assets"


class Table(NamedTuple):
    """A table: what it shows, the heads of its columns, and rows, whose first cell names the row."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def page(
    template: str, title: str, figures: Sequence[Mapping[str, Any]], library: str = "", **content: Any
) -> str:
    """Format a page by a template of this package. All text of `content` is escaped.

    A page without figures leaves Plotly out, and one with the path of a `library` loads it from there.
    """
    return (
        _environment()
        .get_template(template)
        .render(
            title=title,
            version=version("pellicle"),
            style=Markup(palette() + _text("page.css")),
            script=Markup(_text("page.js")),
            figures=_json(figures),
            plotly=Markup(packed_plotly() if figures and not library else ""),
            library=library if figures else "",
            **content,
        )
    )


def picture(content: bytes, about: str) -> dict[str, str]:
    """A PNG image and what it shows, for the macro `picture`."""
    return {"data": f"data:image/png;base64,{b64encode(content).decode()}", "about": about}


def palette() -> str:
    """Colours of pages as variables of CSS, the light ones and the dark ones."""
    return _text("palette.css")


@cache
def packed_plotly() -> str:
    """Plotly's script, compressed by gzip, in base64."""
    return b64encode((_ASSETS / "plotly-basic.min.js.gz").read_bytes()).decode()


def plotly_script() -> str:
    """Plotly's script."""
    return gzip.decompress((_ASSETS / "plotly-basic.min.js.gz").read_bytes()).decode()


@cache
def _environment() -> Environment:
    loader = PackageLoader("pellicle.reporting.page", "assets")
    return Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)


@cache
def _text(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")


def _json(figures: Sequence[Mapping[str, Any]]) -> Markup:
    """JSON inside an element of a script: no text in it can end the element."""
    text = json.dumps(list(figures), allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)

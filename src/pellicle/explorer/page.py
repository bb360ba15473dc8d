"""HTML of the explorer, its script as one ES module, and its style, for a page and for a notebook."""

import re
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from pellicle.reporting.page.document import packed_plotly, palette

_ASSETS = files("pellicle.explorer") / "assets"
_NAMES = "slider angles layers plot files reading requests fits explorer"
_PARTS = [f"{name}.js" for name in _NAMES.split()]
"""Parts of one ES module, which exports `explore(element, call, options)`: widgets have no imports."""


def document(nonce: str, call: str | None = None) -> str:
    """Return the page of the explorer, one file that loads nothing.

    **Arguments:** `nonce`, a random text for this response, which `policy` names; `call`, JavaScript of a
    function `call(request, body)` that returns a promise of the answer. By default it asks the server: the
    page reads the token, which it sends with each request, from the parameter `token` of its address.
    """
    loader = PackageLoader("pellicle.explorer", "assets")
    template = Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return template.get_template("explorer.html").render(
        nonce=nonce,
        style=Markup(style()),
        script=Markup(_module()),
        call=Markup(call or _text("server.js")),
        plotly=Markup(packed_plotly()),
    )


def policy(nonce: str = "") -> str:
    """Content-Security-Policy of the page: scripts with the nonce, or those in the page without one, requests
    to the same server, no more.

    Plotly sets styles of elements, hence 'unsafe-inline' for styles.
    """
    scripts = f"nonce-{nonce}" if nonce else "unsafe-inline"
    return (
        f"default-src 'none'; script-src '{scripts}'; style-src 'unsafe-inline'; img-src data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


@cache
def widget_module() -> str:
    """The ES module that anywidget loads: it needs no network, since Plotly is in it."""
    return f'{_module()}\n{_text("widget.js")}\nconst PLOTLY = "{packed_plotly()}";\n'


@cache
def style() -> str:
    """Style of the explorer: the palette of reports, for its element only, and its own rules.

    `data-theme` of the element, "light" or "dark", has precedence over the mode of the system: a notebook
    has a mode of its own.
    """
    light, dark = re.findall(r":root \{([^{}]*)\}", palette())
    element = ".pellicle-explorer"
    return "\n".join(
        (
            f"{element} {{{light}}}",
            f"@media (prefers-color-scheme: dark) {{ {element} {{{dark}}} }}",
            f"{element}[data-theme=light] {{{light} color-scheme: light; }}",
            f"{element}[data-theme=dark] {{{dark} color-scheme: dark; }}",
            _text("explorer.css"),
        )
    )


def _module() -> str:
    return "\n".join(_text(name) for name in _PARTS)


def _text(name: str) -> str:
    return (_ASSETS / name).read_text(encoding="utf-8")

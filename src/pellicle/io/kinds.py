"""Files that are no measurement: known by their first bytes, each with what to do instead."""

from __future__ import annotations

import re

_KINDS = {
    rb"\x89PNG|\xff\xd8\xff|GIF8|II\*\x00|MM\x00\*": "a picture; give the numbers behind it, as a CSV",
    rb"%PDF": "a PDF; give the numbers in it as a CSV",
    rb"\xd0\xcf\x11\xe0|PK\x03\x04.*(\[Content_Types|spreadsheet)": "an office file; save its sheet as CSV",
    rb"PK\x03\x04|\x1f\x8b|BZh|7z\xbc\xaf|Rar!": "packed; unpack it and give the file inside",
    rb"\{\\rtf": "a word processor's file; save it as plain text",
    rb"\s*<(!doctype|html|\?xml|svg)": "a web page or XML; export the spectrum as a CSV",
    rb"\s*(\{|\[\s*[\{\[\"])": "JSON; give a CSV with columns as wavelength_nm,R",
    rb"(?=.*\[\[?scene[.\]])(\s*#[^\n]*\n|\s)*\[": "a recipe; give it with --recipe",
}
"""Patterns of how contents begin, the narrower first, and what such a file is."""


def no_measurement(content: bytes) -> str | None:
    """What the file is instead of a table of numbers, and what to do; None if it may be one."""
    head = content[:4096]
    flags = re.DOTALL | re.IGNORECASE
    return next((advice for pattern, advice in _KINDS.items() if re.match(pattern, head, flags)), None)

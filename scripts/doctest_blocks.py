"""Griffe extension: puts the doctests of docstrings into code blocks.

Docstrings are rendered as Markdown, in which a line that begins with `>>>` would be a quotation.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

FENCE_OR_DOCTEST = re.compile(r"^```.*?^```|^>>> .*?(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)


class DoctestBlocks(Extension):
    """Code blocks around doctests that have none."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Fence the doctests of the object's docstring."""
        if obj.docstring is not None:
            obj.docstring.value = FENCE_OR_DOCTEST.sub(_fenced, obj.docstring.value)


def _fenced(match: re.Match[str]) -> str:
    return match[0] if match[0].startswith("```") else f"```python\n{match[0]}\n```"

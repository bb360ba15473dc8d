"""References as refractiveindex.info writes them (HTML) turned into plain text."""

from __future__ import annotations

import html
import re

_LINK = re.compile(r'<a\s+href\s*=\s*[\\"]*([^">]*)"?\s*>(.*?)</a>', re.DOTALL | re.IGNORECASE)
# only true tags: "<111>" is a crystal's orientation
_TAG = re.compile(r"</?(?:a|b|i|u|em|strong|sub|sup|br|p|span|div|li|ul|ol)\b[^<>]*>", re.IGNORECASE)
_INITIALS = re.compile(r"^(?:\S{1,3}\.[\s-]*)+")
_END_OF_NAMES = re.compile(r"(?<=\w{3})\.(?:\s|$)")


def _link(match: re.Match[str]) -> str:
    address, text = match.group(1).strip(), match.group(2)
    return f"{text} {address}" if "doi.org/" in address else text


def plain_text(markup: str | None) -> str:
    """Text without tags on one line; of the links, DOIs stay as addresses."""
    text = _TAG.sub("", re.sub(r"<br\s*/?>", " ", _LINK.sub(_link, markup or "")))
    text = re.sub(r"\[\s*(?:Calculation script[^\]]*|data|description)\s*\]", "", html.unescape(text))
    return re.sub(r"\s+", " ", text).strip().strip('\\"').strip()


def short_citation(markup: str | None) -> str:
    """First author and year ("Johnson et al. 1972"), as well as the reference's text tells them."""
    lines = [text for text in map(plain_text, (markup or "").splitlines()) if text]
    if not lines:
        return ""
    names = _END_OF_NAMES.split(re.sub(r"^\d\)\s*", "", lines[0]))[0]
    authors = [name for name in re.split(r"\s*,\s*|\s+and\s+", names) if re.search(r"[^\W\d_]{2}", name)]
    surname = _INITIALS.sub("", authors[0]) if authors else names[:30]
    shared = " et al." if len(authors) > 1 else ""
    text = " ".join(lines)
    year = re.search(r"\((1[89]\d\d|20\d\d)\)", text) or re.search(r"\b(1[89]\d\d|20\d\d)\b", text)
    return f"{surname}{shared}{' ' + year.group(1) if year and year.group(1) not in surname else ''}"

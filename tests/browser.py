"""Pages of a browser: opening them without any trouble, and waiting for what they show."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest


def wait_for(page: Any, holds: Callable[[], Any], seconds: float = 20.0) -> None:
    """Return when `holds` is true. Fails after `seconds`, and then says where it was called."""
    __tracebackhide__ = True
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            pytest.fail(f"the page does not come to this within {seconds:g} s")
        page.wait_for_timeout(20)


@contextmanager
def pages(browser: Any, *addresses: str) -> Iterator[Callable[..., Any]]:
    """Function that makes pages; script errors, messages and requests to other addresses fail at the end."""
    made, troubles = [], []

    def page(width: int = 1400, scheme: str = "light", **options: Any) -> Any:
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme, **options)
        made.append(page)
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("console", lambda said: troubles.append(said.text))
        page.on("dialog", lambda dialog: troubles.append(dialog.message))
        page.on("request", lambda request: request.url.startswith(addresses) or troubles.append(request.url))
        return page

    yield page
    for page in made:
        page.close()
    assert troubles == []

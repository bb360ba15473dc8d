"""Waiting for what a page in a browser shows."""

import time
from collections.abc import Callable
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

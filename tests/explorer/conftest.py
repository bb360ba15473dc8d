"""A headless Chromium for tests of the explorer; PELLICLE_BROWSER names another one."""

import os
import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is absent: make browser-tests")
    found = os.environ.get("PELLICLE_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("there is no Chromium: install it, or name one in PELLICLE_BROWSER")
    with playwright.sync_playwright() as driver:
        with_root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
        chromium = driver.chromium.launch(executable_path=found, args=with_root)
        yield chromium
        chromium.close()

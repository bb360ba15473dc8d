"""The page of `pellicle explore` in a browser: its server, and what the modules of tests do with it."""

import base64
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.browser import pages


@contextmanager
def explorer(folder: Path, recipe: str) -> Iterator[tuple[subprocess.Popen, str]]:
    """A running `pellicle explore`, and the address that it prints; an interrupt ends it in peace."""
    (folder / "film.toml").write_text(recipe)
    code = "from pellicle.cli import process; process()"
    command = [sys.executable, "-c", code, "explore", str(folder / "film.toml"), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        yield server, server.stdout.readline().strip()
        server.send_signal(signal.SIGINT)
        assert server.wait(timeout=20) == 0


@contextmanager
def opening(browser: Any, address: str) -> Iterator[Any]:
    """Function that opens the page at an address with a query, and waits for it."""
    origin = address.split("/?")[0]
    with pages(browser, origin, "data:", f"blob:{origin}") as new_page:

        def open_page(query: str = "", **options: Any) -> Any:
            page = new_page(accept_downloads=True, **options)
            page.goto(address + query)
            settle(page)
            return page

        yield open_page


def settle(page: Any) -> None:
    """Wait until everything is compiled, drawn and listed."""
    page.wait_for_selector(".plot[data-ready]")
    page.wait_for_selector(".plan li")
    page.wait_for_selector("main:not([data-busy])", timeout=60_000)


def slider(page: Any) -> Any:
    return page.get_by_role("slider", name="thickness in nm")


def number(page: Any) -> Any:
    return page.get_by_role("spinbutton", name="thickness (nm)")


def drop(page: Any, name: str, content: bytes) -> None:
    """Drop a file on the page, as a browser does."""
    script = """([name, content]) => {
      const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
      const data = new DataTransfer();
      data.items.add(new File([bytes], name));
      for (const kind of ["dragenter", "dragover", "drop"]) {
        document.querySelector("main").dispatchEvent(
          new DragEvent(kind, { bubbles: true, cancelable: true, dataTransfer: data }));
      }
    }"""
    page.evaluate(script, [name, base64.b64encode(content).decode()])


def curve(page: Any, name: str = "R", axis: str = "y") -> Any:
    """Ordinates or abscissae of a curve of the plot."""
    script = "([name, axis]) => document.querySelector('.plot').data.find((t) => t.name === name)?.[axis]"
    return page.evaluate(script, [name, axis])

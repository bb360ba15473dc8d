"""Page of a live series on this machine: it is redrawn while files arrive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pellicle.explorer.page import policy
from pellicle.explorer.server import serve_beside
from pellicle.fitting.parameter import Parameter
from pellicle.mapping.live_series import LiveFit, LiveSeries
from pellicle.reporting import live_series as report
from pellicle.reporting.json_record import strict


class LivePage:
    """Session of the page of a live series."""

    def __init__(self, live: LiveSeries, title: str):
        self.live, self.title = live, title

    def serve(self, port: int = 0) -> str:
        """Serve the page in a thread; returns its address. Raises as `server.serve` does."""
        return serve_beside(self, self.page, port)

    def page(self, _: str) -> tuple[str, str]:
        """Document and Content-Security-Policy of the page."""
        return report.live_page(*self._state(), title=self.title, count=self.live.done), policy()

    def answer(self, request: str, body: Any) -> dict[str, Any]:
        """Parts of the page that changed since so many fits as it has `seen`."""
        if request != "news":
            return {"error": f"there is no request {request!r}"}
        done = self.live.done
        if isinstance(body, Mapping) and body.get("seen") == done:
            return {"count": done}
        return strict({"count": done, **report.news(*self._state())})

    def _state(self) -> tuple[list[LiveFit], tuple[Parameter, ...], str]:
        return [*self.live.fits.values()], self.live.parameters, self.live.unit

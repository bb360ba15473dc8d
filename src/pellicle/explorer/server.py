"""Local server: one page and the requests of its session, for this machine only.

Every request must name this machine as its host, so that no other site can reach the server by rebinding its
name, and bear a random token, which only the address that was printed has.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from pellicle.errors import UsageError, needs
from pellicle.explorer.page import document, policy

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response

    from pellicle.explorer.session import Session

HOST = "127.0.0.1"
LARGEST_BODY = 32_000_000
"""Bytes of the largest request: a data file of `LARGEST_FILE` in base64."""
SLOWEST = 10.0
"""Seconds after which a request must have arrived: browsers on the same machine take some milliseconds."""
_TOKEN = "X-Pellicle-Token"
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
}


Page = Callable[[str], tuple[str, str]]
"""Document and Content-Security-Policy of a page, for a random text."""


@runtime_checkable
class Answering(Protocol):
    """A session, which answers the requests of its page."""

    def answer(self, request: str, body: Any) -> dict[str, Any]:
        """The answer to the request of this name, for JSON."""
        ...


def explorer_page(nonce: str) -> tuple[str, str]:
    """The page of the explorer."""
    return document(nonce), policy(nonce)


def application(session: Answering, token: str, port: int, made: Page = explorer_page) -> Starlette:
    """Return the application of a session: `GET /?token=...` for its page, and `POST /api/NAME`.

    **Raises:** UsageError without Starlette.
    """
    with needs("explore", "the explorer needs"):
        from starlette.applications import Starlette
        from starlette.concurrency import run_in_threadpool
        from starlette.requests import ClientDisconnect
        from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse
        from starlette.routing import Route
    hosts = {f"{name}:{port}" for name in (HOST, "localhost")}

    def refused(request: Request, given: str) -> Response | None:
        if request.headers.get("host", "") not in hosts:
            return PlainTextResponse("this server answers on this machine only\n", 421, _HEADERS)
        if not secrets.compare_digest(given.encode(), token.encode()):
            sentence = "the token is missing or wrong: open the address that pellicle has printed\n"
            return PlainTextResponse(sentence, 403, _HEADERS)
        return None

    async def page(request: Request) -> Response:
        if refusal := refused(request, request.query_params.get("token", "")):
            return refusal
        content, allowed = made(secrets.token_urlsafe(16))
        return HTMLResponse(content, headers={**_HEADERS, "Content-Security-Policy": allowed})

    async def api(request: Request) -> Response:
        if refusal := refused(request, request.headers.get(_TOKEN, "")):
            return refusal
        content = bytearray()
        try:
            async with asyncio.timeout(SLOWEST):
                async for part in request.stream():
                    content += part
                    if len(content) > LARGEST_BODY:
                        error = (
                            f"the request is larger than {LARGEST_BODY // 1_000_000} MB: give a smaller file"
                        )
                        return JSONResponse({"error": error}, 413, _HEADERS)
        except (TimeoutError, ClientDisconnect):
            ending = {**_HEADERS, "Connection": "close"}
            return JSONResponse({"error": "the request did not arrive whole: send it again"}, 408, ending)
        try:
            body = json.loads(content or b"{}")
        except (ValueError, RecursionError):
            return JSONResponse({"error": "the body of a request must be JSON"}, 400, _HEADERS)
        answer = await run_in_threadpool(session.answer, request.path_params["name"], body)
        return JSONResponse(answer, 200, _HEADERS)

    routes = [Route("/", page), Route("/api/{name}", api, methods=["POST"])]
    return Starlette(routes=routes)


def serve(session: Session, port: int = 0, ready: Callable[[str], Any] = lambda address: None) -> None:
    """Serve a session on this machine until it is interrupted.

    **Arguments:** `port`, 0 for a free one; `ready`, called with the page's address once it can be opened.

    **Raises:** UsageError without the packages of the extra, and where the port cannot be opened.
    """
    run, address = _server(session, port)
    session.prepare()
    ready(address)
    run()


def serve_beside(session: Answering, made: Page, port: int = 0) -> str:
    """Serve a page in a thread that ends with the process; returns its address. Raises as `serve` does."""
    run, address = _server(session, port, made)
    threading.Thread(target=run, name="page", daemon=True).start()
    return address


def _server(session: Answering, port: int, made: Page = explorer_page) -> tuple[Callable[[], None], str]:
    """The function that serves a session, and the address of its page."""
    with needs("explore", "the page needs"):
        import uvicorn
    # the protocol is named, or asyncio sends with delay: answers would wait 40 ms for an acknowledgement
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
    except (OSError, OverflowError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or "it must be 0 to 65535"
        raise UsageError(
            f"port {port} cannot be opened ({reason}): choose another, or none for a free one"
        ) from None
    opened, token = listener.getsockname()[1], secrets.token_urlsafe(24)
    how: Any = {"log_level": "error", "access_log": False, "lifespan": "off", "server_header": False}
    how |= {"timeout_graceful_shutdown": 1, "http": _with_timeout}
    settings = uvicorn.Config(application(session, token, opened, made), **how)
    listener.listen(64)

    def run() -> None:
        with listener:
            uvicorn.Server(settings).run(sockets=[listener])

    return run, f"http://{HOST}:{opened}/?token={token}"


def _with_timeout(*arguments: Any, **options: Any) -> Any:
    """A connection of uvicorn that is closed where the head of a request does not arrive within `SLOWEST`.

    uvicorn limits the time between requests only.
    """
    from uvicorn.protocols.http.h11_impl import H11Protocol

    protocol = H11Protocol(*arguments, **options)

    def check(before: bool) -> None:
        transport, cycle = protocol.transport, protocol.cycle
        if transport is not None and transport.is_closing():
            return
        waits = (cycle is None or cycle.response_complete) and protocol.timeout_keep_alive_task is None
        if waits and before:
            transport.close()
        else:
            protocol.loop.call_later(SLOWEST / 2, check, waits)

    protocol.loop.call_later(SLOWEST / 2, check, True)
    return protocol

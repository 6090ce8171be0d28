"""Servers on the loopback address: of a studio, and of pages that are made when somebody asks for them.

A studio is for the browser of the person who started it and for nobody else. Its address holds a random token, without which
there is nothing. Requests whose Host is another name are refused, because a name of somebody else's may lead to the loopback
address; and so are questions that another page asks. It serves no file.
"""

import asyncio
import secrets
import socket
import time
from collections.abc import Callable
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from segar.errors import SegarError
from segar.playground.studio import FORMS, Studio
from segar.playground.worker import LOOK, Worker
from segar.support import from_json

HOST = "127.0.0.1"
MOST_BYTES = 1_000_000  # of a question
MOST_MEMORY = 2 * 2**30  # [bytes] of all answers, beyond what the studio takes at its start
MOST_CONNECTIONS = 64  # at once
TOKEN_BYTES = 32
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
"""Of all answers: nothing is kept, shown in a frame, or read by other pages."""


def serve_pages(home: str, place: str, made: Callable[[str], str], port: int = 0) -> None:
    """Serves pages until Ctrl-C, and prints the address.

    Args:
        home: HTML.
        place: begins the addresses of other pages, such as ``play/``.
        made: the HTML of the page whose address goes on with this name; what is wrong with it is a :class:`SegarError`.
        port: 0: a free one.
    """

    async def first(request: Request) -> Response:
        return HTMLResponse(home)

    async def other(request: Request) -> Response:
        try:
            return HTMLResponse(await run_in_threadpool(made, request.path_params["name"]))
        except SegarError as error:
            return PlainTextResponse(str(error), 404)

    app = Starlette(
        routes=[Route("/", first), Route(f"/{place}{{name}}", other)],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])],
    )
    uvicorn.run(app, host=HOST, port=port, log_level="info", access_log=False)


class StudioServer:
    """Serves a studio from the moment it is made until ``stop``; ``run`` answers.

    Attributes:
        address: what a browser opens.

    Raises:
        SegarError: the port is taken.
    """

    def __init__(self, studio: Studio, port: int = 0) -> None:
        self._html, self._worker = studio.html, Worker(lambda asked: _answered(studio, *asked), MOST_MEMORY)
        self._socket = _listening(port)
        self.port: int = self._socket.getsockname()[1]
        self._token = secrets.token_urlsafe(TOKEN_BYTES)
        self.address = f"http://{HOST}:{self.port}/{self._token}/"
        self._hosts = {f"{HOST}:{self.port}", f"localhost:{self.port}"}
        self._working: tuple[str, float] | None = None
        app = Starlette(routes=[Route("/{rest:path}", self._respond, methods=["GET", "POST"])])
        quiet: dict[str, Any] = {"log_level": "warning", "access_log": False, "server_header": False}
        bare: dict[str, Any] = {"lifespan": "off", "ws": "none", "limit_concurrency": MOST_CONNECTIONS}
        self._server = uvicorn.Server(uvicorn.Config(app, **quiet, **bare))

    def run(self) -> None:
        """Answer requests until ``stop`` or Ctrl-C; then work that is not done is ended."""
        try:
            self._server.run(sockets=[self._socket])
        finally:
            self._worker.close()

    def stop(self) -> None:
        """Have ``run`` return soon."""
        self._server.should_exit = True

    async def _respond(self, request: Request) -> Response:
        """The page, or the answer to a question."""
        host = request.headers.get("host", "")
        token, _, name = request.path_params["rest"].partition("/")
        if host not in self._hosts:
            return _empty(403)
        if not secrets.compare_digest(token.encode(), self._token.encode()) or "/" not in request.path_params["rest"]:
            return _empty(404)
        if request.method != "POST":
            return HTMLResponse(self._html, headers=HEADERS) if name == "" else _empty(404)
        if request.headers.get("origin") != f"http://{host}":
            return _empty(403)
        if name not in FORMS:
            return _empty(404)
        if request.headers.get("content-type") != "application/json":
            return _said(415, "a question is JSON, and its Content-Type application/json")
        try:
            body = await _body_of(request)
        except ClientDisconnect:
            return _empty(400)
        if body is None:
            return _said(413, f"a question has at most {MOST_BYTES:,} bytes")
        try:
            question = from_json(body)
        except ValueError as error:
            return _said(400, f"the question is no JSON: {error}")
        return await self._answer(request, name, question)

    async def _answer(self, request: Request, name: str, question: Any) -> Response:
        """The answer to a question, while nobody else asks; the work is ended where nobody waits for it any more."""
        if self._working is not None:
            other, since = self._working
            seconds = time.monotonic() - since
            return _said(
                409, f"the studio is at work ({other}, for {seconds:.0f} s); wait until it is done, or stop it"
            )
        self._working, reply = (name, time.monotonic()), None
        try:
            self._worker.ask((name, question))
            while reply is None:
                if self._server.should_exit or await request.is_disconnected():
                    self._worker.stop()
                    return _said(503, "the work was stopped")
                await asyncio.sleep(LOOK)
                reply = self._worker.answered()
        except (EOFError, OSError):
            return _said(500, "the system ended the work, perhaps for lack of memory; ask for smaller numbers")
        finally:
            self._working = None
        status, found, self._html = reply
        return JSONResponse(found, status, headers=HEADERS)


def _answered(studio: Studio, name: str, question: Any) -> tuple[int, dict[str, Any], str]:
    """Status and answer to a question, and the page as it is now."""
    try:
        return 200, studio.answer(name, question), studio.html
    except SegarError as error:
        why = str(error)
    except MemoryError as error:
        why = f"{name}: this takes more memory than there is ({error}); the studio takes at most {MOST_MEMORY / 2**30:g} GiB"
    except OSError as error:  # of a folder of runs
        why = f"{error.filename or 'the system'}: {error.strerror or error}"
    return 422, {"error": why}, studio.html


async def _body_of(request: Request) -> bytes | None:
    """The body of a request; None where it is too long, of which no more is read."""
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > MOST_BYTES:
            return None
    return body


def _empty(status: int) -> Response:
    return Response(status_code=status, headers=HEADERS)


def _said(status: int, why: str) -> Response:
    return JSONResponse({"error": why}, status, headers=HEADERS)


def _listening(port: int) -> socket.socket:
    """A socket that listens on the loopback address; raises :class:`SegarError`."""
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
        made.listen()
    except (OSError, OverflowError) as error:
        made.close()
        raise SegarError(f"--port: {port} cannot be used ({error}); leave it out, and a free one is taken") from error
    return made

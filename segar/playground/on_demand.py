"""A page on the loopback address, and pages that are made when somebody asks for them."""

from collections.abc import Callable

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route

from segar.errors import SegarError

HOST = "127.0.0.1"


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

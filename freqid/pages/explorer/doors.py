"""Which requests the explorer answers: of this machine, by name, and of a page's size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from flask import Flask

# bytes of a request's body: the page's own are a thousand times shorter
LARGEST = 2**20
# what a request that cannot be served is told, by status
_REFUSED = "This page is served to this machine only, under its own name."


def guard(server: Flask, hosts: Sequence[str] | None) -> None:
    """Refuse requests for other hosts, from other sites, and with large bodies.

    A site that points a name of its own at 127.0.0.1 (DNS rebinding) comes with that name as Host;
    another site's script comes with its Origin.
    """
    from flask import Response, request

    server.config["MAX_CONTENT_LENGTH"] = LARGEST

    def refused() -> Response | None:
        if request.content_length is not None and request.content_length > LARGEST:
            return Response(f"a body above {LARGEST} bytes", 413)
        if "chunked" in request.headers.get("Transfer-Encoding", ""):
            return Response("a body of unknown length", 411)
        if hosts is None:
            return None
        origin = request.headers.get("Origin")
        asked = [request.host, *([] if origin is None else [urlsplit(origin).netloc])]
        return None if all(_name(a) in hosts for a in asked) else Response(_REFUSED, 403)

    def odd(error: Exception) -> Response:
        """What is no request of the page's own is the asker's mistake, and is not printed."""
        from werkzeug.exceptions import HTTPException

        if isinstance(error, HTTPException):
            return Response(str(error.description), error.code or 400)
        return Response("This is no request of the page's own.", 400)

    server.before_request(refused)
    server.register_error_handler(Exception, odd)


def _name(host: str) -> str:
    """A host without its port: ``localhost:8050``, ``[::1]:8050``."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""

"""Access to the app: names of the host, origin, token and policies of the pages.

A web page of another site must not reach the app, and neither must other users of the machine:

- Host is a name of this server (a foreign name may point to 127.0.0.1, DNS rebinding);
- a request that changes something has our own Origin;
- a token in the first address becomes a cookie and leaves the address; an app with users has
  sessions instead, which begin with name and password;
- pages run no script but those of the app; pages of the report run in a sandbox.
"""

import secrets
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, urlencode

from starlette.responses import PlainTextResponse, RedirectResponse

from tankcal.products.app.people import LOCAL
from tankcal.text.shipped import LANGUAGES

TOKEN_BYTES = 18  # 144 bits
LANGUAGE_COOKIE = "tankcal-language"
SAFE_METHODS = ("GET", "HEAD")
OPEN_PATHS = ("/login", "/look")  # without a session
MISDIRECTED, FORBIDDEN = 421, 403
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'self'"
)
# A page of the report contains its scripts and styles, and loads no file.
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; frame-ancestors 'self'"
)
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    # Other sites get no address of ours. With "no-referrer", forms would lack their Origin.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def new_token():
    """New random token."""
    return secrets.token_urlsafe(TOKEN_BYTES)


class Guard:
    """Middleware that answers only requests with the right host, origin and token.

    Parameters
    ----------
    app : ASGI application
        Application behind the guard.
    hosts : set of str
        Accepted values of Host, with the port.
    token : str
        Token of the first address and of the cookie.
    cookie : str
        Name of the cookie; cookies are not separated by port, so that it contains the port.
    is_secure : bool
        Whether the browser uses TLS.
    people : People, optional
        Users, whose sessions replace the token.
    base : str
        Prefix of all addresses.
    """

    def __init__(self, app, hosts, token, cookie, is_secure=False, people=None, base=""):
        self.app, self.hosts, self.token, self.cookie = app, hosts, token, cookie
        self.is_secure, self.people, self.base = is_secure, people, base

    async def __call__(self, scope, receive, send):
        if scope["type"] == "lifespan":  # start and end of the server
            await self.app(scope, receive, send)
        if scope["type"] != "http":  # there are no web sockets
            return
        answer = self._refuse(scope)
        if answer is None:
            await self.app(scope, receive, self._with_headers(send))
        else:
            await answer(scope, receive, self._with_headers(send))

    def _refuse(self, scope):
        """Response to a request that is not passed on, or None."""
        headers = {name.decode("latin-1"): value for name, value in scope["headers"]}
        values = {name: value.decode("latin-1") for name, value in headers.items()}
        host = values.get("host", "").lower()
        if host not in self.hosts:
            return PlainTextResponse("unknown host", MISDIRECTED)
        scheme = "https" if self.is_secure else "http"
        is_change = scope["method"] not in SAFE_METHODS
        if is_change and values.get("origin", "").lower() != f"{scheme}://{host}":
            return PlainTextResponse("unknown origin", MISDIRECTED)
        scope["cookie"], scope["person"] = self.cookie, LOCAL
        if self.people is not None:
            return self._refuse_stranger(scope, values)
        query = parse_qsl(scope["query_string"].decode("latin-1"))
        offered = [value for name, value in query if name == "token"]
        if offered and not is_change and self._is_token(offered[0]):
            language = next((value for name, value in query if name == "language"), "")
            rest = urlencode([item for item in query if item[0] not in ("token", "language")])
            # Two slashes at the start would lead to another host.
            path = "/" + scope["path"].lstrip("/")
            answer = RedirectResponse(path + (f"?{rest}" if rest else ""), 303)
            answer.set_cookie(
                self.cookie, self.token, httponly=True, samesite="strict", secure=self.is_secure
            )
            if language in LANGUAGES:
                answer.set_cookie(LANGUAGE_COOKIE, language, samesite="strict")
            return answer
        if not self._is_token(self._cookie_of(values)):
            return PlainTextResponse(
                "Open the address that tankcal printed; it contains a token.", FORBIDDEN
            )
        return None

    def _refuse_stranger(self, scope, values):
        """Response to a request without a session: the page that begins it, or None."""
        person = self.people.person(self._cookie_of(values))
        if person is not None:
            scope["person"] = person
            return None
        path = scope["path"].removeprefix(self.base)
        scope["person"] = None
        if path in OPEN_PATHS or path.startswith("/static/"):
            return None
        if scope["method"] in SAFE_METHODS and "text/html" in values.get("accept", ""):
            return RedirectResponse(f"{self.base}/login?{urlencode({'back': scope['path']})}", 303)
        return PlainTextResponse("Log in first.", FORBIDDEN)

    def _is_token(self, text):
        return secrets.compare_digest(text.encode(), self.token.encode())

    def _cookie_of(self, values):
        """Token of the cookie, or ""."""
        try:
            morsel = SimpleCookie(values.get("cookie", "")).get(self.cookie)
        except CookieError:
            return ""
        return "" if morsel is None else morsel.value

    def _with_headers(self, send):
        """Function that adds the headers of all responses; a response may have its own policy."""

        async def send_with_headers(event):
            if event["type"] == "http.response.start":
                names = {name.lower() for name, _ in event["headers"]}
                extra = HEADERS | {"Content-Security-Policy": PAGE_POLICY}
                event["headers"] = [
                    *event["headers"],
                    *(
                        (name.lower().encode(), value.encode())
                        for name, value in extra.items()
                        if name.lower().encode() not in names
                    ),
                ]
            await send(event)

        return send_with_headers

"""Access to the app: users, roles and sessions; names of the host, origin, token and policies.

Users of an app that other machines can reach: names, roles, passwords, sessions.

users.toml has a table for each user, with roles and the hash of the password (scrypt, RFC 7914).

A web page of another site must not reach the app, and neither must other users of the machine:

- Host is a name of this server (a foreign name may point to 127.0.0.1, DNS rebinding);
- a request that changes something has our own Origin;
- a token in the first address becomes a cookie and leaves the address; an app with users has
  sessions instead, which begin with name and password;
- pages run no script but those of the app; pages of the report run in a sandbox.
"""

import hashlib
import json
import os
import re
import secrets
import time
import tomllib
from collections import defaultdict
from contextlib import suppress
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qsl, urlencode

from starlette.responses import PlainTextResponse, RedirectResponse

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.shipped import LANGUAGES

EDIT, RUN, REVIEW, APPROVE = PERMISSIONS = ("edit", "run", "review", "approve")
ROLES = {
    "viewer": (),
    "surveyor": (EDIT, RUN),
    "reviewer": (REVIEW,),
    "approver": (REVIEW, APPROVE),
}
LEAST_LETTERS, MOST_LETTERS = 10, 200  # of a password
MOST_NAME = 80
COST = {"n": 2**15, "r": 8, "p": 1}  # 32 MB and about 0.1 s for each attempt
MEMORY = 2**26  # bytes that scrypt may use
IDLE_S, LONGEST_S = 3600, 12 * 3600  # end of a session without a request, and in any case
WINDOW_S = 900  # time in which failed attempts are counted
MOST_OF_BOTH, MOST_OF_ADDRESS, MOST_OF_NAME = 5, 30, 60  # failed attempts in it
_NO_HASH = "scrypt$" + "00" * 16 + "$" + "00" * 32  # compared for a name that no user has


@dataclass(frozen=True)
class Person:
    """A person who uses the app.

    Attributes
    ----------
    name : str
        "" for the user of this machine, who enters a name where it is recorded.
    permissions : tuple of str
        Permitted actions, of PERMISSIONS.
    """

    name: str
    permissions: tuple = PERMISSIONS

    def may(self, permission):
        """Whether the person may do an action; "" is permitted to all."""
        return not permission or permission in self.permissions


LOCAL = Person("")


def hash_password(password, salt=None):
    """Text with salt and hash of a password."""
    salt = secrets.token_bytes(16) if salt is None else salt
    digest = hashlib.scrypt(password.encode(), salt=salt, maxmem=MEMORY, dklen=32, **COST)
    return f"scrypt${salt.hex()}${digest.hex()}"


def is_password(password, hashed):
    """Whether a password belongs to a text of `hash_password`."""
    salt = bytes.fromhex(hashed.split("$")[1])
    return secrets.compare_digest(hash_password(password, salt), hashed)


class People:
    """Users of a file, their sessions, and their failed attempts.

    Parameters
    ----------
    path : Path
        users.toml; it is read again after a change, which ends the sessions of removed users.

    Raises
    ------
    InputError
        If the file cannot be read, or if it has no user.
    """

    def __init__(self, path):
        self.path, self._stamp, self._users = Path(path), None, {}
        self._sessions, self._failures = {}, defaultdict(list)
        if not read_users(self.path):
            text = message(
                "users_none", "no user; expected a user, by tankcal app --add-user NAME --role ROLE"
            )
            raise InputError(Problem(str(self.path), text))

    def _read(self):
        """Users of the file, {name: (roles, hash)}; none if it became unreadable."""
        try:
            stamp = self.path.stat().st_mtime_ns
            if stamp != self._stamp:
                self._users, self._stamp = read_users(self.path), stamp
        except (OSError, InputError):
            self._users, self._stamp = {}, None
        return self._users

    def begin(self, name, password, address):
        """Begin a session, and return its token; None for a wrong name or password.

        Raises
        ------
        PermissionError
            After too many failed attempts.
        """
        now = time.monotonic()
        limits = {(name, address): MOST_OF_BOTH, ("", address): MOST_OF_ADDRESS,
                  (name, ""): MOST_OF_NAME}  # fmt: skip
        for key in list(self._failures):
            self._failures[key] = [at for at in self._failures[key] if now - at < WINDOW_S]
            if not self._failures[key]:
                del self._failures[key]
        if any(len(self._failures.get(key, ())) >= most for key, most in limits.items()):
            raise PermissionError
        hashed = self._read().get(name, ((), _NO_HASH))[1]
        # An unknown name takes as long as a wrong password.
        if not is_password(password[:MOST_LETTERS], hashed):
            for key in limits:
                self._failures[key].append(now)
            return None
        self._failures.pop((name, address), None)
        token = secrets.token_urlsafe(18)
        self._sessions[_digest(token)] = [name, hashed, now, now]
        return token

    def person(self, token):
        """`Person` of a session; None if it has ended, or if the password was changed."""
        key, now = _digest(token), time.monotonic()
        session = self._sessions.get(key)
        if session is None:
            return None
        name, hashed, began, seen = session
        roles, present = self._read().get(name, ((), None))
        if now - seen > IDLE_S or now - began > LONGEST_S or present != hashed:
            del self._sessions[key]
            return None
        session[3] = now
        return Person(name, tuple({item for role in roles for item in ROLES[role]}))

    def end(self, token):
        """End a session."""
        self._sessions.pop(_digest(token), None)


def _digest(token):
    """Key of a session, so that no comparison depends on the letters of a token."""
    return hashlib.sha256(token.encode("utf-8", "surrogateescape")).hexdigest()


def read_users(path):
    """Read {name: (roles, hash)} of a file; {} without a file, InputError if it is unreadable."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        users = {name: (tuple(user["roles"]), user["password"]) for name, user in content.items()}
        for roles, hashed in users.values():
            if not set(roles) <= ROLES.keys():
                raise ValueError(roles)
            if not re.fullmatch(r"scrypt\$[0-9a-f]{32}\$[0-9a-f]{64}", hashed):
                raise ValueError("hash")
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        text = message(
            "users_unreadable",
            "cannot be read; expected [NAME] with roles and password, as --add-user writes",
        )
        raise InputError(Problem(str(path), text)) from error
    return users


def add_user(path, name, roles, password):
    """Add a user to a file, or replace roles and password of a user.

    Raises
    ------
    InputError
        For a bad name, an unknown role, or a password with too few letters.
    """
    name = " ".join(name.split())
    if not name or len(name) > MOST_NAME or re.search(r"[\x00-\x1f\x7f]", name):
        text = message("user_name", "expected a name of 1 to {most} letters", most=MOST_NAME)
        raise InputError(Problem("--add-user", text))
    if not roles:
        text = message("user_roles", "missing; expected a role: {roles}", roles=", ".join(ROLES))
        raise InputError(Problem("--role", text))
    if not LEAST_LETTERS <= len(password) <= MOST_LETTERS:
        text = message(
            "user_password", "{count} letters; expected a password of {least} to {most} letters",
            count=len(password), least=LEAST_LETTERS, most=MOST_LETTERS,
        )  # fmt: skip
        raise InputError(Problem("--add-user", text))
    from tankcal.report.folders import replace_file

    users = read_users(path) | {name: (tuple(roles), hash_password(password))}
    lines = []
    for known, (granted, hashed) in users.items():
        lines += [f"[{json.dumps(known, ensure_ascii=False)}]",
                  f"roles = {json.dumps(list(granted))}", f'password = "{hashed}"', ""]  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    with replace_file(path) as temporary:
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write("\n".join(lines))


class ChangeLog:
    """File in the state folder with a line for each change: time, name, request, job."""

    def __init__(self, folder):
        self.path = Path(folder) / "changes.jsonl"

    def add(self, person, path, source, content):
        """Append a line."""
        line = {
            "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "name": person.name, "path": path, "job": source, "content": content,
        }  # fmt: skip
        with suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line, ensure_ascii=False) + "\n")


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

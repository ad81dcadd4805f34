"""A running app, and visitors of its pages without a browser."""

import http.client
import json
import os
import re
import signal
import subprocess
import time
import urllib.parse
import urllib.request
from contextlib import contextmanager
from http.cookiejar import CookieJar


class Visitor:
    """Requests pages of the app as a browser does, with its cookie and its origin."""

    def __init__(self, address):
        self.root = "/".join(address.split("/")[:3])
        cookies = urllib.request.HTTPCookieProcessor(CookieJar())
        self.opener = urllib.request.build_opener(cookies)
        self.home = self.get(address[len(self.root) :])

    def get(self, path):
        """Content of a page."""
        with self.opener.open(self.root + path, timeout=120) as answer:
            self.path = answer.url.removeprefix(self.root)
            return answer.read().decode("utf-8", "replace")

    def post(self, path, **fields):
        """Content of the page that follows a form."""
        return self._send(path, urllib.parse.urlencode(fields).encode(), {})

    def act(self, path, content):
        """Answer to an action on a table."""
        sent = json.dumps(content).encode()
        return json.loads(self._send(path, sent, {"Content-Type": "application/json"}))

    def _send(self, path, content, headers):
        headers = {**headers, "Origin": self.root}
        request = urllib.request.Request(self.root + path, content, headers)
        with self.opener.open(request, timeout=120) as answer:
            self.path = answer.url.removeprefix(self.root)
            return answer.read().decode("utf-8", "replace")

    def open_example(self, name="silva-1995"):
        """Copy an example; path of its first page."""
        self.post(f"/example/{name}")
        return self.path

    def compute(self, job, documents, within_s=300):
        """Compute a job and wait for its results page."""
        self.post(f"{job}run", documents="yes" if documents else "")
        end = time.monotonic() + within_s
        while True:
            page = self.get(f"{job}results")
            if 'id="progress" hidden' in page and "headline" in page:  # no run is active
                return page
            if time.monotonic() > end:
                raise TimeoutError(page)
            time.sleep(0.5)

    def events(self, job):
        """Open connection to the events of a job, as a window keeps."""
        url = urllib.parse.urlsplit(self.root)
        connection = http.client.HTTPConnection(url.hostname, url.port, timeout=60)
        cookies = "; ".join(f"{c.name}={c.value}" for c in self._cookies())
        connection.request("GET", f"{job}events", headers={"Cookie": cookies})
        return connection, connection.getresponse()

    def _cookies(self):
        (handler,) = (
            one for one in self.opener.handlers
            if isinstance(one, urllib.request.HTTPCookieProcessor)
        )  # fmt: skip
        return handler.cookiejar


@contextmanager
def serve_app(program, folder, *arguments):
    """Start an app; yields (process, address); it must end on Ctrl-C."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "TANKCAL_STATE": str(folder / "state")}
    environment |= {"LANG": "C", "LC_ALL": "C"}
    process = subprocess.Popen(
        [*program, "app", "--no-browser", "--workspace", str(folder / "workspace"), *arguments],
        stdout=subprocess.PIPE, text=True, env=environment, start_new_session=True,
    )  # fmt: skip
    try:
        line = process.stdout.readline()
        yield process, re.search(r"https?://\S+", line).group()
        process.send_signal(signal.SIGINT)
        process.wait(30)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait(20)

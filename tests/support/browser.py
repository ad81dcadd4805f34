"""A headless Chromium without a network, driven by its DevTools: what a reader of a page sees.

with Browser() as browser:
    browser.open(path)
    browser.type("#dip", "4,25")
    browser.text("#volume"), browser.picture("canvas"), browser.requests, browser.complaints
"""

import asyncio
import base64
import io
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tornado.websocket import websocket_connect

NAMES = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless=new",
    "--remote-debugging-port=0",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-extensions",
    "--window-size=1300,900",
)
THIS_MACHINE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"  # an option
PATIENCE_S = 60


class Browser:
    """One page; `options` are further ones of the command line."""

    def __init__(self, *options):
        found = next(filter(None, map(shutil.which, NAMES)), None)
        if found is None:
            pytest.skip(f"no Chromium here ({', '.join(NAMES)}): pages are not looked at")
        sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
        self._command = [found, *OPTIONS, *sandbox, *options]
        self._calls, self._session, self.events = 0, None, []

    def __enter__(self):
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        command = [*self._command, f"--user-data-dir={self._folder.name}", "about:blank"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        self._process = subprocess.Popen(command, **quiet)
        self._runner = asyncio.Runner()
        self._runner.run(self._connect())
        return self

    def __exit__(self, *error):
        self._runner.close()
        self._process.terminate()
        self._process.wait()
        self._folder.cleanup()

    async def _connect(self):
        port = Path(self._folder.name) / "DevToolsActivePort"
        deadline = time.monotonic() + PATIENCE_S
        while not (port.exists() and port.read_text().count("\n")):
            assert time.monotonic() < deadline, "Chromium did not start"
            await asyncio.sleep(0.05)
        number, path = port.read_text().split()
        url = f"ws://127.0.0.1:{number}{path}"
        self._socket = await websocket_connect(url, max_message_size=2**28)
        targets = (await self._ask("Target.getTargets"))["targetInfos"]
        target = next(one["targetId"] for one in targets if one["type"] == "page")
        attached = await self._ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            await self._ask(f"{domain}.enable")

    async def _ask(self, method, **parameters):
        self._calls += 1
        call = {"id": self._calls, "method": method, "params": parameters}
        if self._session:
            call["sessionId"] = self._session
        await self._socket.write_message(json.dumps(call))
        while True:
            answer = json.loads(await self._socket.read_message())
            if answer.get("id") == call["id"]:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def ask(self, method, **parameters):
        """The answer to a call of the DevTools."""
        return self._runner.run(self._ask(method, **parameters))

    def run(self, script):
        """The value of an expression in the page, a promise awaited."""
        answer = self.ask(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def open(self, path):
        """Load a file, and wait until it has been drawn."""
        self.events.clear()
        self.ask("Page.navigate", url=Path(path).resolve().as_uri())
        deadline = time.monotonic() + PATIENCE_S
        while self.run("document.readyState") != "complete":
            assert time.monotonic() < deadline, f"{path} was not loaded"
        self.drawn()

    def visit(self, url):
        """Load a page of a server of this machine."""
        self.events.clear()
        self.ask("Page.navigate", url=url)

    def wait_for(self, script, seconds=PATIENCE_S):
        """The value of an expression as soon as it is true; what it asks for may not be there."""
        deadline = time.monotonic() + seconds
        while True:
            found = self.run(
                f"(() => {{ try {{ const found = {script}; "
                "return found instanceof Node ? true : found } catch (e) { return null } })()"
            )
            if found:
                return found
            assert time.monotonic() < deadline, f"not within {seconds} s: {script}"
            time.sleep(0.05)

    def click(self, selector):
        """Press the mouse in the middle of an element."""
        element = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{element}.scrollIntoView({{block: 'center', inline: 'nearest'}})")
        self.drawn()
        x, y = self.run(
            f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])"
            f"({element}.getBoundingClientRect())"
        )
        where = {"x": x, "y": y, "button": "left", "clickCount": 1}
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, **where)
        self.drawn()

    def write(self, text):
        """Type a text, key by key, into what has the focus."""
        for char in text:
            self.ask("Input.dispatchKeyEvent", type="keyDown", key=char, text=char)
            self.ask("Input.dispatchKeyEvent", type="keyUp", key=char)

    def paste(self, selector, text):
        """Paste a text into an element, as the clipboard of another program holds it."""
        self.run(
            f"(() => {{ const data = new DataTransfer(); data.setData('text/plain', "
            f"{json.dumps(text)}); document.querySelector({json.dumps(selector)}).dispatchEvent("
            "new ClipboardEvent('paste', {clipboardData: data, bubbles: true, cancelable: true}));"
            " return 1 })()"
        )

    def drawn(self):
        """Wait for two frames, so that everything that changed is on the screen."""
        frame = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        self.run(f"{frame}.then(() => true)")

    def type(self, selector, text):
        """Type a text into a field, in place of what is there."""
        self.run(f"document.querySelector({json.dumps(selector)}).select()")
        self.run(f"document.querySelector({json.dumps(selector)}).focus()")
        if text:
            self.ask("Input.insertText", text=text)
        else:
            self.press("Delete", 46)

    def press(self, key, code):
        """Press a key in the element that has the focus."""
        for kind in ("keyDown", "keyUp"):
            self.ask("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code)
        self.drawn()

    def text(self, selector):
        """The text of an element, with plain spaces."""
        found = self.run(f"document.querySelector({json.dumps(selector)}).innerText")
        return found.replace("\N{NO-BREAK SPACE}", " ")

    def picture(self, selector=None):
        """The pixels (lines, columns, 3) of an element, or of what the window shows."""
        clip = {}
        if selector:
            element = f"document.querySelector({json.dumps(selector)})"
            self.run(f"{element}.scrollIntoView({{block: 'center'}})")
            self.drawn()
            box = self.run(
                f"(({{x, y, width, height}}) => [x + scrollX, y + scrollY, width, height])"
                f"({element}.getBoundingClientRect())"
            )
            names = ("x", "y", "width", "height")
            clip["clip"] = dict(zip(names, box, strict=True)) | {"scale": 1}
        shot = self.ask("Page.captureScreenshot", format="png", **clip)
        image = Image.open(io.BytesIO(base64.b64decode(shot["data"])))
        return np.asarray(image.convert("RGB")).astype(int)

    @property
    def requests(self):
        """Addresses that the page asked for, but its own and those that hold their content."""
        asked = [
            event["params"]["request"]["url"]
            for event in self.events
            if event["method"] == "Network.requestWillBeSent"
        ]
        return [one for one in asked[1:] if not one.startswith("data:")]

    @property
    def complaints(self):
        """Errors of scripts, and what the policy of the page refused."""
        kinds = ("Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled")
        return [event["params"] for event in self.events if event["method"] in kinds]

# SPDX-License-Identifier: Apache-2.0
"""Headless Chromium, driven over its DevTools protocol. It notes every request that the page makes."""
import asyncio
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

import websockets

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
START_TIMEOUT_S = 120.0
# The software renderer of Chromium, so that WebGL2 needs no graphics processor.
FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--mute-audio",
         "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
         "--disable-renderer-backgrounding", "--disable-background-timer-throttling",
         "--disable-backgrounding-occluded-windows", "--remote-debugging-port=0", "--remote-allow-origins=*")


def program():
    """Returns Chromium's path; None: it is not installed."""
    return next((path for path in map(shutil.which, PROGRAMS) if path), None)


class Browser:
    """A page in a browser of its own."""

    def __init__(self, width_px=1600, height_px=900):
        self._loop = asyncio.new_event_loop()
        self._profile = pathlib.Path(tempfile.mkdtemp(prefix="emit_console_"))
        self._process = subprocess.Popen(
            [program(), *FLAGS, f"--user-data-dir={self._profile}", f"--window-size={width_px},{height_px}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.requests = []
        self.errors = []
        self._next_id = 0
        try:
            self._socket = self._run(self._connect())
            for domain in ("Page", "Runtime", "Network", "Log"):
                self.call(f"{domain}.enable")
            self.call("Emulation.setDeviceMetricsOverride", width=width_px, height=height_px, deviceScaleFactor=1,
                      mobile=False)
        except BaseException:
            self.close()
            raise

    def _run(self, work):
        return self._loop.run_until_complete(asyncio.wait_for(work, START_TIMEOUT_S))

    async def _connect(self):
        port_file = self._profile / "DevToolsActivePort"
        end_s = time.monotonic() + START_TIMEOUT_S
        while not port_file.exists() or "\n" not in port_file.read_text():
            if time.monotonic() > end_s or self._process.poll() is not None:
                raise RuntimeError("Chromium does not start")
            await asyncio.sleep(0.05)
        port, path = port_file.read_text().split("\n")[:2]
        browser = await websockets.connect(f"ws://127.0.0.1:{port}{path}", max_size=None)
        await browser.send(json.dumps({"id": 0, "method": "Target.getTargets"}))
        while True:
            answer = json.loads(await browser.recv())
            if answer.get("id") == 0:
                break
        await browser.close()
        page = next(one for one in answer["result"]["targetInfos"] if one["type"] == "page")
        return await websockets.connect(f"ws://127.0.0.1:{port}/devtools/page/{page['targetId']}", max_size=None)

    def call(self, method, **parameters):
        """Calls a method of the protocol and returns its result."""
        return self._run(self._call(method, parameters))

    async def _call(self, method, parameters):
        self._next_id += 1
        number = self._next_id
        await self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(await self._socket.recv())
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._note(message)

    def _note(self, event):
        kind, parameters = event.get("method"), event.get("params", {})
        if kind == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])
        elif kind == "Network.webSocketCreated":
            self.requests.append(parameters["url"])
        elif kind == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(parameters["exceptionDetails"]))

    def open(self, url):
        self.call("Page.navigate", url=url)
        self.wait_for(f"location.href === {json.dumps(url)} && document.readyState === 'complete'")

    def evaluate(self, expression):
        """Returns the value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def wait_for(self, expression, seconds=30.0):
        """Waits until an expression is true. Returns its value; it raises when the time is over."""
        end_s = time.monotonic() + seconds
        while True:
            value = self.evaluate(expression)
            if value:
                return value
            if time.monotonic() > end_s:
                raise TimeoutError(f"never true: {expression}; errors of the page: {self.errors}")
            time.sleep(0.05)

    def click(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def move(self, x, y):
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def press(self, key):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=key if kind == "keyDown" and len(key) == 1 else "")

    def resize(self, width_px, height_px):
        self.call("Emulation.setDeviceMetricsOverride", width=width_px, height=height_px, deviceScaleFactor=1, mobile=False)

    def screenshot(self, path):
        import base64
        pathlib.Path(path).write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def keep(self, name, sizes_px=()):
        """Leaves pictures of the page, at its own size or at these, in the folder that TEST_PICTURES names, if any."""
        folder = os.environ.get("TEST_PICTURES")
        if not folder:
            return
        if not sizes_px:
            self.screenshot(f"{folder}/{name}.png")
        for width_px, height_px in sizes_px:
            self.resize(width_px, height_px)
            self.evaluate("new Promise((done) => setTimeout(done, 600))")
            self.screenshot(f"{folder}/{name}_{width_px}.png")

    def close(self):
        if getattr(self, "_socket", None) is not None:
            try:
                self._run(self._socket.close())
            except Exception:  # the browser may have gone
                pass
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._loop.close()
        shutil.rmtree(self._profile, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

"""A page in a browser without a window, by the protocol of its developer tools."""

import json
import shutil
import subprocess
import time
import urllib.request
from contextlib import contextmanager

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")


class Tab:
    def __init__(self, port):
        connect = pytest.importorskip("websockets.sync.client", reason="needs websockets").connect
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            tab = next(one for one in json.load(answer) if one["type"] == "page")
        self.link = connect(tab["webSocketDebuggerUrl"], max_size=None, legacy=True)
        self.calls, self.errors = 0, []
        self.call("Runtime.enable")

    def call(self, method, **values):
        self.calls += 1
        self.link.send(json.dumps({"id": self.calls, "method": method, "params": values}))
        while True:
            said = json.loads(self.link.recv(timeout=20))
            if said.get("method") == "Runtime.exceptionThrown":
                self.errors.append(said["params"]["exceptionDetails"])
            if said.get("id") == self.calls:
                return said["result"]

    def value(self, expression):
        return self.call("Runtime.evaluate", expression=expression)["result"].get("value")

    def wait(self, expression, send=lambda: None):
        """Go on sending until an expression is true."""
        end = time.monotonic() + 15.0
        while not self.value(expression):
            assert time.monotonic() < end, (expression, self.value("document.body.innerText"))
            send()
            time.sleep(0.02)


@contextmanager
def opened_tab(tmp_path):
    """A tab, until the end of its browser."""
    if BROWSER is None:
        pytest.skip("needs chromium")
    words = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"]
    with subprocess.Popen(
        [*words, f"--user-data-dir={tmp_path}", "about:blank"], stderr=subprocess.DEVNULL
    ) as browser:
        try:
            port, end = tmp_path / "DevToolsActivePort", time.monotonic() + 20.0
            while not port.exists() or not port.read_text():
                assert time.monotonic() < end
                time.sleep(0.05)
            tab = Tab(port.read_text().split()[0])
            yield tab
            tab.link.close()
        finally:
            browser.terminate()

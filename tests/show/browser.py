"""A browser without a window and without a network, steered through its debugging protocol."""

import base64
import io
import itertools
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--no-first-run",
    "--remote-debugging-port=0",
    "--host-resolver-rules=MAP * ~NOTFOUND",
)


def browser() -> str | None:
    """The program, where there is one."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


@final
class Tab:
    """A page in the browser, with all that it asked for and complained of."""

    def __init__(self, socket: "ClientConnection") -> None:
        self.socket, self.numbers = socket, itertools.count(1)
        self.requests: list[str] = []
        self.complaints: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to a command; what happens meanwhile is noted."""
        number = next(self.numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv(timeout=60.0))
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        content = message.get("params", {})
        match message.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(content["request"]["url"])
            case "Runtime.exceptionThrown":
                self.complaints.append(str(content["exceptionDetails"]))
            case "Log.entryAdded" if content["entry"]["level"] == "error":
                self.complaints.append(content["entry"]["text"])
            case _:
                pass

    def evaluate(self, script: str) -> Any:
        """The value of a script's last expression."""
        return self.call("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def until(self, script: str, seconds: float = 60.0) -> None:
        """Wait until a script's value is true."""
        end = time.monotonic() + seconds
        while not self.evaluate(script):
            if time.monotonic() > end:
                raise TimeoutError(script)
            time.sleep(0.05)

    def picture(self) -> bytes:
        """What is seen now, as a PNG file."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def pixels(self) -> np.ndarray:
        """What is seen now, (height, width, 3) from 0 to 1."""
        from matplotlib.image import imread

        return imread(io.BytesIO(self.picture()))[:, :, :3]


@contextmanager
def opened(page: Path, *flags: str, width: int = 900, height: int = 640) -> Iterator[Tab]:
    """Show a page; ``flags`` are further ones of the browser."""
    from websockets.sync.client import connect

    program = browser()
    if program is None:
        raise FileNotFoundError("no browser")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        port = Path(profile, "DevToolsActivePort")
        command = [
            program,
            *FLAGS,
            *flags,
            f"--window-size={width},{height}",
            f"--user-data-dir={profile}",
            "about:blank",
        ]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            end = time.monotonic() + 60.0
            while not (port.exists() and "\n" in port.read_text()):
                if time.monotonic() > end:
                    raise TimeoutError("the browser does not start")
                time.sleep(0.05)
            number = port.read_text().split()[0]
            with connect(_first_tab(number), max_size=None, open_timeout=60.0) as socket:
                tab = Tab(socket)
                for domain in ("Network", "Page", "Runtime", "Log"):
                    tab.call(f"{domain}.enable")
                tab.call("Page.navigate", url=page.resolve().as_uri())
                yield tab
        finally:
            process.terminate()
            process.wait(timeout=60.0)


def _first_tab(port: str) -> str:
    from http.client import HTTPConnection

    connection = HTTPConnection("127.0.0.1", int(port), timeout=60.0)
    connection.request("GET", "/json/list")
    tabs = json.loads(connection.getresponse().read())
    connection.close()
    return next(tab["webSocketDebuggerUrl"] for tab in tabs if tab["type"] == "page")

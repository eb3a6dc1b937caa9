"""What an editor does with a YAML file: it asks the YAML language server, over its standard streams."""

from __future__ import annotations

import json
import queue
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

_SETTINGS = {"validate": True, "completion": True, "hover": True, "schemaStore": {"enable": False}}
_PATIENCE = 30.0
"""Longest time for an answer [s]; the server's first one takes about one second."""


class Editor:
    """A language server, and files of `folder` that exist in the editor only.

    A `|` in a text is the place of the cursor.
    """

    def __init__(self, server: str, folder: Path) -> None:
        self._folder = folder
        self._server = subprocess.Popen(
            [server, "--stdio"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._messages: queue.Queue[dict[str, Any]] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        self._opened = self._asked = 0
        markdown = {"completionItem": {"snippetSupport": True, "documentationFormat": ["markdown"]}}
        capabilities = {"workspace": {"configuration": True}, "textDocument": {"completion": markdown}}
        self._ask("initialize", processId=None, rootUri=folder.as_uri(), capabilities=capabilities)
        self._tell("initialized")
        # Its first question is for the settings; before it knows them it would look for schemas elsewhere.
        self._wait(lambda message: message.get("method") == "workspace/configuration")

    def close(self) -> None:
        """End the server."""
        self._server.kill()
        self._server.wait()

    def completions(self, text: str) -> dict[str, str]:
        """Return what is offered at the cursor: for every label the text that would be written."""
        offered = self._at_cursor("textDocument/completion", text)["items"]
        return {item["label"]: item["textEdit"]["newText"] for item in offered}

    def hover(self, text: str) -> str:
        """Return what is shown about the word at the cursor, as Markdown."""
        shown: str = self._at_cursor("textDocument/hover", text)["contents"]["value"]
        return shown

    def _at_cursor(self, method: str, text: str) -> Any:
        before, _, after = text.partition("|")
        lines = before.split("\n")
        position = {"line": len(lines) - 1, "character": len(lines[-1])}
        return self._ask(method, textDocument=self._open(before + after), position=position)

    def _open(self, text: str) -> dict[str, str]:
        self._opened += 1
        file = {"uri": (self._folder / f"edited_{self._opened}.yaml").as_uri()}
        content = {"languageId": "yaml", "version": 1, "text": text}
        self._tell("textDocument/didOpen", textDocument={**file, **content})
        return file

    def _ask(self, method: str, **params: Any) -> Any:
        self._asked += 1
        asked = self._asked
        self._send({"id": asked, "method": method, "params": params})
        answer = self._wait(lambda message: message.get("id") == asked and "method" not in message)
        assert "error" not in answer, answer
        return answer["result"]

    def _tell(self, method: str, **params: Any) -> None:
        self._send({"method": method, "params": params})

    def _wait(self, wanted: Any) -> dict[str, Any]:
        """Return the first message that is wanted; questions of the server are answered meanwhile."""
        until = time.monotonic() + _PATIENCE
        while True:
            message = self._messages.get(timeout=max(0.0, until - time.monotonic()))
            if "id" in message and "method" in message:
                items = (message.get("params") or {}).get("items", [])
                settings = [_SETTINGS if item.get("section") == "yaml" else None for item in items]
                self._send({"id": message["id"], "result": settings or None})
            if wanted(message):
                return message

    def _send(self, message: dict[str, Any]) -> None:
        assert self._server.stdin is not None
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self._server.stdin.write(b"Content-Length: %d\r\n\r\n%b" % (len(body), body))
        self._server.stdin.flush()

    def _listen(self) -> None:
        assert self._server.stdout is not None
        while header := self._server.stdout.readline():
            length = int(header.removeprefix(b"Content-Length:"))
            while self._server.stdout.readline().strip():
                pass
            self._messages.put(json.loads(self._server.stdout.read(length)))

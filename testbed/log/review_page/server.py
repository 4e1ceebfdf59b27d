"""A folder of results in a browser: its report, its files, and a page of every log, made when it is asked for.

The server listens on the loopback address alone and reads files of the folder alone: no other machine reaches it, a
link out of the folder leads nowhere, and nothing is written into the folder.
"""

import html
import re
import sys
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any
from urllib.parse import quote, unquote, urlsplit

from testbed.log.review_page.page import asset, write

LOOPBACK = "127.0.0.1"
REPORT = "report.html"
HTML, LOG = ".html", ".rrd"
MOST = 500  # logs in the list of a folder without a report
PAIR = "_beside_truth"  # ends the name of a log of two drives, which has no page
LINK = re.compile(rf'(?:<a href="[^"]+\.html">page</a> )?<a href="([^"]+)(?<!{PAIR})\.rrd">rrd</a>')


class Pages:
    """Pages of logs: that beside the log if it is not older than the log, else one made once in a folder of our own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._made: dict[tuple[Path, int], Path] = {}
        self._lock = Lock()  # one page at a time: reading a log takes all of a core

    def page(self, log: Path) -> Path:
        """The page of a log; raises OSError or ValueError, in one sentence, where it cannot be made."""
        there, changed = log.with_suffix(HTML), log.stat().st_mtime_ns
        if there.is_file() and there.stat().st_mtime_ns >= changed:
            return there
        with self._lock:
            if (log, changed) not in self._made:
                self._made[log, changed] = write(log, self.folder / f"{len(self._made)}{HTML}")
            return self._made[log, changed]


class Handler(SimpleHTTPRequestHandler):
    """GET and HEAD of files below `directory`."""

    def __init__(self, *args: Any, directory: str, pages: Pages) -> None:
        self.root, self.pages = Path(directory).resolve(), pages
        super().__init__(*args, directory=str(self.root))

    def send_head(self) -> Any:
        """Send status and headers; returns what to send after them, None for nothing."""
        host = (self.headers.get("Host") or "").rpartition(":")[0]
        if host not in (LOOPBACK, "localhost"):  # a page elsewhere whose name leads here
            return self._refuse(HTTPStatus.FORBIDDEN, f"this server answers to {LOOPBACK} only")
        try:
            path = Path(self.translate_path(self.path)).resolve()
        except ValueError:  # a null character
            return self._refuse(HTTPStatus.BAD_REQUEST, "that address names no file")
        if not path.is_relative_to(self.root):
            return self._refuse(HTTPStatus.FORBIDDEN, "that file is not in the folder that is shown")
        if path == self.root:
            report = path / REPORT
            return self._text(linked(report.read_text("utf-8")) if report.is_file() else _listed(self.root))
        if path == self.root / REPORT and path.is_file():
            return self._text(linked(path.read_text("utf-8")))
        log = path.with_suffix(LOG)
        if path.suffix == HTML and log.is_file() and log.resolve().is_relative_to(self.root):
            return self._page(log)
        if not path.is_file():
            return self._refuse(HTTPStatus.NOT_FOUND, f"{unquote(urlsplit(self.path).path)} is not in the folder")
        return super().send_head()

    def _page(self, log: Path) -> Any:
        try:
            return self._text(self.pages.page(log).read_text("utf-8"))
        except (OSError, ValueError) as error:
            sentence = f"there is no page of {log.name}: {error}; open the log in the viewer"
            return self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, sentence)

    def _refuse(self, status: HTTPStatus, sentence: str) -> Any:
        return self._text(_document("Not shown", f"<p>{html.escape(sentence)}</p>"), status)

    def _text(self, text: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        body = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(body)

    def log_message(self, *args: Any) -> None:
        """Say nothing: the terminal shows the address."""


class Server(ThreadingHTTPServer):
    """Says nothing where a browser leaves before it has everything."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print what is a defect, as the library does."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


def serve(folder: Path, say: Callable[[str], None]) -> None:
    """Show a folder until Ctrl-C; `say` gets the address as soon as it answers.

    Raises OSError, in one sentence, where there is no such folder.
    """
    if not folder.is_dir():
        raise OSError(f"report: there is no folder {folder}; give the --out of `testbed compare` or `testbed regret`")
    with TemporaryDirectory() as made, server(folder, Path(made)) as listening:
        say(f"http://{LOOPBACK}:{listening.server_address[1]}/")
        try:
            listening.serve_forever()
        except KeyboardInterrupt:
            return


def server(folder: Path, made: Path) -> Server:
    """A server of a folder on a free port of the loopback address; pages that it makes go into `made`."""
    return Server((LOOPBACK, 0), partial(Handler, directory=str(folder), pages=Pages(made)))


def linked(report: str) -> str:
    """A report with a link to the page of every log that it links.

    >>> linked('<a href="logs/a.rrd">rrd</a>')
    '<a href="logs/a.html">page</a> <a href="logs/a.rrd">rrd</a>'
    """
    return LINK.sub(r'<a href="\1.html">page</a> <a href="\1.rrd">rrd</a>', report)


def _listed(root: Path) -> str:
    logs = sorted(path.relative_to(root) for path in root.rglob(f"*{LOG}") if not path.stem.endswith(PAIR))
    items = [
        f'<li>{html.escape(log.stem)}: <a href="{quote(log.with_suffix(HTML).as_posix())}">page</a> '
        f'<a href="{quote(log.as_posix())}">rrd</a></li>'
        for log in logs[:MOST]
    ]
    more = f"<p>and {len(logs) - MOST} more</p>" if len(logs) > MOST else ""
    return _document(f"Logs in {root.name}", f"<ul>{''.join(items)}</ul>{more}" if logs else "<p>There is no log.</p>")


def _document(title: str, body: str) -> str:
    return asset("plain.html").replace("{{title}}", html.escape(title)).replace("{{body}}", body)

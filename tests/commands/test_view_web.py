"""``mathnavi view --web`` and ``--save``: whom the server answers, and what is refused in one line."""

from __future__ import annotations

import json
import shutil
import socket
import struct
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.commands.web_server import PageServer


def ask(server: PageServer, path: str, headers: dict[str, str] | None = None, body: object = None) -> tuple[int, str]:
    """Status and text of an answer."""
    connection = HTTPConnection("127.0.0.1", server.server_address[1], timeout=30.0)
    sent = {"Content-Type": "application/json"} if body is not None else {}
    text = None if body is None else json.dumps(body)
    connection.request("GET" if body is None else "POST", path, text, {**sent, **(headers or {})})
    answer = connection.getresponse()
    found = answer.status, answer.read().decode()
    connection.close()
    return found


@pytest.fixture
def local() -> Iterator[PageServer]:
    """A server at this machine alone."""
    changed: list[object] = []
    server = PageServer("127.0.0.1", 0, lambda: "the page", {"/state": dict}, {"/change": changed.append})
    server.changed = changed  # type: ignore[attr-defined]
    with server.serving():
        yield server


def test_the_page_is_served_to_this_machine(local: PageServer) -> None:
    assert ask(local, "/") == (200, "the page")
    assert ask(local, "/state?since=3") == (200, '{"since":"3"}')
    assert ask(local, "/etc/passwd")[0] == 404
    assert "token" not in local.url


def test_a_page_from_elsewhere_is_refused(local: PageServer) -> None:
    port = local.server_address[1]
    for headers in ({"Host": "evil.example"}, {"Host": f"evil.example:{port}"}, {"Origin": "http://evil.example"}):
        for path, body in (("/", None), ("/state", None), ("/change", 1)):
            assert ask(local, path, headers, body)[0] == 403
    assert local.changed == []  # type: ignore[attr-defined]
    assert ask(local, "/change", {"Origin": f"http://127.0.0.1:{port}"}, {"a": 1})[0] == 200
    assert local.changed == [{"a": 1}]  # type: ignore[attr-defined]
    assert ask(local, "/change", {"Content-Type": "text/plain"}, 1)[0] == 415


def test_at_another_address_every_request_needs_the_token() -> None:
    server = PageServer("0.0.0.0", 0, lambda: "the page", {"/state": dict}, {"/change": lambda posted: posted})
    with server.serving():
        assert f"?token={server.token}" in server.url
        assert len(server.token) >= 32
        for path, body in (("/", None), ("/state", None), ("/change", 1)):
            assert ask(server, path, None, body)[0] == 403
            assert ask(server, f"{path}?token=x", None, body)[0] == 403
            assert ask(server, f"{path}?token={server.token}", None, body)[0] == 200


@pytest.mark.parametrize("fault", [None, KeyError("a defect")])
def test_a_browser_that_leaves_before_its_answer_is_no_error(
    fault: Exception | None, capfd: pytest.CaptureFixture[str]
) -> None:
    begun, left = threading.Event(), threading.Event()

    def page() -> str:
        begun.set()
        assert left.wait(30.0)
        if fault is not None:
            raise fault
        return "x" * 10_000_000  # more than a socket holds

    server = PageServer("127.0.0.1", 0, page, {"/state": dict})
    with server.serving():
        browser = socket.create_connection(("127.0.0.1", server.server_address[1]))
        browser.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.server_address[1]}\r\n\r\n".encode())
        assert begun.wait(30.0)
        browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # closed by a reset
        browser.close()
        left.set()
        answering = [each for each in threading.enumerate() if "process_request_thread" in each.name]
        for each in answering:
            each.join(30.0)
        assert ask(server, "/state") == (200, "{}")
    said = capfd.readouterr().err
    assert ("Traceback" in said) is (fault is not None)
    assert said == "" or "a defect" in said


def test_the_page_is_saved(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("robot", "numbers"):
        assert main(["view", str(runs / name), "--save", str(tmp_path / f"{name}.html")]) == 0
        assert (tmp_path / f"{name}.html").read_text().startswith("<!doctype html>")
    assert "numbers.html" in capsys.readouterr().out


def test_two_runs_are_one_page_with_the_names_of_their_folders(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "again"
    shutil.copytree(runs / "robot", again)
    page = tmp_path / "both.html"
    assert main(["view", str(runs / "robot"), str(again), "--save", str(page)]) == 0
    scene = json.loads(page.read_text().partition('id="scene">')[2].partition("</script>")[0])
    assert {"robot", "again"} <= {layer["name"] for layer in scene["layers"]}
    assert all(
        {own["name"].partition(":")[0] for own in chart["series"]} == {"robot", "again"} for chart in scene["charts"]
    )
    assert "DIR is given 2 times" in refused([str(again), str(again)], capsys)
    assert "is missing" in refused([], capsys)


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line with which a command is refused."""
    capsys.readouterr()
    assert main(["view", *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_what_cannot_be_shown_is_refused_in_one_line(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "does not exist" in refused([str(tmp_path / "absent"), "--web", "--port", "0"], capsys)
    (tmp_path / "empty").mkdir()
    assert "config.json" in refused([str(tmp_path / "empty"), "--web", "--port", "0"], capsys)
    robot = str(runs / "robot")
    assert "only together with --web" in refused([robot, "--host", "0.0.0.0"], capsys)
    assert "--port = 70000" in refused([robot, "--web", "--port", "70000"], capsys)
    assert "--speed = 0.0" in refused([robot, "--web", "--speed", "0"], capsys)
    assert "absent" in refused([robot, "--save", str(tmp_path / "absent" / "page.html")], capsys)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert f"--port = {port}" in refused([robot, "--web", "--port", port], capsys)
    assert "--host = 203.0.113.7" in refused([robot, "--web", "--host", "203.0.113.7", "--port", "0"], capsys)


def test_a_forged_scene_is_refused_in_one_line(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "forged"
    folder.mkdir()
    for file in (runs / "numbers").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    config = json.loads((folder / "config.json").read_text())
    config.pop("drawing")
    (folder / "config.json").write_text(json.dumps(config))
    np.savez(folder / "scene.npz", t=np.array([0.0]))
    assert "scene.npz: bodies is missing" in refused([str(folder), "--save", str(tmp_path / "page.html")], capsys)

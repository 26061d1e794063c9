"""The program that follows the links of the built pages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = Path(__file__).resolve().parents[2] / "docs" / "check_links.py"
GOOD = '<a href="b.html#there">b</a> <a href="https://example.org/x">x</a> <img src="data:image/png;base64,A=">'


def run(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, PROGRAM, folder], capture_output=True, text=True, timeout=60)


BAD = {
    '<a href="c.html">c</a>': "no such file",
    '<a href="b.html#nowhere">b</a>': "nothing is called nowhere",
    '<a href="../outside.html">c</a>': "leads out of the site",
    '<a href="https://nowhere">c</a>': "not the address of anything",
    '<script src="https://example.org/x.js"></script>': "lies elsewhere",
    '<img src="missing.png">': "no such file",
}


def test_links_that_lead_nowhere_are_reported_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text("\n".join([GOOD, *BAD]))
    (tmp_path / "b.html").write_text('<p id="there">here</p>')
    done = run(tmp_path)
    assert done.returncode == 1
    lines = done.stderr.splitlines()
    assert len(lines) == len(BAD)
    for k, (line, expected) in enumerate(zip(lines, BAD.values(), strict=True), start=2):
        assert line.startswith(f"a.html:{k}: ")
        assert expected in line


def test_a_site_that_is_whole_passes(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(GOOD)
    (tmp_path / "b.html").write_text('<p id="there">here</p><a href="#there">up</a>')
    done = run(tmp_path)
    assert (done.returncode, done.stdout) == (0, "2 pages, 4 links, 0 of them lead nowhere\n")


def test_a_folder_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    assert run(tmp_path / "none").returncode == 2

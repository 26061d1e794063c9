"""Check that a version can be released, build its sdist and wheel, and print what is left to do.

    .venv/bin/python .ci/release.py VERSION

Checked: the form of the version, pyproject.toml, CITATION.cff and the changelog, which has a dated section for it; that
nothing is uncommitted and no tag has the name; that the archives hold that version. Nothing is published or tagged.
"""

from __future__ import annotations

import datetime
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FORM = re.compile(r"\d+\.\d+\.\d+(rc\d+)?")


def faults(version: str, root: Path = ROOT) -> Iterator[str]:
    """Return the reasons that prevent a release, one line each."""
    if not FORM.fullmatch(version):
        yield f"VERSION = {version!r}; allowed: X.Y.Z or X.Y.ZrcN"
        return
    stated = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    if stated != version:
        yield f"pyproject.toml: version = {stated!r}; allowed: {version!r}"
    if not re.search(
        rf"^version: {re.escape(version)}$", (root / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE
    ):
        yield f"CITATION.cff has another version; allowed: {version}"
    heading = re.compile(rf"^## \[{re.escape(version)}\] - (\d{{4}}-\d\d-\d\d)$", re.MULTILINE)
    dated = heading.search((root / "CHANGELOG.md").read_text(encoding="utf-8"))
    if dated is None:
        yield f"CHANGELOG.md has no section for it; allowed: '## [{version}] - YYYY-MM-DD'"
    elif dated[1] > datetime.date.today().isoformat():
        yield f"CHANGELOG.md: {dated[1]} is not past"
    if said("git", "status", "--porcelain", root=root):
        yield "there are changes that are not committed; allowed: none"
    if said("git", "tag", "--list", f"v{version}", root=root):
        yield f"the tag v{version} is there already"


def said(*command: str, root: Path = ROOT) -> str:
    """Output of a command; CalledProcessError if it fails."""
    return subprocess.run(command, cwd=root, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def main(argv: Sequence[str]) -> int:
    """The exit code: 0 if the version can be released, 2 if not."""
    version = argv[0] if argv else ""
    if found := list(faults(version)):
        print("\n".join(f"release: {line}" for line in found), file=sys.stderr)
        return 2
    dist = ROOT / "dist"
    shutil.rmtree(dist, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "hatchling", "build", "--directory", str(dist)], cwd=ROOT, check=True)
    names = sorted(path.name for path in dist.iterdir())
    assert names == [f"mathnavi-{version}-py3-none-any.whl", f"mathnavi-{version}.tar.gz"], names
    subprocess.run([sys.executable, "-m", "pytest", "-q", "tests/test_wheel.py"], cwd=ROOT, check=True)
    print(f"\ndist/ is ready. Left to do, when continuous integration has passed on this commit:\n"
          f"    git tag -a v{version} -m 'mathnavi {version}' && git push origin v{version}\n"
          f"    upload {' and '.join(f'dist/{name}' for name in names)}")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Words that are none, and places that cannot be written to or read."""

from __future__ import annotations

from pathlib import Path

from numpy.random import Generator

from tests.hostile.attacks.attack import COMMANDS, FILES, Attack, bring, good, written
from tests.hostile.judge import Case
from tests.hostile.values import NUMBERS, PLACES, misspelt, one_of, text

FLAGS = """
--report --video --cluster --cluster=tcp://x --cluster=tcp://127.0.0.1:1 --cluster=http://[ --workers=0 --workers=1e9
--timeout=nan --rare --quick --retry --help -h --still --clip --from=. --no-video --no-out --out=
""".strip()
UNKNOWN = "--xyzzy --out- --OUT ---out --plan.nodes=3 --planner=3 --.=3 --planner.=3 --= -o -7 --\udcff --\x01"
TAKEN = "textbook trials.db hills.npz study trials.csv flight/log.npz textbook/config.json precious.txt/x.npz"
OTHERS = ("textbook", "trials.db", "hills.npz", "study", "arm.xml", "trials.csv", "N42E080.hgt")
CHANGES = ("text", "number", "misspelt", "gone", "twice", "added", "flag", "unknown", "cut")


def any_words(rng: Generator, shop: Path, work: Path) -> Case:
    """A command and words that mean nothing."""
    command = one_of(rng, list(COMMANDS))
    words = [*command.split(), *(text(rng) for _ in range(int(rng.integers(0, 4))))]
    if rng.random() < 0.15:
        words[0] = one_of(rng, (misspelt(rng, words[0]), text(rng)))
    return Case(command, "words", tuple(words), writes=written(words, work))


def changed_words(rng: Generator, shop: Path, work: Path) -> Case:
    """A good command line with a word changed, dropped, doubled or added."""
    command, words = good(rng, shop, work)
    first = len(command.split())
    k = int(rng.integers(first, max(len(words), first + 1)))
    how = one_of(rng, CHANGES)
    culprits: tuple[str, ...] = ()
    if how in ("text", "number"):
        words[k : k + 1] = [text(rng) if how == "text" else one_of(rng, NUMBERS)]
    elif how == "misspelt":
        words[k : k + 1] = [misspelt(rng, word) for word in words[k : k + 1]]
    elif how == "gone":
        del words[k : k + 1]
    elif how == "twice":
        words[k:k] = words[k : k + 1 + int(rng.integers(2))]
    elif how in ("added", "flag"):
        words.insert(k, text(rng) if how == "added" else one_of(rng, FLAGS.split()))
    elif how == "unknown":
        words.append(one_of(rng, UNKNOWN.split()))
        culprits = (words[-1].partition("=")[0], words[-1].strip(), words[0], "missing", "xff")
    else:
        del words[k:]
    return Case(command, "words", tuple(words), culprits, written(words, work), f"{how} at {k}")


def written_places(rng: Generator, shop: Path, work: Path) -> Case:
    """A place to write to that cannot be, or is taken."""
    makers = (
        "run",
        "sweep",
        "search",
        "store export",
        "study",
        "estimate",
        "compare",
        "terrain import",
        "terrain show",
        "report",
        "new",
        *(["export"] if "export" in COMMANDS else []),
    )
    command, words = good(rng, shop, work, *makers)
    flag = next((word for word in words if word in FILES), "")
    if not flag:  # of a command that need not be told
        flag = "--out"
        words += [flag, "new.html" if command == "report" else "new"]
    k = words.index(flag) + 1
    place = one_of(rng, PLACES)
    if rng.random() < 0.4 and not place.startswith("/dev"):  # a file with an ending can be made there
        place += Path(words[k]).suffix
    if rng.random() < 0.2:
        place = one_of(rng, TAKEN.split())
        name = place.partition("/")[0]
        if not (work / name).exists():
            bring(shop, work, name)
    words[k] = place
    return Case(command, "place", tuple(words), (flag, place), written(words, work), f"{flag} {place[:40]!r}")


def read_places(rng: Generator, shop: Path, work: Path) -> Case:
    """Another thing in the place of what is read."""
    readers = ("run", "store show", "store export", "study", "estimate", "render", "view", "compare", "terrain import")
    more = ("terrain show", "report", "check", *(["export"] if "export" in COMMANDS else []))
    command, words = good(rng, shop, work, *readers, *more)
    read = [k for k, word in enumerate(words) if k and (work / word).exists()]
    if not read:
        return any_words(rng, shop, work)
    k = one_of(rng, read)
    former, place = words[k], one_of(rng, (*PLACES, *OTHERS))
    if place in OTHERS and not (work / place).exists():
        bring(shop, work, place)
    if rng.random() < 0.3:
        place += Path(former).suffix
    words[k] = place
    culprits = (place[:30], place.strip(), ascii(place)[1:-1], "DIR", "FILE", "NAME", "missing", "not expected")
    return Case(command, "place", tuple(words), culprits, written(words, work), f"{former} is {place[:40]!r}")


def gone(rng: Generator, shop: Path, work: Path) -> Case:
    """A good command line in a folder that has been removed."""
    command, words = good(rng, shop, work)
    return Case(command, "working folder", tuple(words), writes=(), gone=True)


ATTACKS: dict[Attack, int] = {any_words: 14, changed_words: 26, written_places: 14, read_places: 10, gone: 3}

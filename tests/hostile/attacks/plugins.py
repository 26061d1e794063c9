"""Mechanisms that are none, plug-ins that misbehave, and modules that stand in the way."""

from __future__ import annotations

from pathlib import Path

from numpy.random import Generator

from tests.hostile import files
from tests.hostile.attacks.attack import Attack, bring, command_of
from tests.hostile.attacks.words import any_words
from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import RUNS
from tests.hostile.values import NUMBERS, one_of

FEW = [number[:60] for number in NUMBERS]
INCLUDED = ("arm.xml", "../outside/precious.txt", "/dev/zero", "none.xml", "pipe")
END = "</worldbody>"
OLD_AND_NEW: tuple[tuple[str, tuple[str, ...]], ...] = (
    ('mass="1"', tuple(f'mass="{number}"' for number in FEW)),
    ('size="0.05"', tuple(f'size="{number}"' for number in FEW)),
    ('timestep="0.001"', tuple(f'timestep="{number}"' for number in FEW)),
    ('type="hinge"', tuple(f'type="{kind}"' for kind in ("free", "ball", "slide", "nothing", ""))),
    ('axis="0 1 0"', tuple(f'axis="{axis}"' for axis in ("0 0 0", "nan 0 1", "1", "1e308 1e308 0", "x y z"))),
    ('name="shoulder"', tuple(f'name="{name}"' for name in ("elbow", "", "&#27;[31m", "x" * 9999, "../x"))),
    ('<joint name="elbow" type="hinge" axis="0 1 0"/>', ("",)),
    ("<option", tuple(f'<include file="{name}"/><option' for name in INCLUDED)),
    ("<mujoco", ('<!DOCTYPE m [<!ENTITY e SYSTEM "file:///etc/passwd">]><mujoco', "<urdf")),
    ("</mujoco>", ("",)),
    ("<worldbody>", ("<worldbody><body/>", "<worldbody>" + "<body>" * 3000)),
    (END, (
        f'{END}<asset><mesh name="m" file="../outside/precious.txt"/></asset>',
        f'{END}<asset><hfield name="h" nrow="99999" ncol="99999" size="1 1 1 1"/></asset>',
        f'{END}<extension><plugin plugin="evil"/></extension>',
        f'{END}<actuator><motor joint="nothing"/></actuator>',
        f'{END}<size memory="999G"/>',
        f'{END}<keyframe><key qpos="1"/></keyframe>',
        f'{END}<equality><joint joint1="shoulder"/></equality>',
    )),
    ('<motor joint="shoulder"/>', ("",)),
    ('<motor joint="elbow"/>', ("", '<motor joint="shoulder"/>')),
)  # fmt: skip
PLUGIN = """
from dataclasses import dataclass
from types import SimpleNamespace as Made
import os, sys
import numpy as np
{top}

@dataclass(frozen=True)
class Settings:
    {field}

class Mine:
    Config = Settings
    controller = "flight"
    estimator = "full_state"
    title = "t"
    quick = Settings()

    @staticmethod
    def build(config, mission):
        {build}

    @staticmethod
    def sensors(config, mission):
        {sensors}

    @staticmethod
    def quality(config, mission):
        return None

    @staticmethod
    def run(config, setup):
        {build}
"""
DEEDS = """raise SystemExit(0)
sys.exit()
sys.exit('bye')
raise KeyboardInterrupt
raise RuntimeError('no\\nway')
raise Exception
raise ValueError('\\x1b[31m')
raise MemoryError
raise RecursionError
raise BaseException('x')
raise StopIteration
raise UnicodeDecodeError('utf-8', b'x', 0, 1, 'r')
raise OSError(28, 'full', 'x')
raise GeneratorExit
raise BrokenPipeError
raise type('Odd', (Exception,), {'__str__': lambda s: 1 / 0})()
1 / 0
assert False
import nothing_there
(lambda f: f(f))(lambda f: f(f))
return None
return 1, 2
return ()
return Made(period=float('nan'), plan=print), Made(period=1.0, command=print, bound=None)
return Made(period=-1.0, update=print)
return Made(period=0.1, update=lambda *a: None)""".splitlines()
FIELDS = """gain: float = float('nan')
gain: list = None
gain: 'nothing' = 1
gain: float
gain: object = object()
x: int = 'a'
_a: float = 1
seed: int = 3
out: str = ''
pass
a: dict = None""".splitlines()
LINES = f"""
run {RUNS["flight"].replace("--planner.grid-nodes 17", "")} --controller PLUGIN --out new
run {RUNS["flight"].replace("--planner.grid-nodes 17", "")} --controller PLUGIN --help
run {RUNS["flight"]} --estimator PLUGIN --out new
run {RUNS["fleet"]} --consensus PLUGIN --out new
run PLUGIN --out new
estimate PLUGIN textbook --out new
sweep {RUNS["textbook"]} --estimator PLUGIN --trials 2 --store new.db
study PLUGIN --out new
search PLUGIN --store new.db --minimise x --over gain=0..1
completion words run PLUGIN --
"""
TRAPPED = f"""
render textbook --still
terrain show hills.npz --out new.png
compare trials.db trials.db --out new.html
run {RUNS["textbook"]} --out new --report
list --full
"""
TERRAIN = """
import os, sys
import numpy as np
from mathnavi.models.terrain.height_field import HeightField

def made(number=0):
    {deed}
"""
MAPS = """return HeightField(np.full((9, 9), np.nan), 1.0, 'x')
return HeightField(np.zeros((9, 9)), 1.0, '../../precious')
return HeightField(np.zeros((1, 1)), 1.0, 'x')""".splitlines()
TERRAIN_LINES = """
terrain show evil
terrain show evil:3
run safe-flight --terrain evil --out new
study noise --terrain evil --out new
list --full
"""
WRITES = (DEFAULT_OUT, "new", "new.db", "new.html", "new.png")


def mechanisms(rng: Generator, shop: Path, work: Path) -> Case:
    """A mechanism whose MJCF is not one."""
    bring(shop, work, "arm.xml")
    path = work / "arm.xml"
    if rng.random() < 0.25:
        done = (files.bytes_of if rng.random() < 0.6 else files.place_of_file)(rng, path)
    else:
        old, others = one_of(rng, OLD_AND_NEW)
        new = one_of(rng, others)
        path.write_text(path.read_text().replace(old, new, 1))
        done = f"{old} -> {new[:60]}"
    line = one_of(
        rng,
        (
            f"run {RUNS['arm']} --out new",
            f"run {RUNS['arm']} --out new",
            f"sweep {RUNS['arm']} --trials 2 --store new.db",
        ),
    )
    return Case(line.split()[0], "MJCF", tuple(line.split()), ("mechanism", "arm.xml"), WRITES, done)


def plugins(rng: Generator, shop: Path, work: Path) -> Case:
    """A plug-in of the working folder that misbehaves when it is imported or built."""
    bring(shop, work, "hills.npz", "arm.xml", "textbook")
    where, deed = one_of(rng, ("top", "build", "sensors", "field")), one_of(rng, DEEDS)
    parts = {"top": "", "field": "gain: float = 1.0", "build": "return None", "sensors": "return ()"}
    parts[where] = one_of(rng, FIELDS) if where == "field" else "x =" if where == "top" and "return" in deed else deed
    name = f"mine_{int(rng.integers(10**9))}"
    (work / f"{name}.py").write_text(PLUGIN.format(**parts))
    plugin = one_of(rng, (*[f"{name}:Mine"] * 4, f"{name}:Nothing", f"{name}:", name, f"{name}:Settings"))
    words = one_of(rng, LINES.strip().splitlines()).replace("PLUGIN", plugin).split()
    done = f"{where}: {parts[where]}"
    return Case(words[0], "plug-in", tuple(words), (name, "new.db", "gain"), WRITES, done, runs_code=True)


def trapped(rng: Generator, shop: Path, work: Path) -> Case:
    """Modules of the working folder called as those of libraries, with a process that finds them if it looks there."""
    bring(shop, work, "hills.npz", "textbook", "trials.db")
    words = one_of(rng, TRAPPED.strip().splitlines()).split()
    writes = (*WRITES, *(["textbook"] if words[0] == "render" else []))
    return Case(command_of(words), "modules in the folder", tuple(words), (), writes, "numpy.py", apart=True)


def terrain_plugins(rng: Generator, shop: Path, work: Path) -> Case:
    """An installed plug-in of a terrain that misbehaves."""
    deeds = [deed for deed in DEEDS if "Made" not in deed and "Keyboard" not in deed]
    deed, site = one_of(rng, (*deeds, *MAPS)), work / "site"
    (site / "evil-1.0.dist-info").mkdir(parents=True)
    (site / "evil-1.0.dist-info/METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1.0\n")
    (site / "evil-1.0.dist-info/entry_points.txt").write_text("[mathnavi.terrains]\nevil = evil_terrain:made\n")
    (site / "evil_terrain.py").write_text(TERRAIN.format(deed=deed))
    words = one_of(rng, TERRAIN_LINES.strip().splitlines()).split()
    environment = (("PYTHONPATH", str(site)), ("PYTHONDONTWRITEBYTECODE", "1"))
    return Case(
        command_of(words), "terrain plug-in", tuple(words), ("evil",), WRITES, deed,
        runs_code=True, apart=True, environment=environment,
    )  # fmt: skip


def words_apart(rng: Generator, shop: Path, work: Path) -> Case:
    """Words that mean nothing, in a process whose locale knows no other letters than those of ASCII."""
    case = any_words(rng, shop, work)
    environment = (("LC_ALL", "C"), ("PYTHONUTF8", "0"), ("PYTHONCOERCECLOCALE", "0"))
    return Case(case.command, "words", case.words, (), case.writes, "ASCII", apart=True, environment=environment)


ATTACKS: dict[Attack, int] = {mechanisms: 16, plugins: 24, trapped: 1, terrain_plugins: 2, words_apart: 1}

"""Maps and elevation models, changed, damaged, or asked for in sizes that cannot be."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
from numpy.random import Generator

from tests.hostile import files
from tests.hostile.arrays import npz_file
from tests.hostile.attacks.attack import Attack, bring, command_of
from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import MISSION
from tests.hostile.values import LONG, NUMBERS, one_of

LINES = f"""
terrain show hills.npz --out new.png
terrain show hills.npz
terrain import hills.npz --out new.npz
run {MISSION} --out new
sweep {MISSION} --trials 2 --store new.db
study noise --terrain hills.npz --terrain canyon --out new
study noise --terrain hills.npz --out new
"""
NAMES = """
../../../../outside/precious ../outside/precious ../precious /tmp/hostile-precious . a/b <b> [bold] COM1 \udcff \u202e
\x1b[31mred
"""
FILES = """
N99E999.hgt S00W000.hgt N42E080.png n42e080.hgt N90E000.hgt ١.hgt dem.hgt dem.asc dem.PNG dem.TIF dem dem.npz dem.tiff
dem.csv x\x1b[31m.hgt
"""
CROPS = ("0", "1", "2000", "-1", "99999999999999999999", "nan", "500000", "80.02", "42.97")


def maps(rng: Generator, shop: Path, work: Path) -> Case:
    """A map with another array, other words about it, or damaged."""
    bring(shop, work, "hills.npz")
    mutation = one_of(rng, (*[npz_file] * 2, *[_meta] * 2, files.bytes_of, files.place_of_file))
    done, words = mutation(rng, work / "hills.npz"), one_of(rng, LINES.strip().splitlines()).split()
    writes = (DEFAULT_OUT, "new", "new.png", "new.npz", "new.db")
    culprits = ("hills", "outside", "--start", "--target")
    return Case(command_of(words), "map .npz", tuple(words), culprits, writes, done)


def _meta(rng: Generator, path: Path) -> str:
    """Change what a map says about itself."""
    with np.load(path) as archive:
        z, meta = archive["z"], str(archive["meta"])
    if rng.random() < 0.5:
        key, value = (
            one_of(rng, ("name", "source", "licence")),
            one_of(rng, (*NAMES.split(), LONG, "", "line\nbreak", "\0")),
        )
        made, done = json.dumps({**json.loads(meta), key: value}), f"{key} = {value[:40]!r}"
    else:
        made, done = files.json_text(rng, meta)
    np.savez(path, z=z, meta=np.array(made))
    return f"meta: {done}"


def elevations(rng: Generator, shop: Path, work: Path) -> Case:
    """An elevation model that is damaged, of another kind, or asked for in a size that cannot be."""
    name = one_of(rng, ("dem.png", "N42E080.hgt", "dem.tif", "hills.npz"))
    bring(shop, work, name)
    path, done = work / name, ""
    if rng.random() < 0.5:
        done = (files.bytes_of if rng.random() < 0.8 else files.place_of_file)(rng, path)
    if rng.random() < 0.35:
        name = one_of(rng, FILES.split())
        if os.path.lexists(path):
            path.rename(work / name)
    words = ["terrain", "import", name, "--out", "new.npz"]
    if rng.random() < 0.7:
        words += [
            one_of(rng, ("--spacing", "--resample")),
            one_of(rng, ("100", "0.01", "10", "1e-300", "1e300", *NUMBERS)),
        ]
    if name.lower().endswith(".png") or rng.random() < 0.2:
        words += ["--scale", one_of(rng, ("1", "0.1", *NUMBERS))]
    if rng.random() < 0.3:
        words += ["--crop", *(one_of(rng, CROPS) for _ in range(int(rng.integers(3, 6))))]
    if rng.random() < 0.2:
        words += ["--fill"]
    for flag, count in (("--nodata", 1), ("--heights", 2), ("--void-error", 1)):
        if rng.random() < 0.15:
            words += [flag, *(one_of(rng, ("0", "500", "-9999", *NUMBERS)) for _ in range(count))]
    culprits = (name, ascii(name)[1:-1], Path(name).stem, "outside", "--spacing", "--resample", "--scale", "--crop")
    culprits += ("--nodata", "--heights", "--void-error")
    kind = f"DEM {Path(name).suffix.lower() or 'without ending'}"
    return Case("terrain import", kind, tuple(words), culprits, ("new.npz",), f"{done} {' '.join(words[5:])}"[:90])


ATTACKS: dict[Attack, int] = {maps: 28, elevations: 28}

"""Mechanisms of this package, or of any MJCF file, above a floor and under a sky.

    rigid-body       a body on a ball joint, the same inertia about every axis: S^3
    cart-pendulum    a slide and a hinge: a flat metric
    two-link         two hinges in a vertical plane
    seven-joint      an arm of seven hinges

with a torque motor on each joint, on the ball joint one about each axis of the body, and arms with stiff position
servos, limits, damping, armature and friction:

    servo-six        six hinges
    servo-seven      seven hinges, with links of little inertia
    servo-gripper    seven hinges and two fingers, coupled, which one servo drives by a tendon

and two with a free base:

    swimmer          six links in a plane, in a viscous fluid, with a torque motor on each of five hinges
    quadruped        four legs of two hinges each, with position servos, an IMU on the trunk and switches in the feet

**Files that a mechanism is read from**: its MJCF, the files it includes, and every mesh, texture and height field.

MuJoCo names a file in an attribute ``file``, ``filename`` or ``fileup`` and the like, of an ``<include>``, an asset, a
``<model>`` that is attached or a ``<flexcomp>``, relative to the folder of the first file, of the including one or of
the assets (``meshdir``, ``texturedir``, ``assetdir``), with or without the folders in the name (``strippath``). Each
place where it may lie is tried, and each file that exists counts: with one too many results are computed again, with
one too few old results would pass for new ones.

**Robots of MuJoCo Menagerie**, by the package ``mujoco-menagerie`` (extra ``robots``), which fetches one on first use.

It keeps them in its cache; ``MENAGERIE_CACHE_DIR`` and ``MENAGERIE_ROOT`` are its environment variables.
"""

from __future__ import annotations

import importlib
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from itertools import count
from os.path import normpath, relpath
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import dm_control
import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.input_files import MOST, InputFile, digest_of
from mathnavi.interfaces.reading.files import read_bytes
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.models.mechanism.geometry import checked
from mathnavi.models.vehicle_names import check_vehicle_name

_NAMED = re.compile(r"""\bfile\w*\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*(?:"([^"]*)"|'([^']*)')""")


def files_of(mjcf: Path) -> dict[str, bytes]:
    """Contents of an MJCF file, at "", and of every file that it names, by their paths from its folder.

    Raises OSError for a file that cannot be read.
    """
    mjcf = Path(normpath(mjcf))
    contents = {mjcf: read_bytes(mjcf, FieldError, MOST)}
    texts = {mjcf: contents[mjcf].decode(errors="replace")}
    while found := [path for path in _named(mjcf, texts) if path not in contents]:
        for path in dict.fromkeys(found):
            contents[path] = read_bytes(path, FieldError, MOST)
            if contents[path].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                texts[path] = contents[path].decode(errors="replace")
    return {"" if path == mjcf else Path(relpath(path, mjcf.parent)).as_posix(): contents[path] for path in contents}


def files_digest(mjcf: Path) -> str:
    """SHA-256 of ``files_of``: of the contents of the files, and of their relative paths."""
    return digest_of(files_of(mjcf))


def _named(mjcf: Path, texts: dict[Path, str]) -> Iterator[Path]:
    """Every file that some MJCF texts may name, in each place where MuJoCo may find it."""
    folders = list(dict.fromkeys(path.parent for path in texts))
    assets = [name for text in texts.values() for name in _values(_FOLDER, text)]
    places = list(dict.fromkeys([*folders, *(folder / name for folder in folders for name in assets)]))
    for text in texts.values():
        for name in _values(_NAMED, text):
            for place in places:
                for path in (place / name, place / Path(name.replace("\\", "/")).name):
                    if path.is_file():
                        yield Path(normpath(path))


def _values(pattern: re.Pattern[str], text: str) -> list[str]:
    return [unescape(one or other) for one, other in pattern.findall(text) if one or other]


PREFIX = "menagerie:"


def menagerie_file(mechanism: str) -> Path:
    """MJCF file of ``menagerie:NAME``, or of ``menagerie:NAME/ENTRY``, another file of its folder.

    ``menagerie:NAME`` is the robot alone, or its scene where the robot has a free base and nothing to stand on.

    Raises FieldError without the package, for a name or an entry that it does not know, and where the robot can be
    neither found nor fetched.
    """
    name, _, entry = mechanism.removeprefix(PREFIX).partition("/")
    try:
        package = importlib.import_module("mujoco_menagerie")
    except ImportError:
        raise FieldError(
            f"mechanism = {mechanism!r}; allowed with the package mujoco-menagerie: pip install 'mathnavi[robots]'"
        ) from None
    try:
        robot = package.get(name)
        alone = Path(robot.xml(entry or robot.default_model))
        scene = None if entry else robot.default_scene
        return Path(robot.xml(scene)) if scene is not None and _falls(alone) else alone
    except (package.MenagerieError, OSError) as error:
        reason = " ".join(str(error).split())
        raise FieldError(
            f"mechanism = {mechanism!r}; allowed: {PREFIX}NAME of a robot of MuJoCo Menagerie that is in the cache or "
            f"can be fetched ({reason})"
        ) from None


def _falls(mjcf: Path) -> bool:
    """True if a file has a body with a free joint, and no plane or height field under it."""
    spec = read_spec(mjcf, FieldError)
    floors = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    free = any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints)
    return free and not any(geom.type in floors for geom in spec.worldbody.geoms)


MechanismName = Literal["rigid-body", "cart-pendulum", "two-link", "seven-joint"]
"""names of mechanisms with a torque motor on each joint, or about each of its axes"""

ServoArmName = Literal["servo-six", "servo-seven", "servo-gripper"]
"""names of arms with stiff position servos, joint limits, damping, armature and friction, like industrial robots"""

FloatingName = Literal["swimmer", "quadruped"]
"""names of mechanisms with a free base: a planar chain of six links in a viscous fluid with a torque motor on each of
its hinges, and a robot on four legs with position servos, an IMU and foot switches"""


_HERE = Path(__file__).parent
_SUITE = "dm_control:"
_SIZES = (
    *("memory", "njmax", "nconmax", "nkey", "nuserdata", "nuser_body", "nuser_jnt", "nuser_geom", "nuser_site"),
    *("nuser_cam", "nuser_tendon", "nuser_actuator", "nuser_sensor"),
)
"""sizes that a file states, which an arena does not take from what is attached to it"""
_REFERENCES = {
    **{"bodyname1": None, "bodyname2": None, "name1": "objtype", "name2": "objtype"},
    **{"objname": "objtype", "refname": "reftype"},
}
"""fields of an element that name another one, and the field with its kind; None for a body"""
_REFERRING = ("actuators", "sensors", "equalities", "excludes", "pairs", "tendons", "flexes", "skins", "keys")
_CARRIERS = ("vertbody", "nodebody")  # fields of a flex with the names of the bodies that carry it
_VECTORS = ("MjIntVec", "MjFloatVec", "MjDoubleVec", "MjStringVec")
_BODIES = (mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_XBODY)
_OWN_TO_A_SPEC = ("id", "signature", "compiler", "classname", "info", "plugin")  # fields of an element
_MADE_IN_PYTHON = ("lqr",)  # of the suite: the file alone has no joints
_BELOW = 0.1  # of its extent: a mechanism that reaches lower than this below zero has the floor this far beneath it


def file_of(mechanism: MechanismName | str | Path) -> Path:
    """MJCF file of a mechanism: by name, of dm_control's suite, of MuJoCo Menagerie, or at a path.

    Raises FieldError if no such file exists.
    """
    if str(mechanism).startswith(PREFIX):
        return menagerie_file(str(mechanism))
    names = (*get_args(MechanismName), *get_args(ServoArmName), *get_args(FloatingName))
    own = {name: _HERE / f"{name.replace('-', '_')}.xml" for name in names}
    suite = {f"{_SUITE}{file.stem}": file for file in (Path(dm_control.__file__).parent / "suite").glob("*.xml")}
    listed = sorted(file.stem for file in suite.values() if file.stem not in _MADE_IN_PYTHON)
    path = (own | suite).get(str(mechanism), Path(mechanism))
    if not path.is_file():
        raise FieldError(
            f"mechanism = {str(mechanism)!r}; allowed: {', '.join(own)}, {_SUITE}NAME of its suite "
            f"({', '.join(listed)}), {PREFIX}NAME of MuJoCo Menagerie, or the "
            "path of an MJCF file"
        )
    return path


def mechanism_digest(mechanism: str) -> str:
    """Digest of the files that a mechanism is read from; FieldError as for ``file_of``."""
    return files_digest(file_of(mechanism))


def place_of(mechanism: str) -> str:
    """Name or path that means the same mechanism from any folder: a name stays, a path becomes absolute."""
    path = file_of(mechanism)
    return str(path.resolve()) if path == Path(mechanism) else mechanism


MechanismPlace = Annotated[str, InputFile(mechanism_digest)]
"""type of a field that names a mechanism, or an MJCF file: the files it includes are part of the key of its runs"""


def build_spec(mechanism: MechanismName | str | Path, *, name: str = "mechanism") -> Any:
    """Build the ``mujoco.MjSpec`` of a mechanism in its arena, not compiled yet.

    Everything in the file has its name after ``NAME/``, for instance the joint ``NAME/elbow``; bodies, joints and
    actuators without a name get one, for instance ``NAME/joint_0``. Its options are kept, and its floor if it has one.

    Raises ValueError for what ``file_of`` and ``geometry.checked`` refuse, for a file that MuJoCo cannot read, and for
    a name that is empty or contains "/".
    """
    check_vehicle_name(name)
    path = file_of(mechanism)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # deprecated elements of a file concern its author
            own = read_spec(path, FieldError)
            for kind in ("body", "joint", "actuator", "key"):
                _name(kind, getattr(own, {"body": "bodies"}.get(kind, f"{kind}s")))
            copied = own.copy()  # which leaves out what refers to nothing; MuJoCo's compiler refuses that
            if _size(copied) < _size(own):
                read_spec(path, FieldError).compile()
            alone = copied.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise FieldError(
            f"mechanism = {str(mechanism)!r}; allowed: an MJCF file that MuJoCo can read ({reason})"
        ) from None
    try:
        checked(alone)
    except ValueError as error:
        raise FieldError(f"mechanism = {str(mechanism)!r}: {error}") from None
    arena = read_spec(_HERE / "arena.xml", FieldError)
    # The options of an arena override those of what is attached to it: it takes the file's, and keeps its light.
    _copy(own.option, arena.option)
    _copy(arena.visual, own.visual)
    for size in _SIZES:
        setattr(arena, size, getattr(own, size))
    for statistic in ("meaninertia", "meanmass", "meansize"):
        setattr(arena.stat, statistic, getattr(own.stat, statistic))
    # Of a compiler, these three are those of the arena; the others stay with what is attached.
    arena.compiler.fitaabb = own.compiler.fitaabb
    arena.compiler.fusestatic = own.compiler.fusestatic
    _copy(own.compiler.LRopt, arena.compiler.LRopt)
    if own.compiler.settotalmass > 0.0:
        _keep_masses(own, alone)
    arena.stat.center, arena.stat.extent = alone.stat.center, alone.stat.extent
    sun = arena.light("sun")  # its shadows are sharp, and there, around where it hangs
    sun.pos = alone.stat.center - 1.5 * alone.stat.extent * np.array(sun.dir) / np.linalg.norm(sun.dir)
    if (alone.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)).any():
        arena.delete(arena.geom("floor"))
    else:
        arena.geom("floor").pos = (0.0, 0.0, _floor(alone))
    alike = own.copy()
    # Straight onto the world, for what is computed about the centre of mass of a tree has other digits in another tree.
    arena.attach(own, prefix=f"{name}/", frame=arena.worldbody.add_frame())
    for kind, add in (
        ("flexes", arena.add_flex),
        ("equalities", arena.add_equality),
        ("excludes", arena.add_exclude),
        ("sensors", arena.add_sensor),
    ):
        if len(getattr(arena, kind)) < len(getattr(alike, kind)):
            _add_again(arena, getattr(arena, kind), getattr(alike, kind), add, f"{name}/")
    for looking in (*arena.lights, *arena.cameras):
        if looking.targetbody == f"{name}/world":
            looking.targetbody = "world"
    return arena


def build_model(mechanism: MechanismName | str | Path, *, name: str = "mechanism") -> mujoco.MjModel:
    """Compile the ``mujoco.MjModel`` of ``build_spec``. Raises FieldError where only the file alone can be compiled."""
    spec = build_spec(mechanism, name=name)
    try:
        return spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise FieldError(f"mechanism = {str(mechanism)!r}; allowed: one that an arena can hold ({reason})") from None


def _size(spec: Any) -> int:
    """Number of the elements that refer to others."""
    return sum(len(getattr(spec, kind)) for kind in _REFERRING)


def _name(kind: str, elements: Sequence[Any]) -> None:
    """Name the elements without a name."""
    taken = {element.name for element in elements}
    for k, element in enumerate(elements):
        if not element.name:
            element.name = next(name for name in (f"{kind}_{k}{'_' * n}" for n in count()) if name not in taken)


def _add_again(
    arena: Any, attached: Sequence[Any], elements: Sequence[Any], add: Callable[..., Any], prefix: str
) -> None:
    """Add elements of a file in place of those ``attached``, among which those that refer to the world are missing."""
    for element in list(attached):
        arena.delete(element)
    for element in elements:
        fields: dict[str, Any] = {}
        for field in dir(element):
            value = getattr(element, field)
            if field.startswith("_") or callable(value) or field in _OWN_TO_A_SPEC:
                continue
            if field in _REFERENCES and value == "world":
                kind = _REFERENCES[field]
                value = value if kind is None or getattr(element, kind) in _BODIES else f"{prefix}{value}"
            elif (field in ("name", "material") or field in _REFERENCES) and value:
                value = f"{prefix}{value}"
            elif field in _CARRIERS:
                value = [body if body == "world" else f"{prefix}{body}" for body in value]
            fields[field] = list(value) if type(value).__name__ in _VECTORS else value
        add(**fields)


def _keep_masses(own: Any, alone: mujoco.MjModel) -> None:
    """Give the bodies of a file the masses that they have in the file alone, whose total it sets."""
    for body in own.bodies[1:]:
        compiled = alone.body(body.name)
        body.explicitinertial = True
        body.mass, body.inertia = float(compiled.mass[0]), compiled.inertia
        body.ipos, body.iquat, body.fullinertia = compiled.ipos, compiled.iquat, np.full(6, np.nan)
    own.compiler.settotalmass = -1.0
    own.compiler.inertiafromgeom = int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE)


def _copy(source: Any, target: Any) -> None:
    """Copy every value of a MuJoCo structure."""
    for name in dir(source):
        value = getattr(source, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, np.ndarray):
            getattr(target, name)[:] = value
        elif isinstance(value, (bool, int, float)):
            setattr(target, name, value)
        else:
            _copy(value, getattr(target, name))


def _floor(model: mujoco.MjModel) -> float:
    """Height [m] of the floor."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    down = data.geom_xmat.reshape(-1, 3, 3)[:, 2]  # (ngeom, 3) the world's vertical in the frame of each geom
    heights = data.geom_xpos[:, 2] + (down * model.geom_aabb[:, :3]).sum(axis=1)
    lowest = float((heights - (np.abs(down) * model.geom_aabb[:, 3:]).sum(axis=1)).min(initial=0.0))
    return 0.0 if lowest > -_BELOW * model.stat.extent else lowest - _BELOW * model.stat.extent

"""``mathnavi completion``: a script that completes commands, names of plug-ins, flags and their values on TAB.

The script asks ``mathnavi completion words WORD ...``, the words that stand there with the one that is being typed
last, and gets one candidate a line: so a plug-in that is installed later is completed too, with its fields. They are
read from the sources (``mathnavi.sim.plugin.sources``), which is a matter of a fifth of a second. Where nothing is
known to complete with, the shell completes names of files.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from typing import Any

from mathnavi.sim.commands.errors import BadInputError
from mathnavi.sim.commands.flag_names import flag_of, joined, negation
from mathnavi.sim.commands.known import COMMANDS
from mathnavi.sim.plugin.sources import (
    Definition,
    UnreadableError,
    config_fields,
    definition,
    fields,
    installed,
    is_dataclass,
    named,
    spelt_out,
)

WORDS = "words"  # what the scripts ask for
SCRIPTS = {
    "bash": """# eval "$(mathnavi completion bash)"
_mathnavi() {
    local IFS=$'\\n'
    COMPREPLY=($("$1" completion words "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null))
}
complete -o bashdefault -o default -F _mathnavi mathnavi
""",
    "zsh": """#compdef mathnavi
# eval "$(mathnavi completion zsh)", after compinit
_mathnavi() {
    local -a found
    found=("${(@f)$("${words[1]}" completion words "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    if [[ -n "${found[1]}" ]]; then compadd -a found; else _files; fi
}
if [[ "${funcstack[1]}" == "_mathnavi" ]]; then _mathnavi "$@"; else compdef _mathnavi mathnavi; fi
""",
    "fish": """# mathnavi completion fish | source
function __mathnavi_words
    set -l typed (commandline -opc)
    set -l found ($typed[1] completion words $typed[2..] (commandline -ct) 2>/dev/null)
    if test -n "$found[1]"; printf '%s\\n' $found; else; __fish_complete_path (commandline -ct); end
end
complete -c mathnavi -f -a '(__mathnavi_words)'
""",
}
USAGE = f"""usage: mathnavi completion {"|".join(SCRIPTS)}

Prints a script that completes mathnavi's commands, plug-ins and flags. To have it in every shell, add to
  ~/.bashrc                    eval "$(mathnavi completion bash)"
  ~/.zshrc (after compinit)    eval "$(mathnavi completion zsh)"
  ~/.config/fish/config.fish   mathnavi completion fish | source"""

FLOWN = ("run", "sweep")
PLUGIN_FLAGS = {"--controller": "controllers", "--estimator": "estimators", "--consensus": "consensus"}
NAMES = {**PLUGIN_FLAGS, "--terrain": "terrains"}  # kinds of plug-ins that a flag takes
OWN = {  # dataclasses of a command's own flags
    "run": ("mathnavi.sim.commands.run:Options", "mathnavi.sim.commands.run_request:CommonOptions"),
    "sweep": ("mathnavi.sim.commands.sweep:Options", "mathnavi.sim.commands.run_request:CommonOptions"),
    "study": ("mathnavi.sim.commands.study:Options",),
    "estimate": ("mathnavi.sim.commands.estimate:Options",),
    "render": ("mathnavi.sim.commands.render:Options",),
    "view": ("mathnavi.sim.commands.view:Options",),
    "compare": ("mathnavi.sim.commands.compare:Options",),
    "store show": ("mathnavi.sim.commands.store:Show",),
    "store export": ("mathnavi.sim.commands.store:Export",),
    "terrain import": ("mathnavi.sim.commands.terrain:Import",),
    "terrain show": ("mathnavi.sim.commands.terrain:Show",),
}
Flags = dict[str, tuple[str, ...]]  # what may follow each, as far as it is known


def main(argv: Sequence[str]) -> int:
    if argv and argv[0] == WORDS:
        print("\n".join(candidates(argv[1:])))
        return 0
    if {"-h", "--help"} & set(argv):
        print(USAGE)
        return 0
    if len(argv) != 1 or argv[0] not in SCRIPTS:
        raise BadInputError(f"SHELL = {' '.join(argv)!r}; allowed: {', '.join(SCRIPTS)}")
    print(SCRIPTS[argv[0]], end="")
    return 0


def candidates(words: Sequence[str]) -> list[str]:
    """What the last of the words, which may be empty, can become; none where it is a file or anything else."""
    *before, current = words or [""]
    if current == "=":  # bash gives --flag=value in three words
        current = ""
    try:
        found = _candidates([word for word in before if word != "="], current)
    except UnreadableError:  # a plug-in whose source does not tell
        return []
    return [word for word in found if word.startswith(current)]


def _candidates(before: Sequence[str], current: str) -> Sequence[str]:
    if not before:
        return [*COMMANDS, *(("--help", "--version") if current else ())]
    command, *given = before
    if command not in COMMANDS:
        return []
    if not given and not current.startswith("-"):
        return _first(command)
    flags = _flags(command, given)
    if current.startswith("-"):
        return [*flags, "--help"]
    return flags.get(given[-1], ())


def _first(command: str) -> Sequence[str]:
    """What may follow a command."""
    firsts = {**dict.fromkeys(FLOWN, "scenarios"), "study": "studies", "estimate": "estimators"}
    if command in firsts:
        return [*_names(firsts[command]), *(("all",) if command == "study" else ())]
    if command == "completion":
        return list(SCRIPTS)
    if command == "list":
        from mathnavi.sim.commands.listing import KINDS

        return KINDS
    return [own.partition(" ")[2] for own in OWN if own.startswith(f"{command} ")]


def _flags(command: str, given: Sequence[str]) -> Flags:
    """The flags of a command with the values that they take."""
    if command == "list":
        return {"--full": ()}
    name, found = given[0] if given else "", Flags()
    for place in OWN.get(command, ()) or OWN.get(f"{command} {name}", ()):
        found |= flags_of(_at(place))
    if command == "study" and name not in ("", "all") and not name.startswith("-"):
        found |= _config_flags(_plugin("studies", name))
    if command == "estimate" and name and not name.startswith("-"):
        found |= _config_flags(_plugin("estimators", name), "estimator")
    if command in FLOWN and name and not name.startswith("-"):
        scenario = _plugin("scenarios", name)
        found |= _config_flags(scenario)
        for flag, prefix in (("--controller", "planner"), ("--estimator", "estimator")):
            part = _given(flag, given) or _default(scenario, flag.removeprefix("--"))
            found |= _config_flags(_plugin(PLUGIN_FLAGS[flag], part), prefix) if part else {}
    return found


def flags_of(config: Definition, prefix: str = "") -> Flags:
    """The flags of a dataclass below a prefix, with what they may be set to; UnreadableError if it cannot be read."""
    return _flags_of_fields(fields(config), prefix)


def _config_flags(plugin: Definition, prefix: str = "") -> Flags:
    return _flags_of_fields(config_fields(plugin), prefix)


def _flags_of_fields(entries: Sequence[Any], prefix: str) -> Flags:
    found = Flags()
    for entry in entries:
        kind, module = spelt_out(entry.kind, entry.module)
        if "Positional" in ast.unparse(kind):
            continue
        if (
            isinstance(kind, ast.Subscript)
            and ast.unparse(kind.value) == "Annotated"
            and isinstance(kind.slice, ast.Tuple)
        ):
            kind, module = spelt_out(kind.slice.elts[0], module)
        name = joined(prefix, entry.name)
        part = _dataclass(kind, module)
        if part is not None:
            found |= flags_of(part, name)
            continue
        flag = flag_of(name)
        found[flag] = tuple(_names(NAMES[flag])) if flag in NAMES else tuple(_choices(kind, module))
        if ast.unparse(kind) == "bool":
            found[negation(flag)] = ()
    return found


def _dataclass(kind: ast.expr, module: str) -> Definition | None:
    """The dataclass that a type names, if it is one."""
    if not isinstance(kind, ast.Name | ast.Attribute):
        return None
    try:
        made = named(kind, module)
    except UnreadableError:  # int, for one, is bound nowhere
        return None
    return made if is_dataclass(made) else None


def _choices(kind: ast.expr, module: str) -> Iterator[str]:
    """What a type allows if it lists that: the words of a Literal."""
    if isinstance(kind, ast.BinOp):  # A | None
        for side in (kind.left, kind.right):
            yield from _choices(*spelt_out(side, module))
    if isinstance(kind, ast.Subscript) and ast.unparse(kind.value) == "Literal":
        listed = kind.slice.elts if isinstance(kind.slice, ast.Tuple) else [kind.slice]
        yield from (str(each.value) for each in listed if isinstance(each, ast.Constant))


def _given(flag: str, words: Sequence[str]) -> str | None:
    """What stands behind a flag, in either way to write it."""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word == flag:
            return following
        if word.startswith(f"{flag}="):
            return word.partition("=")[2]
    return None


def _default(scenario: Definition, part: str) -> str | None:
    """The name that a scenario's class has for a part of its own choice."""
    for entry in scenario.node.body:
        match entry:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant(value=str(value))) if name == part:
                return value
    return None


def _plugin(kind: str, name: str) -> Definition:
    place = next((point.value for point in installed(kind) if point.name == name), name)
    return _at(place)


def _at(place: str) -> Definition:
    module, _, name = place.partition(":")
    return definition(module, name)


def _names(kind: str) -> list[str]:
    return [point.name for point in installed(kind)]

"""``mathnavi completion``: a shell script that completes commands, names of plug-ins, flags and their values on TAB.

The script calls ``mathnavi completion words WORD ...`` with the words of the line, the one that is being typed last,
and reads one candidate a line: so a plug-in that is installed later is completed too, with its fields. They are read
from the index (``mathnavi.sim.plugin.index``), which takes a fifth of a second. If there is no candidate, the shell
completes names of files.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import EntryPoint

from mathnavi.commands.errors import BadInputError
from mathnavi.commands.known import COMMANDS, FLOWN, LOG_OPTIONS, OPTIONS
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.field_table import negation
from mathnavi.sim.plugin.groups import KINDS, installed
from mathnavi.sim.plugin.index import COMMAND, Description, Index
from mathnavi.sim.plugin.registry import point_of

WORDS = "words"  # the argument that the scripts pass
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

Print a script that completes mathnavi's commands, plug-ins and flags. To have it in every shell, add to
  ~/.bashrc                    eval "$(mathnavi completion bash)"
  ~/.zshrc (after compinit)    eval "$(mathnavi completion zsh)"
  ~/.config/fish/config.fish   mathnavi completion fish | source"""

PLUGIN_FLAGS = {"--controller": "controllers", "--estimator": "estimators", "--consensus": "consensus"}
NAMES = {**PLUGIN_FLAGS, "--terrain": "terrains"}  # kinds of plug-ins that a flag takes
COMMON = "mathnavi.commands.flown:CommonOptions"
Flags = dict[str, tuple[str, ...]]  # words that may follow each, as far as they are known


def main(argv: Sequence[str]) -> int:
    if argv and argv[0] == WORDS:
        print("\n".join(candidates(argv[1:])))
        return 0
    if {"-h", "--help"} & set(argv):
        print(wrapped(USAGE))
        return 0
    if len(argv) != 1 or argv[0] not in SCRIPTS:
        raise BadInputError(f"SHELL = {' '.join(argv)!r}; allowed: {', '.join(SCRIPTS)}")
    print(SCRIPTS[argv[0]], end="")
    return 0


def candidates(words: Sequence[str]) -> list[str]:
    """Return the completions of the last word, which may be empty; none if it is a file or free text."""
    *before, current = words or [""]
    if current == "=":  # bash gives --flag=value in three words
        current = ""
    try:
        found = _candidates([word for word in before if word != "="], current)
    except (LookupError, PluginError):
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
    """Return the words that may follow a command."""
    firsts = {**dict.fromkeys(FLOWN, "scenarios"), "study": "studies", "estimate": "estimators"}
    if command in firsts:
        return [*_names(firsts[command]), *(("all",) if command == "study" else ())]
    if command == "completion":
        return list(SCRIPTS)
    if command == "list":
        from mathnavi.commands import listing

        return listing.KINDS
    if command == "new":
        from mathnavi.commands import new

        return list(new.POINTS)
    return [own.partition(" ")[2] for own in OPTIONS if own.startswith(f"{command} ")]


def _flags(command: str, given: Sequence[str]) -> Flags:
    """Return the flags of a command with the values that they take."""
    if command == "list":
        return {"--full": (), "--verbose": ()}
    index = Index.read()
    name, flags = given[0] if given else "", Flags()
    own = OPTIONS.get(command) or OPTIONS.get(f"{command} {name}")
    more = (COMMON,) if command in FLOWN else LOG_OPTIONS if command == "estimate" else ()
    places = [place for place in (own, *more) if place]
    for options in index.describe(*((COMMAND, EntryPoint(place, place, "")) for place in places)):
        flags |= flags_of(options)
    if not name or name.startswith("-"):
        return flags
    if command == "study" and name != "all":
        flags |= flags_of(plugin("studies", name, index))
    if command == "estimate":
        flags |= flags_of(plugin("estimators", name, index))
    if command in FLOWN:
        scenario = plugin("scenarios", name, index)
        flags |= flags_of(scenario)
        for part, kind in KINDS.items():
            used = _given(f"--{part}", given) or scenario.stated.get(part)
            flags |= flags_of(plugin(kind, used, index)) if used else {}
    return flags


def flags_of(described: Description) -> Flags:
    """Return the flags of a described dataclass, with the values that are known to be allowed."""
    flags = Flags()
    for field in described.fields:
        if field.switch:
            flags |= {field.flag: (), negation(field.flag): ()}
        elif not field.positional:
            flags[field.flag] = tuple(_names(NAMES[field.flag])) if field.flag in NAMES else field.choices
    return flags


def plugin(kind: str, name: str, index: Index) -> Description:
    """Return the plug-in with a name, or at "package.module:Class".

    Raises PluginError if none exists, or several have the name; LookupError if it cannot be imported.
    """
    (described,) = index.describe((kind, point_of(kind, name)))
    if described.error:
        raise LookupError(f"{kind}: {name!r} cannot be imported: {described.error}")
    return described


def _given(flag: str, words: Sequence[str]) -> str | None:
    """Return the value of a flag, written --FLAG VALUE or --FLAG=VALUE; None without the flag."""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word == flag:
            return following
        if word.startswith(f"{flag}="):
            return word.partition("=")[2]
    return None


def _names(kind: str) -> list[str]:
    return list(dict.fromkeys(point.name for point in installed(kind)))

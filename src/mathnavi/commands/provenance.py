"""Notes on the origin of stored results: files that have changed since, other sources, another environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from rich.console import Console

from mathnavi.commands.errors import print_note
from mathnavi.commands.recorded_spec import RecordedSpec
from mathnavi.interfaces.field_table import flag_of
from mathnavi.sim.records.computing_environment import difference
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.records.store import Store

SHOWN = 12  # digits of a digest


def note_origins(errors: Console, store: Store, elsewhere: Elsewhere) -> None:
    """Print how many results come from another computing environment, if any do."""
    for sentence in elsewhere.words(store.environments()):
        print_note(errors, sentence)


def note_changed_files(errors: Console, store: Store, named: Mapping[tuple[str, str], str]) -> None:
    """Print which files have changed since a store took trials with them.

    ``named`` holds the present digest of each file, by the name of the field and its value.
    """
    for (name, value), digest in named.items():
        stored = store.input_digests(name, value)
        if stored and digest not in stored:
            before = " and ".join(f"{each[:SHOWN]}..." for each in sorted(stored))
            print_note(
                errors,
                f"{name} = {value} has changed since {sum(stored.values())} of the stored trials: its digest was "
                f"{before} and is {digest[:SHOWN]}...; those trials are kept unchanged",
            )


def note_environment(errors: Console, recorded: RecordedSpec) -> None:
    """Print a note if a recorded run was made in another computing environment, and one if it was by other code."""
    if other := difference(recorded.environment):
        named = f"in another environment: {other}" if recorded.environment else "without a note of its environment"
        print_note(
            errors,
            f"{recorded.path.parent} was recorded {named}; results may differ by rounding, or by the minimum that a "
            "solver ends in",
        )
    now = recorded.spec.code()
    if recorded.code is not None and recorded.code != now:
        print_note(
            errors,
            f"{recorded.path.parent} was recorded by other code, {recorded.code}; it is now {now}: results may differ",
        )


def changed_inputs(recorded: RecordedSpec, spec: RunSpec, given: Sequence[str]) -> Iterable[str]:
    """Return a sentence for each file whose content has changed since a run was recorded, though its field is the same.

    ``spec`` is the run to fly; files whose flags are ``given`` again may differ.
    """
    now = spec.inputs()
    for name, digest in recorded.inputs.items():
        same = name in now and spec.fields[name] == recorded.spec.fields.get(name)
        if same and now[name] != digest and flag_of(name) not in given:
            yield (
                f"{name} = {spec[name]} has changed since {recorded.path} was written: its digest was {digest} and "
                f"is {now[name]}; allowed: the file as it was"
            )

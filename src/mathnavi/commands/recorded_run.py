"""Frame of the commands that read the folder of a run and write files of it: `report`, `render` and `export`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from mathnavi.commands.errors import bad_input
from mathnavi.commands.flown import import_from_here
from mathnavi.commands.output import output_folder
from mathnavi.interfaces.errors import RunFolderError
from mathnavi.sim.plugin.trust import trusting


@contextmanager
def reading_run(folder: Path, trust: bool, files: Mapping[str, Path | None]) -> Iterator[None]:
    """Keep the run in ``folder`` in place while it is read, with the code that it names if the user trusts it, and make
    the folders of the ``files`` that are given, by their flags.

    What is wrong with the run or with a file is BadInputError; folders that were made for nothing are gone then.
    """
    import mujoco  # as the next one takes a while to import

    from mathnavi.sim.records.claimed_folder import kept_in_place

    if trust:  # a custom drawing
        import_from_here()
    with ExitStack() as stack:
        stack.enter_context(bad_input())
        stack.enter_context(trusting(trust))
        stack.enter_context(kept_in_place(folder))
        for flag, path in files.items():
            if path is not None:
                stack.enter_context(output_folder(path.parent, flag))
        try:
            yield
        except mujoco.FatalError as error:
            raise RunFolderError(f"{folder} cannot be drawn: MuJoCo refuses its model ({error})") from error
        except ValueError as error:
            if type(error).__module__.partition(".")[0] == "mathnavi":
                raise
            raise RunFolderError(f"{folder} cannot be drawn: {error}") from error  # what a library says of its numbers

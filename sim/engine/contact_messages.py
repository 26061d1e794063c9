"""Messages about contacts of a vehicle, and what to declare for those of normal operation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mathnavi.interfaces.signals import Event

KINDS = ("ground-contact", "contact")  # of events: with a plane or a height field, with any other geom
BEGINNING = 1.0  # [s] within which what a vehicle touches has been put beside it, and has not come there
_TOUCHES, _AT, _UNNAMED = "touches ", " at ", "geom "


def thing_named(name: str, index: int) -> str:
    """Return what a geom is called in a message: its name, or its index in the model."""
    return name or f"{_UNNAMED}{index}"


def touching(thing: str, where: Sequence[float], speed: float) -> str:
    """Return the message of a contact with a thing; ``where`` [m] is empty for a vehicle without a position."""
    return f"{_TOUCHES}{thing}{f'{_AT}{list(where)} with {speed:.1f} m/s' if where else ''}"


def thing_touched(event: Event) -> str:
    """Return what the event of a contact calls the thing."""
    return event.message.removeprefix(_TOUCHES).partition(_AT)[0]


def declaration(things: Iterable[str]) -> str:
    """Return what to write so that contacts with these things are no events."""
    things = list(things)
    unnamed = [thing for thing in things if thing.startswith(_UNNAMED)]
    names = ", ".join(f'"{"NAME" if thing in unnamed else thing}"' for thing in things)
    named = f', with name="NAME" for {" and ".join(unnamed)} of the model' if unnamed else ""
    return f"VehicleSetup(..., ignored_contacts=({names}{',' * (len(things) == 1)})){named}"


def declaration_at_start(events: Iterable[Event], t: float) -> str:
    """Return what to write if a run ended at ``t`` [s], in its beginning, with a contact.

    "" for a run that has got beyond its beginning, and for one without contacts.
    """
    first = next((event for event in events if event.kind in KINDS), None) if t < BEGINNING else None
    if first is None:
        return ""
    thing = thing_touched(first)
    return (
        f"{first.agent} touches {thing} from the start: if it stands or rolls there in normal operation, "
        f"write {declaration([thing])}"
    )

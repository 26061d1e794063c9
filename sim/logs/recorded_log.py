"""A log as it was recorded: channels of numbers, each with the stamps of its readings.

Nothing is sorted, merged or resampled here: ``RecordedLog.sensor_log`` does that on request, and notes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Literal, get_args

import numpy as np

from mathnavi.interfaces import units as symbols
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import FieldError, LogError
from mathnavi.interfaces.joint_states import QuaternionOrder
from mathnavi.interfaces.short_tables import counted, short_table
from mathnavi.interfaces.signal_names import name_and_unit
from mathnavi.interfaces.signals import Array
from mathnavi.sim.logs.timing import Timing, timing_of
from mathnavi.sim.records.sensor_log import SensorLog

Role = Literal["reading", "input", "reference"]
"""kind of a channel: readings of a sensor, commands, or what another system found, such as motion capture"""
Disorder = Literal["refuse", "sort"]
"""treatment of stamps that do not increase: the log is refused, or its readings are sorted by them"""
SEPARATOR = ":"  # between a channel and one of its signals


@dataclass(frozen=True, eq=False, repr=False)
class Channel:
    """Numbers that were recorded together, a row for each reading, in the order in which they stand in the file.

    Raises LogError for shapes that do not fit, and for stamps that are not finite.
    """

    t: Array  # (n,) [s] since the start of the log
    values: Array  # (n, m) NaN where there is none
    signals: tuple[str, ...]  # (m,) "name [unit]"; without brackets where the file says no unit
    role: Role = "reading"
    frame: str = ""  # of the numbers, as the file calls it
    facts: Mapping[str, str] = field(default_factory=dict)  # what the file says of the sensor, by name

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.t), len(self.signals)) or not len(self.t):
            raise LogError(f"a channel of {len(self.t)} stamps and {len(self.signals)} signals has {self.values.shape}")
        if (bad := np.flatnonzero(~np.isfinite(self.t))).size:
            raise LogError(f"stamp {bad[0]} is {self.t[bad[0]]}; allowed: finite stamps")

    @property
    def timing(self) -> Timing:
        """Rate, gaps and disorder of the stamps."""
        return timing_of(self.t)


@dataclass(frozen=True, eq=False, repr=False)
class RecordedLog:
    """Channels of a file by name, and what is known about them."""

    source: str  # the file
    format: str  # in words
    channels: Mapping[str, Channel]
    clock: str  # what the stamps are
    start: Decimal = Decimal(0)  # [s] that was subtracted from the stamps of the file; since 1970 for dates
    facts: Mapping[str, str] = field(default_factory=dict)  # what the file says of vehicle and recording, by name
    notes: tuple[str, ...] = ()  # what was not read, or was read in a way to be known, a sentence each

    def __getitem__(self, name: str) -> Channel:
        """Return a channel; LogError names those that exist."""
        if name not in self.channels:
            raise LogError(f"{self.source}: there is no channel {name!r}; {allowed_for(name, list(self.channels))}")
        return self.channels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return len(self.channels)

    def __repr__(self) -> str:
        """A short table: each channel with its number of readings and its rate."""
        rows = []
        for name, channel in self.channels.items():
            timing = channel.timing
            rate = "" if np.isnan(timing.rate) else f"at {timing.rate:.3g} Hz"
            rows.append((name, f"{timing.count} x {len(channel.signals)}", rate))
        first = min(channel.t.min() for channel in self.channels.values())
        last = max(channel.t.max() for channel in self.channels.values())
        table = short_table(f"{self.source}: {self.format}, from {first:.6g} to {last:.6g} s", rows)
        return "\n".join([table, *(f"  {note}" for note in self.notes)])

    def split(self, channel: str, by: str) -> RecordedLog:
        """Return the log with a channel for each value of one signal, "channel by=value", in place of the channel.

        Readings of several beacons or landmarks often come as one channel that says in each row whose they are.

        Raises LogError for a channel or a signal that does not exist, and for values that are not whole numbers.
        """
        own = self[channel]
        _, k = self._place(f"{channel}{SEPARATOR}{by}")
        keys = self._whole(channel, k)
        columns = [j for j in range(len(own.signals)) if j != k]
        signals = tuple(own.signals[j] for j in columns)
        parts = {}
        for key in np.unique(keys):
            of_key = keys == key
            rows = own.values[of_key][:, columns]
            parts[f"{channel} {by}={int(key)}"] = replace(own, t=own.t[of_key], values=rows, signals=signals)
        channels: dict[str, Channel] = {}
        for name, each in self.channels.items():
            channels |= parts if name == channel else {name: each}
        return replace(self, channels=channels)

    def spread(self, signal: str, by: str) -> RecordedLog:
        """Return the log with one more channel, called like the signal: a column for each value of the signal ``by``.

        Both are of one channel, whose rows say whose reading each is. Rows of one stamp that follow each other become
        one, with NaN in the columns of those that were not read then; the same one read twice stays two rows.

        Raises LogError for signals that do not exist or are of two channels, for values that are not whole numbers, and
        for a channel that exists already.
        """
        (channel, k), (other, of) = self._place(signal), self._place(by)
        own = self.channels[channel]
        name, unit = name_and_unit(own.signals[k])
        called = name_and_unit(own.signals[of])[0]
        if channel != other:
            raise LogError(f"{self.source}: {signal!r} is of {channel!r} and {by!r} of {other!r}; allowed: one channel")
        if name in self.channels:
            raise LogError(f"{self.source}: there is a channel {name!r} already; allowed: another signal, once")
        keys = self._whole(channel, of)
        columns = {key: j for j, key in enumerate(np.unique(keys).tolist())}
        stamps: list[float] = []
        rows: list[Array] = []
        for t, key, value in zip(own.t.tolist(), keys.tolist(), own.values[:, k].tolist(), strict=True):
            if not stamps or t != stamps[-1] or np.isfinite(rows[-1][columns[key]]):
                stamps.append(t)
                rows.append(np.full(len(columns), np.nan))
            rows[-1][columns[key]] = value
        signals = tuple(f"{called}={int(key)}" + (f" [{unit}]" if unit else "") for key in columns)
        spread = replace(own, t=np.array(stamps), values=np.array(rows), signals=signals)
        return replace(self, channels={**self.channels, name: spread})

    def rates(self, name: str) -> RecordedLog:
        """Return the log with the numbers of a channel, or of a signal, over the time since the row before.

        These are rates of what is counted there; a note says which. The first row, and one whose stamp is not later
        than that before, has NaN. Raises LogError for a channel or a signal that does not exist, and for signals with a
        unit that is not of a length or an angle.
        """
        places = self._places(name)
        channel, columns = places[0][0], [k for _, k in places]
        own = self[channel]
        steps = np.diff(own.t, prepend=np.nan)
        values, signals = own.values.copy(), list(own.signals)
        values[:, columns] /= np.where(steps > 0.0, steps, np.nan)[:, None]
        for k in columns:
            called, unit = own.signals[k].partition(" [")[0], name_and_unit(own.signals[k])[1]
            if unit not in ("", "m", "rad", "deg", "mm", "cm"):
                place = f"{channel}{SEPARATOR}{own.signals[k]}"
                raise LogError(f"{self.source}: the rate of {place}; allowed: of a length or an angle")
            signals[k] = f"{called} [{unit}/s]" if unit else own.signals[k]
        divided = ", ".join(own.signals[k] for k in columns)
        note = f"{channel}: {divided} over the time since the row before, as was asked"
        changed = replace(own, values=values, signals=tuple(signals))
        return replace(self, channels={**self.channels, channel: changed}, notes=(*self.notes, note))

    def delayed(self, channel: str, seconds: float) -> RecordedLog:
        """Return the log with the stamps of a channel later by a number of seconds, as of commands that act later.

        Raises LogError for a channel that does not exist, and for a delay that is not finite.
        """
        own = self[channel]
        note = f"{channel}: stamps later by {seconds:g} s, as was asked"
        return replace(
            self, channels={**self.channels, channel: replace(own, t=own.t + seconds)}, notes=(*self.notes, note)
        )

    def _whole(self, channel: str, k: int) -> Array:
        """Numbers (n,) of a signal that are whole; LogError for others."""
        keys: Array = self.channels[channel].values[:, k]
        if (bad := np.flatnonzero(keys != np.rint(keys))).size:
            where = f"{channel}{SEPARATOR}{self.channels[channel].signals[k]}"
            raise LogError(f"{self.source}: {where} is {keys[bad[0]]:g} in row {bad[0]}; allowed: whole numbers")
        return keys

    def sensor_log(
        self,
        *,
        readings: Mapping[str, str | Sequence[str]],
        inputs: str | Sequence[str] = (),
        units: Mapping[str, str] | None = None,
        disorder: Disorder = "refuse",
        quaternions: QuaternionOrder = "wxyz",
    ) -> SensorLog:
        """Return some signals as a log that estimators take, with a row for each time at which one of them was read.

        Args:
            readings: signals of each sensor by its name, "channel:signal", "signal" where no other channel has one of
                that name, or "channel" for all of its signals; those of one sensor have the same stamps.
            inputs: signals of the input, named in the same way. Each acts from its stamp until the next one.
            units: units of signals by their names, as "deg"; those that the file states, else SI units, if not given.
            disorder: "refuse" stamps that do not increase; "sort" readings by their stamps, the first of those with the
                same one.
            quaternions: order of the quaternions in the readings.

        Returns:
            The log. Its ``notes`` say what was sorted and left out: readings whose stamp another one has, and all that
            was read before the first input.

        Raises:
            LogError: for a signal that does not exist or that several channels have, signals of one sensor with
                different stamps, a unit that is not known, and stamps that do not increase.
            FieldError: for another ``disorder``.
        """
        if disorder not in get_args(Disorder):
            raise FieldError(f"disorder = {disorder!r}; allowed: {', '.join(get_args(Disorder))}")
        if not readings:
            raise LogError(f"{self.source}: readings is empty; allowed: signals by the name of their sensor")
        given = self._units(units or {})
        notes = list(self.notes)
        parts = {name: self._part(name, signals, given, disorder, notes) for name, signals in readings.items()}
        stamps = [t for t, _ in parts.values()]
        held = None
        if len(inputs):
            held = self._part("inputs", inputs, given, disorder, notes)
            if (bad := np.argwhere(~np.isfinite(held[1]))).size:
                raise LogError(f"{self.source}: an input at {held[0][bad[0][0]]:.9g} s is not finite; allowed: numbers")
            stamps.append(held[0])
        t = np.unique(np.concatenate(stamps))
        if held is not None and (early := int(np.searchsorted(t, held[0][0]))):
            notes.append(f"{counted(early, 'time')} before the first input, at {held[0][0]:.9g} s, left out")
            t = t[early:]
        found = {}
        for name, (own, values) in parts.items():
            rows = np.full((len(t), values.shape[1]), np.nan)
            kept = own >= t[0]
            rows[np.searchsorted(t, own[kept])] = values[kept]
            found[name] = rows
        acting = None if held is None else held[1][np.searchsorted(held[0], t, side="right") - 1]
        unlike = tuple(dict.fromkeys(notes))  # sensors that share a channel say the same
        columns = {
            name: tuple(self.channels[channel].signals[k] for channel, k in self.places(signals))
            for name, signals in readings.items()
        }
        return SensorLog(t, found, acting, self.source, self.start, unlike, quaternions, columns)

    def _part(
        self, sensor: str, wanted: str | Sequence[str], units: Mapping[tuple[str, int], float], disorder: Disorder,
        notes: list[str],
    ) -> tuple[Array, Array]:  # fmt: skip
        """Stamps (n,) and values (n, m) of the signals of a sensor, in SI units and in order."""
        places = self.places(wanted)
        if not places:
            raise LogError(f"{self.source}: {sensor} has no signal; allowed: one or more")
        if len(set(places)) < len(places):
            name, k = next(each for each in places if places.count(each) > 1)
            twice = f"{name}{SEPARATOR}{self.channels[name].signals[k]}"
            raise LogError(f"{self.source}: {sensor} takes {twice} twice; allowed: each signal once")
        (first, _), t = places[0], self.channels[places[0][0]].t
        columns = []
        for name, k in places:
            channel = self.channels[name]
            if not np.array_equal(channel.t, t):
                raise LogError(
                    f"{self.source}: {sensor} has signals of {first!r} and of {name!r}, which were not read at the "
                    "same times; allowed: a sensor for each"
                )
            columns.append(channel.values[:, k] * self._factor(name, k, units))
        values = np.column_stack(columns)
        timing = timing_of(t)
        if timing.orderly:
            return t, values
        if disorder == "refuse":
            raise LogError(f"{self.source}: {self._disorder(first, timing)}; disorder='sort' sorts them")
        order = np.argsort(t, kind="stable")
        t, values = t[order], values[order]
        kept = np.concatenate([[True], np.diff(t) > 0.0])
        if timing.late:
            notes.append(f"{first}: {counted(timing.late, 'stamp')} before an earlier one, sorted")
        if timing.doubled:
            notes.append(f"{first}: {counted(timing.doubled, 'reading')} left out, whose stamp an earlier one has")
        return t[kept], values[kept]

    def _disorder(self, name: str, timing: Timing) -> str:
        """Late and doubled stamps of a channel, in words."""
        t, found = self.channels[name].t, []
        if timing.first_late is not None:
            k = timing.first_late
            what = f"{counted(timing.late, 'stamp')} before an earlier one, the first is number {k}, {t[k]:.9g} s"
            found.append(f"{what} after {t[:k].max():.9g} s")
        if timing.doubled:
            found.append(counted(timing.doubled, "stamp") + " that an earlier reading has")
        return f"channel {name!r} has " + ", and ".join(found)

    def _places(self, name: str) -> list[tuple[str, int]]:
        """Channel and column of each signal that is meant by a name."""
        if name in self.channels:
            return [(name, k) for k in range(len(self.channels[name].signals))]
        channel, found, signal = name.rpartition(SEPARATOR)
        among = {channel: self.channels[channel]} if found and channel in self.channels else self.channels
        places = [
            (each, k)
            for each, own in among.items()
            for k, called in enumerate(own.signals)
            if (signal if among is not self.channels else name) in (called, called.partition(" [")[0])
        ]
        if not places:
            known = [each.partition(" [")[0] for own in among.values() for each in own.signals]
            where = f"channel {channel!r} has" if among is not self.channels else "it has"
            wanted = signal if among is not self.channels else name
            raise LogError(
                f"{self.source}: {where} no signal {wanted!r}; {allowed_for(wanted, [*known, *self.channels])}"
            )
        if len(places) > 1:
            several = ", ".join(f"{each}{SEPARATOR}{name}" for each, _ in places)
            raise LogError(f"{self.source}: several signals are called {name!r}; allowed: {several}")
        return places

    def _place(self, name: str) -> tuple[str, int]:
        """Channel and column of the one signal that is meant by a name."""
        places = self._places(name)
        if len(places) > 1:
            signals = ", ".join(f"{channel}{SEPARATOR}{self.channels[channel].signals[k]}" for channel, k in places)
            raise LogError(f"{self.source}: {name!r} is a channel of {len(places)} signals; allowed: one, {signals}")
        return places[0]

    def places(self, wanted: str | Sequence[str]) -> list[tuple[str, int]]:
        """Channel and column of each signal that is meant by names; LogError for one that does not exist."""
        return [place for each in ([wanted] if isinstance(wanted, str) else wanted) for place in self._places(each)]

    def units_of(self, given: Mapping[str, str]) -> dict[tuple[str, int], str]:
        """Unit of each signal for which one is given, by channel and column; LogError as ``sensor_log``."""
        return {place: unit for name, unit in given.items() for place in self._places(name)}

    def _units(self, given: Mapping[str, str]) -> dict[tuple[str, int], float]:
        """Factor to SI units of each signal whose unit is given."""
        found = {}
        for name, unit in given.items():
            factor = symbols.si_factor(unit)
            if factor is None:
                raise LogError(f"{self.source}: units = {{{name!r}: {unit!r}}}; allowed: units such as {symbols.KNOWN}")
            found.update(dict.fromkeys(self._places(name), factor))
        return found

    def _factor(self, name: str, k: int, units: Mapping[tuple[str, int], float]) -> float:
        """Factor to SI units of a signal."""
        if (name, k) in units:
            return units[name, k]
        unit = name_and_unit(self.channels[name].signals[k])[1]
        factor = symbols.si_factor(unit)
        if factor is None:
            where = f"{name}{SEPARATOR}{self.channels[name].signals[k]}"
            raise LogError(f"{self.source}: the unit of {where} is not known; allowed with units={{SIGNAL: UNIT}}")
        return factor

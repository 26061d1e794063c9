"""Check of a scenario, a controller, an estimator or a consensus: what a run refuses, and its first half second.

A scenario is built with its default fields and seed 0, and flown for half a second. What its plug-ins answer in that
time, what its vehicles touch and whether its referee ends it are looked at; nothing is written. A plug-in of another
kind is built into every scenario whose mission it fits, and flown for half a second in the first that takes it: what a
run refuses is refused here by the same code, in the same words.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, get_args, get_type_hints

from mathnavi.commands.check_findings import CheckResult, split_joined
from mathnavi.commands.check_over_log import check_over_log
from mathnavi.commands.errors import BadInputError, bad_plugin
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.field_table import leaves_of
from mathnavi.interfaces.signals import Event
from mathnavi.sim.engine.contact_messages import KINDS, declaration, thing_touched
from mathnavi.sim.engine.log import Recording, names_of
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.plugin.groups import PREFIXES
from mathnavi.sim.plugin.named_object import PLACE, objects_in
from mathnavi.sim.plugin.registry import (
    NEEDED,
    OtherMissionError,
    PluginSpec,
    check_class,
    class_at,
    load,
    loadable,
    names,
    with_article,
)
from mathnavi.sim.records.event_kinds import is_alarm
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.declared_signals import check_declared, name_signals, with_inputs

SECONDS = 0.5  # for which a scenario is flown
WORDS = {"scenarios": "scenario", "controllers": "controller", "estimators": "estimator", "consensus": "consensus"}
_EXPECTED = (*KINDS, "vehicle-contact", "input-clipped")  # events that no plug-in causes by its answer
_BEGINNING = ("guarantee-held", "message", "estimator-status", "blind", "low-clearance")  # of runs as they begin


def check_plugin(place: str, mission: str = "") -> CheckResult:
    """Check the class at "module:Class" or "FILE.py:Class", or an installed plug-in of that name.

    An estimator is also run over a log of its ``mission``, "FILE.py:NAME" or "package.module:NAME"; of one that is in
    the estimator's own module if none is given.

    Raises BadInputError if it cannot be imported, and for the mission of what is no estimator.
    """
    place = _as_module(place)
    result = CheckResult(place)
    kind, plugin = _loaded(place, result)
    if plugin is None:
        return result
    leaves = [leaf.flag for leaf in leaves_of(plugin.Config, PREFIXES.get(kind, ""))]
    result.fact(WORDS[kind], [(plugin.__doc__ or "without a docstring").strip().partition("\n")[0]])
    result.fact("fields", [split_joined(leaves) or "none"])
    if mission and kind != "estimators":
        raise BadInputError(f"--mission with {with_article(WORDS[kind])}; allowed: with an estimator, over a log")
    if kind == "scenarios":
        _check_scenario(place, plugin, result)
    else:
        _check_part(kind, plugin, result, mission)
    return result


def _as_module(place: str) -> str:
    """Return "folder/file.py:Class" as the module is imported from the current folder."""
    path, colon, name = place.rpartition(":")
    if not path.endswith(".py"):
        return place
    if not os.path.isfile(path):
        raise BadInputError(f"{place}: there is no file {path}; allowed: module:Class, or the path of its file")
    relative = os.path.relpath(path)
    if relative.startswith(os.pardir):
        raise BadInputError(f"{place}: allowed: a file in the current folder, or below it; cd to where it is")
    return relative.removesuffix(".py").replace(os.sep, ".") + colon + name


def _loaded(place: str, result: CheckResult) -> tuple[str, Any]:
    """Return the kind of a plug-in and its class; None with a finding for a class that is no plug-in.

    Raises BadInputError if it cannot be imported.
    """
    named = [kind for kind in WORDS if place in names(kind)]
    with bad_plugin():
        plugin = load(named[0], place) if named else class_at("plug-ins", place)
    if not (isinstance(plugin, type) or hasattr(plugin, "Config")):
        what = with_article(type(plugin).__name__)
        raise BadInputError(
            f"{place} is {what}, no class of a plug-in; allowed: MODULE:Class, or `mathnavi check ESTIMATOR --mission "
            f"{place}` for a mission"
        )
    kind = named[0] if named else _kind_of(plugin)
    try:
        check_class(kind, plugin, place)
    except PluginError as error:
        what, _, allowed = str(error).partition(": ")[2].partition("; allowed: ")
        needed = f"Config, a frozen dataclass whose fields have defaults, {' and '.join(NEEDED[kind])}"
        result.missing(f"as {with_article(WORDS[kind])}: {what}", f"what is allowed: {allowed or needed}")
        return kind, None
    return kind, plugin


def _kind_of(plugin: Any) -> str:
    """Return the kind of plug-in that a class is meant to be, by what it has."""
    marks: dict[str, tuple[str, ...]] = {
        "scenarios": ("controller", "estimator"), "estimators": ("sensors", "quality"), "consensus": ("within_starts",)
    }  # fmt: skip
    return next((kind for kind, own in marks.items() if any(hasattr(plugin, each) for each in own)), "controllers")


def _check_part(kind: str, plugin: Any, result: CheckResult, given: str = "") -> None:
    """Check a controller, an estimator or a consensus in the scenarios that have a mission of its kind.

    An estimator is checked over a log too, if there is a mission: the ``given`` one, or one in its own module.
    """
    part, mission, scenarios = WORDS[kind], _mission_of(plugin), loadable("scenarios")
    over_log = given or (_own_mission(plugin, mission) if kind == "estimators" else "")
    if mission is None:
        result.note(
            "build() does not say which mission it is for: with another one it fails where it first misses something",
            "def build(config: Config, mission: FlightMission)",
        )
    else:
        result.fact("built for", [f"a {_names_of(mission)}"])
    taking: dict[str, ClosedLoop] = {}
    refusing: dict[str, ValueError] = {}
    for name, scenario in scenarios.items():
        if not _has_such(kind, scenario):
            continue
        try:
            taking[name] = _with_part(kind, name, result.subject).build()
        except OtherMissionError:
            continue
        except ValueError as error:
            refusing[name] = error
    if taking:
        result.fact("scenarios", [split_joined(list(taking))])
        first = next(iter(taking))
        recording = _flown(_with_part(kind, first, result.subject), taking[first], result)
        if recording is not None and result.fits:
            result.command = f"mathnavi run {first} --{part} {result.subject}"
    elif faults := [error for error in refusing.values() if isinstance(error, PluginError)]:
        result.refused(" ".join(str(faults[0]).split()))
        return
    elif mission is not None and not refusing:
        result.fact("scenarios", ["none that is installed has such a mission"])
    if over_log:
        check_over_log(PluginSpec.with_fields(plugin), over_log, result)
    elif kind == "estimators" and not taking and not refusing:
        result.note(
            "it was not run, for no mission is known for it", f"mathnavi check {result.subject} --mission {PLACE}"
        )
    for name, refusal in refusing.items():
        if mission is not None:
            result.note(f"{name} with its default fields does not take it: {' '.join(str(refusal).split())}", "")


def _has_such(kind: str, scenario: Any) -> bool:
    """True for a scenario with a plug-in of a kind: all have a controller and an estimator, some a consensus."""
    return kind != "consensus" or isinstance(getattr(scenario.Config(), "consensus", None), str)


def _with_part(kind: str, scenario: str, place: str) -> RunSpec:
    """Return the run of a scenario with its default fields and a plug-in in place of its own."""
    if kind == "consensus":
        return RunSpec.of(scenario, fields={"consensus": place})
    controller, estimator = (place if kind == each else None for each in ("controllers", "estimators"))
    return RunSpec.of(scenario, 0, controller, estimator)


def _mission_of(plugin: Any) -> Any:
    """Return the type of mission that a plug-in says it is for; None if it says none, or one that is not known here."""
    try:
        return get_type_hints(plugin.build).get("mission")
    except (NameError, TypeError):
        return None


def _own_mission(plugin: Any, mission: Any) -> str:
    """Return the place of a mission in the module of a plug-in, "" without one: one of its type, or called mission."""
    module = sys.modules[plugin.__module__]
    if str(module.__name__).partition(".")[0] == "mathnavi":
        return ""
    kinds = tuple(each for each in (get_args(mission) or (mission,)) if isinstance(each, type))
    for name, value in objects_in(module).items():
        try:
            fits = isinstance(value, kinds)
        except TypeError:  # a protocol that cannot be checked
            fits = False
        if fits or (name == "mission" and value is not plugin):
            return f"{module.__name__}:{name}"
    return ""


def _names_of(mission: Any) -> str:
    """Return the name of a type of mission, or the names of several that are joined by "|"."""
    return " or ".join(each.__name__ for each in get_args(mission)) or str(getattr(mission, "__name__", mission))


# ---- a scenario


def _check_scenario(place: str, scenario: Any, result: CheckResult) -> None:
    spec = RunSpec.of(place, 0)
    try:
        closed_loop: ClosedLoop = spec.build()
    except ValueError as error:
        result.refused(" ".join(str(error).split()))
        return
    result.fact("parts", [f"controller {scenario.controller}, estimator {scenario.estimator}"])
    for name in closed_loop.plant.names:
        _describe(name, closed_loop, result)
    recording = _flown(spec, closed_loop, result)
    if recording is None:
        return
    _check_estimates(recording, result)
    if closed_loop.task is None:
        inputs = f'{{"{closed_loop.plant.names[0]}": Inputs.within(("thrust [N]", ...), limits)}}'
        result.note("without a task it is no environment for learning", f"closed_loop(..., task=Task({inputs}, cost))")
    if result.fits:
        result.command = f"mathnavi run {place}"


def _flown(spec: RunSpec, closed_loop: ClosedLoop, result: CheckResult) -> Recording | None:
    """Fly the first half second and look at it; None, and a finding, where a run is refused."""
    try:
        with spec.failures("a run"):
            duration = min(SECONDS, closed_loop.duration)
            check_declared(closed_loop.plant, closed_loop.agents, closed_loop.estimands)
            recording = simulate(
                closed_loop.plant, closed_loop.agents, duration, closed_loop.finished, network=closed_loop.network
            )
            name_signals(recording, closed_loop.agents, closed_loop.task, closed_loop.estimands)
            closed_loop.summarise(recording, 1.0)
    except ValueError as error:
        result.refused(" ".join(str(error).split()))
        return None
    _check_beginning(recording, duration, result)
    return recording


def _describe(name: str, closed_loop: ClosedLoop, result: CheckResult) -> None:
    plant = closed_loop.plant
    states, sizes = plant.state_names(name), plant.sensor_sizes(name)
    rates = {sensor.name: sensor.rate for sensor in plant.sensors(name)}
    sensors = [
        f"{sensor} ({size}) {'at every control step' if rates[sensor] is None else f'at {rates[sensor]:g} Hz'}"
        for sensor, size in sizes.items()
    ]
    result.fact(f"{name}: state", [f"{len(states)}: {split_joined(states)}"])
    result.fact(f"{name}: sensors", [split_joined(sensors) or "none"])
    agent = closed_loop.agents.get(name)
    if agent is None:
        agents = f'{{"{name}": stack.agent(input_size=...)}}'
        result.note(f"{name} has no agent: it coasts", f"closed_loop(plant, {agents}, ...)")
        return
    inputs = with_inputs(names_of(plant, name), closed_loop.task, name, agent.input_size).inputs
    named = split_joined(inputs) if len(inputs) == agent.input_size else "without names"
    result.fact(f"{name}: input", [f"{agent.input_size}: {named}"])
    if len(inputs) != agent.input_size:
        names = ", ".join(f'"NAME {k + 1} [UNIT]"' for k in range(agent.input_size))
        result.note(f"the inputs of {name} have no names", f"VehicleSetup(..., signals=SignalNames(inputs=({names},)))")


def _check_beginning(recording: Recording, duration: float, result: CheckResult) -> None:
    """Find what ends a run in its first half second, and what its plug-ins answer that cannot be used."""
    events, t = list(recording.events), float(recording.t[-1])
    ended = t < duration - 1e-9
    for vehicle, things in _touched(events):
        what = f"{vehicle} touches {split_joined(things)} from the start"
        if ended:
            result.missing(f"{what}, and the run ends after {t:.3g} s", declaration(things))
        else:
            result.note(f"{what}, which is an event", declaration(things))
    if ended and not _touched(events):
        result.missing(f"the run ends after {t:.3g} s", "a start at which finished(t, truths) is False")
    counts = Counter((event.agent, event.kind) for event in events if not _is_expected(event))
    for (agent, kind), number in counts.items():
        first = next(event for event in events if (event.agent, event.kind) == (agent, kind))
        times = f"{number} times, first" if number > 1 else "once,"
        result.note(f"{agent}: {kind}, {times} at {first.t:.3g} s: {first.message}", "")


def _is_expected(event: Event) -> bool:
    """True for an event that says nothing of a plug-in; an estimate that is lost says something."""
    if event.kind in _BEGINNING:
        return event.kind != "estimator-status" or not is_alarm(event)
    return event.kind in _EXPECTED


def _touched(events: Sequence[Event]) -> list[tuple[str, list[str]]]:
    """Return what each vehicle touches, without other vehicles."""
    found: dict[str, list[str]] = {}
    for event in events:
        if event.kind in KINDS and thing_touched(event) not in found.setdefault(event.agent, []):
            found[event.agent].append(thing_touched(event))
    return list(found.items())


def _check_estimates(recording: Recording, result: CheckResult) -> None:
    for name, size in _estimate_sizes(recording):
        states = recording.truths[name].shape[1]
        declared = len(recording.signals[name].estimands)
        if size != states and not declared:
            result.note(
                f"an estimate of {name} has {size} numbers, and its state {states}: neither their names nor their true "
                "values are known",
                "@staticmethod\ndef estimands(config, truth): return {'east [m]': truth[:, 0], 'heading [rad]': ...}",
            )
        elif size not in (states, declared) and not recording.signals[name].estimates:
            result.note(
                f"an estimate of {name} has {size} numbers, and estimands has {declared}: which they are is not known",
                "numbers = ('east [m]', 'heading [rad]', ...)  # of the estimator",
            )


def _estimate_sizes(recording: Recording) -> Iterator[tuple[str, int]]:
    """Length of the estimates of each vehicle that has any."""
    for name, agent in recording.agents.items():
        if len(agent.estimates):
            yield name, len(agent.estimates[0].x)

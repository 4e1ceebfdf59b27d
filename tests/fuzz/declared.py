"""Command lines with a hostile value in one place, made from what the commands declare."""

import types
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import typer

from testbed import cli
from tests.fuzz.calls import Call

LINES: dict[str, dict[str, str]] = {  # a correct and short call of each command, by the names of its parameters
    "list": {"what": "radars"},
    "run": {
        "scenario": "cut-in", "tracker": "rm-feldmann", "radar": "front", "duration": "0.2", "log": "off", "out": "out",
    },
    "replay": {"folder": "drive", "tracker": "rm-koch", "out": "out", "log": "off"},
    "score": {"tracks": "tracks.csv", "against": "drive", "tracker": "rm-koch", "out": "out", "log": "off"},
    "record": {"scenario": "cut-in", "out": "out", "radar": "front", "duration": "0.2"},
    "review": {"path": "log.rrd", "screenshot": "log.png"},
    "diff": {"first": "log.rrd", "second": "log.rrd"},
    "bench": {},
    "learn-htg": {"data": "points.npz", "out": "table.json", "bins": "1"},
    "learn-spline": {"data": "points.npz", "out": "model.json", "ellipses": "6", "points": "4"},
    "compare": {
        "scenario": "cut-in", "tracker": "rm-feldmann", "seeds": "0", "radar": "front", "duration": "0.2", "out": "out",
    },
    "regret": {
        "scenario": "probe-brake", "planner": "idle", "tracker": "rm-koch", "seeds": "0", "radar": "front",
        "duration": "0.2", "out": "out",
    },
    "probe": {
        "name": "probe-brake", "planner": "idle", "tracker": "rm-koch", "seeds": "0", "radar": "front",
        "resolution": "100", "out": "out",
    },
    "regress": {
        "tracker": "rm-koch", "scenario": "cut-in", "jobs": "1", "baselines": "baselines.json", "out": "out",
    },
    "reproduce": {"paper": "hoher2022", "runs": "1", "out": "out"},
    "calibrate": {"data": "real", "radar": "front"},
    "check": {"what": "radar", "name": "front"},
    "info": {},
    "radar": {"what": "show", "name": "front"},
    "scenario": {"what": "show", "name": "cut-in"},
    "benchmark list": {},
    "benchmark run": {"name": "v0", "tracker": "rm-koch", "out": "out"},  # there is none: no run of one is short
    "benchmark record": {"name": "v0", "out": "out"},
    "benchmark score": {"name": "v0", "tracks": "tracks.csv", "against": "drive", "called": "mine", "out": "out"},
    "benchmark check": {"entry": "baselines.json", "out": "out"},
    "benchmark table": {"folder": "drive"},
    "benchmark freeze": {"name": "v0"},
}  # fmt: skip

NUMBERS = (
    "", " ", "x", "nan", "inf", "-inf", "-1", "0", "-0", "1e308", "1e-320", "1e400", "1.5", "1,5", "0x10", "1_0",
    "1000000", "1000000000", "1000000000000", "9" * 19, "9" * 25, "9" * 400, "9" * 5000, "-" + "9" * 25, "٣", "−1",
)  # fmt: skip
TEXTS = (
    "", " ", "x", "all", "ALL", "cut-in ", "../../etc/passwd", "[red]", "[/]", "\x1b[31m", "a\nb", "a" * 3000, "\udcff",
    "名", "%s", "{0}", "-", "--", "=", ":", "+", "nowhere:nothing", "rm-feldmann:sigma=x", "rm-feldmann+rm-koch",
    "0:1000000000000", "5:2", "1:", "0:2:3", "0,,1", "0,0", "-3", "9" * 25, "sampler:", "sampler:nowhere",
    "sampler:surround:ship", "tcp://127.0.0.1:1", "://",
)  # fmt: skip
PATHS = (
    "", " ", ".", "..", "-", "FILE", "FILE/x", "nowhere", "nowhere/x.json", "EMPTY", "folder", "folder.json",
    "folder.rrd", "folder.npz", "folder.png", "folder.parquet", "fifo.json", "circle", "dangling", "a" * 300,
    "a" * 300 + ".json", "a" * 5000, "\udcff.json", "a\nb.json", "[red].json", "名.json", "log.rrd", "points.npz",
    "baselines.json", "real", "real/objects.npz", "empty.npz", "empty.rrd",
)  # fmt: skip
VALUES: dict[type, tuple[str, ...]] = {
    int: NUMBERS,
    float: NUMBERS,
    str: TEXTS + PATHS,
    Path: PATHS,
    bool: ("", "1", "x"),
}


@cache
def commands() -> dict[str, Any]:
    """The commands of the program, by name; those of a group as `GROUP NAME`."""
    found: dict[str, Any] = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]
    groups = {name: command.commands for name, command in found.items() if hasattr(command, "commands")}
    inner = {f"{group} {name}": command for group, own in groups.items() for name, command in own.items()}
    return {name: command for name, command in found.items() if name not in groups} | inner


def parameters(command: str) -> Iterator[tuple[str, str, type]]:
    """Name, option (nothing for an argument) and type of each parameter of a command."""
    hints = get_type_hints(commands()[command].callback)
    for parameter in commands()[command].params:
        option = "" if parameter.param_type_name == "argument" else parameter.opts[0]
        yield parameter.name, option, plain(hints[parameter.name])


def plain(hint: Any) -> type:
    """The type of one value of a parameter: int of `int | None` and of `list[int]`."""
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (part for part in get_args(hint) if part is not types.NoneType)
    return get_args(hint)[0] if get_origin(hint) is list else hint


def line(command: str, **changed: str) -> tuple[str, ...]:
    """The correct call of a command, with other values of some parameters."""
    values = {**LINES[command], **changed}
    arguments, options = [], []
    for name, option, type_ in parameters(command):
        if name not in values:
            continue
        if not option:
            arguments.append(values[name])
        elif type_ is bool:
            options.append(f"{option}={values[name]}" if values[name] else option)
        else:
            options.append(f"{option}={values[name]}")
    return (*command.split(), *options, "--", *arguments)


def hostile(command: str) -> list[Call]:
    """Calls of a command, each with one hostile value."""
    calls = [Call(line(command, **{name: value})) for name, _, type_ in parameters(command) for value in VALUES[type_]]
    for name, option, _ in parameters(command):
        if option:
            calls.append(Call((*line(command), option)))  # without its value, or once more
        elif name in LINES[command]:
            rest = line(command)
            calls.append(Call(rest[: rest.index("--")]))  # without its arguments
    words = tuple(command.split())
    return [*calls, Call((*line(command), "--nonsense")), Call((*words, "--nonsense")), Call((*words, "x", "y", "z"))]

"""Faults as text: `[SENSORS:]KIND:VALUE:VALUE...`, several joined by `+`.

    front:outage:3:5          outage:START:END
    corners:yaw:0.5           yaw:DEGREES[:START:END]
    clock:0.05                clock:SECONDS[:START:END]
    drop:0.2                  drop:SHARE[:START:END]
    burst:6:500               burst:START:COUNT[:SECONDS]
    blind:surround:rain:0.5   blind:CAUSE:SHARE[:START:END]

SENSORS, of `faults.PLACES` or a number, may also follow the kind, if it is a word; without it all are meant.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from sensors.faults import PLACES, Blindness, ClockOffset, Dropout, Fault, Interference, Misalignment, Outage


class Kind(NamedTuple):
    """How a fault is written."""

    make: Callable[..., Fault]
    form: str
    needed: int  # of the values; with the others, all of them
    values: tuple[str, ...]  # names of its parameters


KINDS = {
    "outage": Kind(Outage, "START:END", 2, ("start", "end")),
    "yaw": Kind(Misalignment, "DEGREES[:START:END]", 1, ("yaw_deg", "start", "end")),
    "clock": Kind(ClockOffset, "SECONDS[:START:END]", 1, ("seconds", "start", "end")),
    "drop": Kind(Dropout, "SHARE[:START:END]", 1, ("share", "start", "end")),
    "burst": Kind(Interference, "START:COUNT[:SECONDS]", 2, ("start", "count", "seconds")),
    "blind": Kind(Blindness, "CAUSE:SHARE[:START:END]", 2, ("cause", "share", "start", "end")),
}


def parse_fault(text: str) -> Fault:
    """The fault of a text.

    >>> str(parse_fault("blind:front:rain:.5")), parse_fault("2:outage:3:5").sensors
    ('front:blind:rain:0.5', '2')

    Raises:
        ValueError: no fault reads like that, or it has a value that it cannot have.
    """
    words = text.split(":")
    place = [] if words[0] in KINDS else [words.pop(0)]
    name = words.pop(0) if words else ""
    if name not in KINDS:
        raise ValueError(
            f"fault {text!r} must read [SENSORS:]KIND:VALUES with the kind one of {', '.join(KINDS)}; "
            "write for example front:outage:3:5"
        )
    kind = KINDS[name]
    if not place and words and words[0] in PLACES:
        place = [words.pop(0)]
    if place and not (place[0] in PLACES or place[0].isdecimal()):
        raise ValueError(f"fault {text!r} has the sensors {place[0]!r}; they are {', '.join(PLACES)}, or a number")
    if len(words) not in (kind.needed, len(kind.values)):
        raise ValueError(f"fault {text!r} has {len(words)} values; write [SENSORS:]{name}:{kind.form}")
    values: dict[str, Any] = dict(zip(kind.values, words, strict=False))
    for key in values.keys() - {"cause"}:
        try:
            values[key] = float(values[key])
        except ValueError:
            raise ValueError(
                f"fault {text!r}: {key} must be a number, got {values[key]!r}; write {name}:{kind.form}"
            ) from None
    return kind.make(**values, **({"sensors": place[0]} if place else {}))


def faults_of(faults: Any) -> tuple[Fault, ...]:
    """The faults of a text, several joined by `+`, or of a sequence of texts and fault objects.

    Raises:
        TypeError: something else.
        ValueError: a text that is no fault, or a fault that is given twice.
    """
    if isinstance(faults, str):
        faults = faults.split("+") if faults else []
    if not isinstance(faults, Iterable):
        raise TypeError(f"faults must be a sequence of texts or faults, got {faults!r}; write faults=['drop:0.2']")
    found: list[Fault] = []
    for one in faults:
        if isinstance(one, str):
            found += map(parse_fault, one.split("+"))
        elif isinstance(one, type) or not all(hasattr(one, part) for part in ("apply", "sensors", "start", "end")):
            raise TypeError(f"faults must be texts, or objects with sensors, start, end and apply, got {one!r}")
        else:
            found.append(one)
    texts = [str(fault) for fault in found]
    if len(set(texts)) < len(texts):
        raise ValueError(f"faults must differ, got {', '.join(texts)}; drop the repetition")
    return tuple(found)


def split_faults(text: str) -> tuple[str, tuple[str, ...]]:
    """What stands before the first `+`, and the texts of the faults behind it, as `str` writes them.

    >>> split_faults("cut-in+drop:.2")
    ('cut-in', ('drop:0.2',))
    """
    head, plus, rest = text.partition("+")
    return head, tuple(str(fault) for fault in faults_of(rest.split("+"))) if plus else ()

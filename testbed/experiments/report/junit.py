"""Findings as JUnit XML, which continuous integration servers show."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from testbed.files import write_atomic

FORBIDDEN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # characters that XML 1.0 has not
COUNTED = {"tests": "testcase", "failures": "testcase/failure", "errors": "testcase/error",
           "skipped": "testcase/skipped"}  # fmt: skip


class Case(NamedTuple):
    """One test: it passed, unless one of `error`, `failure` and `skipped` says otherwise."""

    group: str
    name: str
    seconds: float | None = None
    error: str = ""  # the traceback of what could not be run
    kind: str = ""  # of a failure: "collision"
    failure: str = ""  # one line a finding; the first is its message
    skipped: str = ""  # why
    output: str = ""


class Suite(NamedTuple):
    """Tests that belong together."""

    name: str
    cases: Sequence[Case]


def write(command: str, suites: Sequence[Suite], path: Path) -> None:
    """Write the file; raises OSError, in one sentence, where it cannot be written."""
    root = Element("testsuites", name=f"testbed {command}")
    for name, cases in suites:
        suite = SubElement(root, "testsuite", name=name)
        for case in cases:
            _case(SubElement(suite, "testcase", classname=f"{command}.{case.group}", name=case.name), case)
        seconds = [case.seconds for case in cases if case.seconds is not None]
        _count(suite, [suite])
        if seconds:
            suite.set("time", f"{sum(seconds):.3f}")
    _count(root, list(root))
    indent(root)
    write_atomic(path, tostring(root, encoding="us-ascii", xml_declaration=True) + b"\n")


def _count(element: Element, suites: Sequence[Element]) -> None:
    for name, where in COUNTED.items():
        element.set(name, str(sum(len(suite.findall(where)) for suite in suites)))


def _case(element: Element, case: Case) -> None:
    if case.seconds is not None:
        element.set("time", f"{case.seconds:.3f}")
    if case.error:
        text = FORBIDDEN.sub("?", case.error)
        SubElement(element, "error", message=text.strip().rpartition("\n")[2]).text = text
    elif case.failure:
        SubElement(element, "failure", type=case.kind, message=case.failure.partition("\n")[0]).text = case.failure
    elif case.skipped:
        SubElement(element, "skipped", message=case.skipped)
    if case.output:
        SubElement(element, "system-out").text = case.output

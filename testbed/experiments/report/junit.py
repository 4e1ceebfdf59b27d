"""The findings as JUnit XML, which continuous integration servers show: a suite a tracker, a case a scenario."""

import re
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from testbed.evaluation.metric import METRICS
from testbed.experiments.baselines import Key
from testbed.experiments.tolerated import GONE, OVERALL, Moved
from testbed.files import write_atomic

FORBIDDEN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # characters that XML 1.0 has not


def write(findings: Any, path: Path) -> None:
    """Write the file; raises OSError, in one sentence, where it cannot be written."""
    root = Element("testsuites", name="testbed regress")
    for tracker in dict.fromkeys(tracker for tracker, _ in findings.cells):
        _suite(root, findings, tracker)
    for name in ("tests", "failures", "errors", "skipped"):
        root.set(name, str(sum(int(suite.get(name, 0)) for suite in root)))
    indent(root)
    write_atomic(path, tostring(root, encoding="us-ascii", xml_declaration=True) + b"\n")


def sentence(change: Moved) -> str:
    """One change in words."""
    name = METRICS[change.measure].title
    if change.verdict == GONE:
        return f"{name}: nothing measured any more, the baseline has {change.before:.4g}"
    numbers = f"{change.before:.4g} -> {change.after:.4g}"
    return f"{name}: {numbers}, {change.verdict} by {abs(change.change):.3g}, allowed {change.limit:.3g}"


def _suite(root: Element, findings: Any, tracker: str) -> None:
    suite = SubElement(root, "testsuite", name=tracker)
    cells = [key for key in findings.cells if key[0] == tracker]
    for key in [*cells, (tracker, OVERALL)]:
        _case(suite, findings, key)
    counted = {"tests": "testcase", "failures": "testcase/failure", "errors": "testcase/error"}
    for name, where in {**counted, "skipped": "testcase/skipped"}.items():
        suite.set(name, str(len(suite.findall(where))))
    suite.set("time", f"{sum(findings.seconds.get(key, 0.0) for key in cells):.3f}")


def _case(suite: Element, findings: Any, key: Key) -> None:
    tracker, scenario = key
    time = f"{findings.seconds.get(key, 0.0):.3f}"
    case = SubElement(suite, "testcase", classname=f"regress.{tracker}", name=scenario, time=time)
    worse = [c for c in findings.worse if (c.tracker, c.scenario) == key]
    if key in findings.failed:
        text = FORBIDDEN.sub("?", findings.failed[key])
        SubElement(case, "error", message=text.strip().rpartition("\n")[2]).text = text
    elif worse:
        failure = SubElement(case, "failure", type="regression", message=sentence(worse[0]))
        failure.text = "\n".join(map(sentence, worse))
    elif key in findings.new:
        SubElement(case, "skipped", message="no baseline; make one with `testbed regress --update`")
    elif better := [c for c in findings.better if (c.tracker, c.scenario) == key]:
        SubElement(case, "system-out").text = "\n".join(map(sentence, better))

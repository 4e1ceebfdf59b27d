"""The findings as JUnit XML: a suite a planner and tracker, a case a scenario, which fails where tracks collide."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import pandas as pd

from testbed.evaluation.metric import METRICS
from testbed.experiments.pairs import Cell, Drive, compared_with
from testbed.experiments.report.junit import FORBIDDEN
from testbed.experiments.run import Outcome
from testbed.files import write_atomic
from testbed.frame import TRUTH


def write(
    pairs: pd.DataFrame, cells: list[Cell], failed: list[Outcome], self_test: dict[Drive, bool], path: Path
) -> None:
    """Write the file; raises OSError, in one sentence, where it cannot be written.

    Args:
        pairs: of all references.
        cells: the changes by scenario, which go into the output of a case.
        failed: drives that failed, each an error.
        self_test: whether a drive with all groups of errors is that of its tracker; each is a case.
        path: of the file.
    """
    root = Element("testsuites", name="testbed regret")
    for (planner, condition), part in compared_with(pairs, TRUTH).groupby(["planner", "condition"], sort=False):
        suite = SubElement(root, "testsuite", name=f"{planner} {condition}")
        for scenario, rows in part.groupby("scenario", sort=False):
            case = SubElement(suite, "testcase", classname=f"regret.{planner}.{condition}", name=str(scenario))
            crashed = rows.loc[rows["collisions"] > 0, "seed"].tolist()
            if crashed:
                seeds = ", ".join(map(str, crashed))
                text = f"collides on {len(crashed)} of {len(rows)} seeds on which the truth does not: {seeds}"
                SubElement(case, "failure", type="collision", message=text)
            own = [c for c in cells if (c.scenario, c.planner, c.condition) == (scenario, planner, condition)]
            SubElement(case, "system-out").text = "\n".join(map(_sentence, own))
    extra = SubElement(root, "testsuite", name="drives")
    for drive, equal in self_test.items():
        case = SubElement(extra, "testcase", classname="regret.self-test", name=drive.name)
        if not equal:
            SubElement(case, "failure", type="self-test", message="differs from the drive of the tracker itself")
    for outcome in failed:
        case = SubElement(extra, "testcase", classname="regret.drive", name=outcome.name)
        text = FORBIDDEN.sub("?", outcome.note)
        SubElement(case, "error", message=text.strip().rpartition("\n")[2]).text = text
    for suite in root:
        for name, where in {"tests": "testcase", "failures": "testcase/failure", "errors": "testcase/error"}.items():
            suite.set(name, str(len(suite.findall(where))))
    indent(root)
    write_atomic(path, tostring(root, encoding="us-ascii", xml_declaration=True) + b"\n")


def _sentence(cell: Cell) -> str:
    v, measure = cell.change.mean, METRICS[cell.measure]
    return f"{measure.title}: {v.value:+.4g} [{v.low:+.4g}, {v.high:+.4g}], {cell.verdict}"

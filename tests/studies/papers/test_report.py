"""The one way through an experiment, and its report as tables and JSON."""

import io
import json

import pytest
from rich.console import Console

from studies.papers.answer import CONFIRMED, Answer, Claim
from studies.papers.report import MethodRow, PaperReport, Stopped, carry_out, cell
from testbed.files import LostFileWarning

VERDICT = Answer(Claim("better", "IV"), CONFIRMED, "1 < 2")


def blank(runs=2):
    return PaperReport("p", "a title", {"runs": runs}, {"gwd2": 1}, "legend")


def picture(folder):
    path = folder / "p.png"
    path.touch()
    return (path,)


def printed(table):
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def test_a_finished_experiment_has_rows_verdicts_figures_and_a_file(tmp_path):
    rows, out = [], tmp_path / "out"
    row = MethodRow("c", "m", {"gwd2": 5.0})
    report = carry_out(blank(), lambda: rows.append(row), lambda: rows, lambda: (VERDICT,), picture, out)
    assert report.row("c", "m") == {"gwd2": 5.0}
    assert report.answers == (VERDICT,)
    assert not report.interrupted
    written = json.loads((out / "p.json").read_text())
    assert (written["rows"][0]["case"], written["figures"], written["interrupted"]) == ("c", ["p.png"], False)
    assert written["verdicts"][0]["claim"] == "better"


def test_figures_that_cannot_be_written_are_told_and_the_rest_is_there(tmp_path):
    def draw(folder):
        raise OSError("cannot write p.png: the disk is full")

    with pytest.warns(LostFileWarning, match=r"cannot write p\.png"):
        report = carry_out(blank(), lambda: None, lambda: (), lambda: (VERDICT,), draw, tmp_path)
    assert report.lost == ("cannot write p.png: the disk is full",)
    assert (report.answers, report.figures, report.interrupted) == ((VERDICT,), (), False)
    assert json.loads((tmp_path / "p.json").read_text())["figures"] == []


@pytest.mark.parametrize("at", ["experiment", "claims", "figures"])
def test_a_stopped_experiment_has_its_finished_rows_and_no_verdicts(tmp_path, at):
    rows = []

    def experiment():
        rows.append(MethodRow("c", "m", {"gwd2": 5.0}))
        progress(0, 1, "experiment")
        rows.append(MethodRow("d", "m", {"gwd2": 6.0}))

    def progress(done, total, what):
        if what == at:
            raise Stopped

    report = carry_out(blank(), experiment, lambda: rows, lambda: (VERDICT,), picture, tmp_path, progress)
    assert report.interrupted
    assert report.answers == report.figures == ()
    assert report.cases == (("c",) if at == "experiment" else ("c", "d"))
    assert json.loads((tmp_path / "p.json").read_text())["interrupted"]
    texts = [printed(table) for table in report.tables()]
    assert "p: c" in texts[0]
    assert "legend" in texts[0]
    assert not any("claims" in text for text in texts)


def test_without_a_folder_nothing_is_drawn():
    def draw(folder):
        raise AssertionError(f"drawn into {folder}")

    assert carry_out(blank(), lambda: None, lambda: (), lambda: (VERDICT,), draw).answers == (VERDICT,)


def test_no_runs_are_refused_before_the_experiment():
    with pytest.raises(ValueError, match="runs must be at least 1, got 0"):
        carry_out(blank(runs=0), lambda: pytest.fail("was run"), lambda: (), lambda: (), picture)


def test_a_table_shows_nine_figures_complete_within_80_columns():
    columns = {f"measure {k}": 2 for k in range(9)}
    figures = dict.fromkeys(columns, -1.23)
    rows = (MethodRow("c", "a method with a long name", figures, figures),)
    text = printed(PaperReport("p", "t", {}, columns, "legend", rows).tables()[0])
    assert text.count("-1.23") == 18
    assert "…" not in text


def test_a_figure_that_was_not_measured_is_a_dash():
    row = MethodRow("c", "m", {"a": 1.0, "b": float("nan")}, {"a": 2.0})
    assert [cell(row, name, 1) for name in "abc"] == ["1.0\n(2.0)", "–", "–"]

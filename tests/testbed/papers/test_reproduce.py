"""`testbed reproduce` and its table of papers, in small."""

import json
import os
import signal
from dataclasses import replace

import pytest
from rich.console import Console

from testbed.papers import catalogue
from testbed.papers.verdict import CONFIRMED, REFUTED, Claim, Report, Row, Stopped, Verdict, cell


def made_up(name, outcomes, stop_after=None):
    """A paper of three cases and claims with these outcomes; `stop_after` sends Ctrl-C to ourselves after a case."""

    def run(runs, out, progress, seed):
        rows, finished = [], False
        try:
            for k in range(3):
                progress(k, 3, f"case {k}")
                rows.append(Row(f"case {k}", "m", {"gwd2": float(runs + seed)}))
                if k == stop_after:
                    os.kill(os.getpid(), signal.SIGINT)
            finished = True
        except Stopped:
            pass
        verdicts = tuple(Verdict(Claim("c", "s"), o, "") for o in outcomes) if finished else ()
        what = name, "a title", {"runs": runs}, {"gwd2": 1}, "legend"
        report = Report(*what, tuple(rows), verdicts, interrupted=not finished)
        report.write(out)
        return report

    return catalogue.Paper(name, "made up", run)


def reproduce(monkeypatch, tmp_path, *outcomes, stop_after=None):
    monkeypatch.setattr(catalogue, "PAPERS", {"p": made_up("p", outcomes, stop_after)})
    told = []
    done = catalogue.reproduce("p", 2, 3, tmp_path, lambda *what: told.append(what))
    return done, told, json.loads((tmp_path / "p.json").read_text())


@pytest.mark.parametrize(
    ("outcomes", "status"),
    [((CONFIRMED, "confirmed under noise"), 0), ((CONFIRMED, REFUTED), 1), ((), 0)],
)
def test_the_answer_is_no_when_a_claim_holds_under_no_condition(monkeypatch, tmp_path, outcomes, status):
    done, told, written = reproduce(monkeypatch, tmp_path, *outcomes)
    assert done.exit_status == status
    assert done.json == tmp_path / "p.json"
    assert told == [(k, 3, f"case {k}") for k in range(3)]
    assert written["rows"][0]["measured"]["gwd2"] == 5.0  # runs and seed arrive
    assert not written["interrupted"]


def test_ctrl_c_keeps_the_cases_that_are_finished(monkeypatch, tmp_path):
    before = signal.getsignal(signal.SIGINT)
    done, told, written = reproduce(monkeypatch, tmp_path, REFUTED, stop_after=1)
    assert done.exit_status == 130
    assert [row["case"] for row in written["rows"]] == ["case 0", "case 1"]
    assert written["interrupted"]
    assert written["verdicts"] == []
    assert len(told) == 2
    assert signal.getsignal(signal.SIGINT) is before


def test_tables_of_an_interrupted_reproduction_have_no_verdicts(monkeypatch, tmp_path):
    done, _, _ = reproduce(monkeypatch, tmp_path, stop_after=0)
    console = Console(width=80, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    for table in done.report.tables():
        console.print(table)
    text = console.export_text()
    assert "p: case 0" in text
    assert "legend" in text
    assert "claims" not in text


def test_a_table_shows_nine_figures_whole_within_80_columns():
    columns = {f"measure {k}": 2 for k in range(9)}
    figures = dict.fromkeys(columns, -1.23)
    rows = (Row("c", "a method with a long name", figures, figures),)
    report = Report("p", "t", {}, columns, "legend", rows, ())
    console = Console(width=80, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    console.print(report.tables()[0])
    text = console.export_text()
    assert text.count("-1.23") == 18
    assert "…" not in text


def test_a_figure_that_was_not_measured_is_a_dash():
    row = Row("c", "m", {"a": 1.0, "b": float("nan")}, {"a": 2.0})
    assert [cell(row, name, 1) for name in "abc"] == ["1.0\n(2.0)", "–", "–"]


@pytest.mark.parametrize(
    ("args", "parts"),
    [
        (["hoher"], ["paper 'hoher'", "did you mean 'hoher2022'"]),
        (["xia2020-learn"], ["did you mean 'xia2020-learned'"]),
        (["nothing"], ["paper 'nothing'", "hoher2022, xia2020, xia2020-learned"]),
        (["xia2020", "--runs", "0"], ["runs must be at least 1", "0"]),
        (["xia2020", "--seed", "-1"], ["seed", "-1"]),
        (["xia2020", "--out", "FILE"], ["out: cannot write to", "choose another directory"]),
        ([], ["paper", "testbed reproduce --help"]),
    ],
)
def test_a_wrong_command_line_is_one_sentence_before_the_work_begins(tmp_path, monkeypatch, command, args, parts):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "FILE").touch()
    status, out, err = command("reproduce", *args)
    assert (status, out) == (2, "")
    (line,) = err.strip().splitlines()
    assert line.startswith("testbed: ")
    for part in parts:
        assert part in line.lower()
    assert [p.name for p in tmp_path.iterdir()] == ["FILE"]


def test_help_has_an_example_and_names_every_paper(command):
    status, out, _ = command("reproduce", "--help")
    assert status == 0
    assert "Example: testbed reproduce" in out
    assert max(map(len, out.splitlines())) <= 80
    for name in catalogue.PAPERS:
        assert name in out


def test_the_command_prints_tables_verdicts_and_paths(tmp_path, monkeypatch, command):
    monkeypatch.setattr(catalogue, "PAPERS", {"p": made_up("p", (CONFIRMED, REFUTED))})
    status, out, err = command("reproduce", "p", "--runs", 2, "--out", tmp_path)
    assert status == 1
    for part in ("p: case 2", "p: claims", REFUTED, f"results  {tmp_path / 'p.json'}"):
        assert part in out
    assert len(err.strip().splitlines()) == 1  # the bar does not flood a file


def test_ctrl_c_in_a_real_reproduction_leaves_its_finished_rows(tmp_path, monkeypatch, command):
    """hoher2022's first case has no noise, hence one run: its rows come within seconds."""
    paper = catalogue.PAPERS["hoher2022"]

    def impatient(runs, out, progress, seed):
        def tell(done, total, what):
            if done == 2:
                os.kill(os.getpid(), signal.SIGINT)
            progress(done, total, what)

        return paper.run(runs, out, tell, seed)

    monkeypatch.setattr(catalogue, "PAPERS", {"hoher2022": replace(paper, run=impatient)})
    status, out, err = command("reproduce", "hoher2022", "--runs", 1, "--out", tmp_path)
    assert status == 130, err
    assert "interrupted" in out
    written = json.loads((tmp_path / "hoher2022.json").read_text())
    assert written["interrupted"]
    assert [row["case"] for row in written["rows"]] == ["rectangle, sigma 0.0"] * 2

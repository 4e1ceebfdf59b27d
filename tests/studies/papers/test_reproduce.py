"""`testbed reproduce` and its table of papers, in small."""

import json
import os
import signal
from dataclasses import replace

import pytest

from studies.papers import catalogue
from studies.papers.answer import CONFIRMED, REFUTED, Answer, Claim
from studies.papers.report import MethodRow, PaperReport, carry_out


def made_up(name, outcomes, stop_after=None):
    """A paper of three cases and claims with these outcomes; `stop_after` sends Ctrl-C to ourselves after a case."""

    def run(runs, out, progress, seed, engine):
        rows = []

        def experiment():
            for k in range(3):
                progress(k, 3, f"case {k}")
                rows.append(MethodRow(f"case {k}", "m", {"gwd2": float(runs + seed)}))
                if k == stop_after:
                    os.kill(os.getpid(), signal.SIGINT)

        blank = PaperReport(name, "a title", {"runs": runs}, {"gwd2": 1}, "legend")
        answers = tuple(Answer(Claim("c", "s"), outcome, "") for outcome in outcomes)
        return carry_out(blank, experiment, lambda: rows, lambda: answers, lambda folder: (), out, progress)

    return catalogue.Paper(name, "made up", run)


def reproduce(monkeypatch, tmp_path, *outcomes, stop_after=None):
    monkeypatch.setattr(catalogue, "PAPERS", {"p": made_up("p", outcomes, stop_after)})
    calls = []
    done = catalogue.reproduce("p", 2, 3, tmp_path, lambda *call: calls.append(call))
    return done, calls, json.loads((tmp_path / "p.json").read_text())


@pytest.mark.parametrize(
    ("outcomes", "status"),
    [((CONFIRMED, "confirmed under noise"), 0), ((CONFIRMED, REFUTED), 1), ((), 0)],
)
def test_the_answer_is_no_when_a_claim_holds_under_no_condition(monkeypatch, tmp_path, outcomes, status):
    done, calls, written = reproduce(monkeypatch, tmp_path, *outcomes)
    assert done.exit_status == status
    assert done.report.json == tmp_path / "p.json"
    assert calls == [*((k, 3, f"case {k}") for k in range(3)), (1, 1, "claims"), (1, 1, "figures")]
    assert written["rows"][0]["measured"]["gwd2"] == 5.0  # runs and seed arrive
    assert not written["interrupted"]


def test_ctrl_c_keeps_the_cases_that_are_finished(monkeypatch, tmp_path):
    before = signal.getsignal(signal.SIGINT)
    done, calls, written = reproduce(monkeypatch, tmp_path, REFUTED, stop_after=1)
    assert done.exit_status == 130
    assert [row["case"] for row in written["rows"]] == ["case 0", "case 1"]
    assert written["interrupted"]
    assert written["verdicts"] == []
    assert len(calls) == 2
    assert signal.getsignal(signal.SIGINT) is before


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
    status, out, err = command("reproduce", "p", "--runs", 2, "--out", tmp_path, "--jobs", 1)
    assert status == 1
    for part in ("p: case 2", "p: claims", REFUTED, f"results  {tmp_path / 'p.json'}"):
        assert part in out
    assert len(err.strip().splitlines()) == 1  # the bar does not flood a file


def test_tables_are_printed_where_the_results_cannot_be_written(tmp_path, monkeypatch, command):
    monkeypatch.setattr(catalogue, "PAPERS", {"p": made_up("p", (CONFIRMED, REFUTED))})
    (tmp_path / "p.json").mkdir()
    status, out, err = command("reproduce", "p", "--runs", 2, "--out", tmp_path, "--jobs", 1)
    assert status == 2
    assert "p: claims" in out
    assert "results" not in out
    assert (
        err.splitlines()[-1] == f"testbed: cannot write {tmp_path / 'p.json'}: it is a directory; choose another file"
    )


def test_ctrl_c_in_a_real_reproduction_leaves_its_finished_rows(tmp_path, monkeypatch, command):
    """hoher2022's first case has no noise, hence one run: its rows come within seconds."""
    paper = catalogue.PAPERS["hoher2022"]

    def impatient(runs, out, progress, seed, engine):
        def interrupting(done, total, what):
            if done == 2:
                os.kill(os.getpid(), signal.SIGINT)
            progress(done, total, what)

        return paper.run(runs, out, interrupting, seed, engine)

    monkeypatch.setattr(catalogue, "PAPERS", {"hoher2022": replace(paper, run=impatient)})
    status, out, err = command("reproduce", "hoher2022", "--runs", 1, "--out", tmp_path, "--jobs", 1)
    assert status == 130, err
    assert "interrupted" in out
    written = json.loads((tmp_path / "hoher2022.json").read_text())
    assert written["interrupted"]
    assert [row["case"] for row in written["rows"]] == ["rectangle, sigma 0.0"] * 2

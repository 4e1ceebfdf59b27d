"""The page of a comparison: what it says, where it leads, and what it does with little or odd input."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from testbed.evaluation.intervals import FEWEST
from testbed.experiments.command import execute
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.engine import Engine
from testbed.experiments.report import logs
from testbed.experiments.report import words as report_words
from testbed.experiments.report.comparison import links_of, page_of, write_report
from testbed.experiments.report.page import failures, render, write_page
from testbed.experiments.report.tables import ranking
from testbed.experiments.report.texts import seeds_text
from testbed.experiments.run import FAILED, Outcome
from testbed.experiments.statistics import MAIN, cells
from testbed.experiments.store import Results, Store
from testbed.experiments.study import Tally
from tests.testbed.experiments.made_results import make
from tests.testbed.experiments.report.conftest import TRACKERS
from tests.testbed.experiments.report.pages import ODD, Page, check_links


def written(results: Results, out: Path, report: Tally | None = None) -> Page:
    """The page alone, without figures and logs, which take the time."""
    path = out / "alone.html"
    path.write_text(render(page_of(results, report)))
    page = Page(path)
    check_links(page)
    return page


@pytest.fixture(scope="module")
def page(report):
    return Page(report)


def test_every_link_leads_to_a_file_or_a_part_of_the_page(page):
    check_links(page)
    assert sum(link.endswith(".png") for link in page.links) == 2 * 10  # shown, and opened alone


def test_the_page_needs_nothing_from_outside(page):
    assert not {"link", "iframe"} & set(page.tags)
    assert "<script src" not in page.path.read_text()
    assert "url(" not in page.path.read_text()
    assert "@import" not in page.path.read_text()


def test_every_tracker_stands_in_every_table(page):
    for part in ("overview", "scenarios", "phases", "range", "visibility", "consistency", "logs"):
        assert all(name in page.by_section[part] for name in TRACKERS), part


def test_the_page_says_what_was_compared(page):
    about = page.by_section["about"]
    for text in ("good, fair, bad", "cut-in, merge", "3: 0 to 2", "8 s", "surround", "18 of 18", "numpy"):
        assert text in about
    for part in ("tracking", "metrics", "loading"):
        assert part in about


def test_the_verdict_names_the_best_and_says_what_is_resolved(page):
    verdict = page.by_section["verdict"]
    assert "good is best in GOSPA" in verdict
    assert "lead over the next, fair" in verdict
    assert "against the reference fair" in verdict


BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FITS = """<script>
const nav = document.querySelector("nav");
document.title = JSON.stringify([nav.scrollWidth - nav.clientWidth, document.documentElement.scrollWidth - innerWidth]);
</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed; on Debian the package chromium")
@pytest.mark.parametrize("width", [1400, 900, 500])
def test_in_a_browser_no_link_of_the_navigation_is_cut_off(page, tmp_path, width):
    probe = tmp_path / "probe.html"
    probe.write_text(page.path.read_text().replace("</body>", FITS))
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    command += [f"--window-size={width},900", "--dump-dom", probe.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    cut, beyond = json.loads(re.search(r"<title>(.*?)</title>", dom, re.S)[1])
    assert cut <= 0
    assert beyond <= 0


def test_light_and_dark_and_narrow_screens_are_thought_of(page):
    text = page.path.read_text()
    assert "prefers-color-scheme: dark" in text
    assert "tabular-nums" in text
    assert "width=device-width" in text
    assert page.tags.count("table") <= text.count('class="scroll"')


def test_verdicts_stand_in_words_beside_the_colours(page):
    overview = page.by_section["overview"]
    assert "better" in overview
    assert "worse" in overview


def test_nothing_that_comes_from_outside_is_taken_for_markup(tmp_path):
    evil = "<script>alert(1)</script>"
    comparison = Comparison(("cut-in",), ("good", "a<b>&c"), (0, 1, 2), out=str(tmp_path))
    failed = [Outcome(f"cut-in_{evil}", FAILED, f"Traceback {evil}")]
    page = written(make(comparison), tmp_path, Tally(failed=failed))
    assert page.tags.count("script") == 1  # ours
    assert f"Traceback {evil}" in page.by_section["runs"]
    assert "a<b>&c" in page.by_section["overview"]


def test_a_tracker_that_holds_nothing_is_named_as_such(tmp_path):
    comparison = Comparison(("cut-in", "merge"), TRACKERS, (0, 1, 2), out=str(tmp_path))
    page = written(make(comparison, blind="bad"), tmp_path)
    assert "bad never tracked an object" in page.text
    assert "nan" not in page.text.split()


def test_one_seed_has_means_and_says_why_there_are_no_intervals(tmp_path):
    comparison = Comparison(("cut-in",), TRACKERS, (5,), out=str(tmp_path))
    page = written(make(comparison), tmp_path)
    assert "1 seed is too few for intervals" in page.text[: page.text.index("is best in GOSPA")]
    assert "too few seeds" in page.by_section["differences"]
    assert "nan" not in page.text.split()


def test_one_tracker_has_nothing_to_be_held_against(tmp_path):
    page = written(make(Comparison(("cut-in",), ("good",), (0, 1, 2), out=str(tmp_path))), tmp_path)
    assert "no other tracker" in page.by_section["verdict"]
    assert not {"differences", "ranking", "scenarios"} & set(page.ids)
    assert "reference" not in page.by_section["overview"]


@pytest.mark.parametrize(("scenarios", "trackers", "seeds"), [(1, 1, 1), (1, 2, 1), (2, 1, 2)])
def test_few_runs_read_like_sentences_and_say_that_no_interval_can_be_trusted(tmp_path, scenarios, trackers, seeds):
    names = ("cut-in", "merge")[:scenarios], TRACKERS[:trackers], tuple(range(seeds))
    page = written(make(Comparison(*names, out=str(tmp_path))), tmp_path, Tally(done=1, wall=3.0))
    assert not ODD.search(page.text)
    assert seeds < FEWEST
    assert f"{FEWEST} are the least. No interval and no difference on this page can be trusted" in page.text
    assert page.text.index("can be trusted") < page.text.index("GOSPA")
    assert ("differences" in page.ids) == (trackers > 1)
    assert ("scenarios" in page.ids) == (scenarios > 1)
    assert [link for link in page.links if link.startswith("#")] == [f"#{i}" for i in page.ids if i in page.by_section]


def test_as_many_seeds_as_an_interval_needs_are_no_caveat(page):
    assert "can be trusted" not in page.text


def test_a_folder_without_a_finished_run_says_so(tmp_path):
    comparison = Comparison(("cut-in",), TRACKERS, (0, 1), out=str(tmp_path))
    failed = [Outcome(task.name, FAILED, "ZeroDivisionError") for task in comparison.work()]
    page = Page(write_report(Results.read(comparison), Tally(failed=failed)))
    check_links(page)
    assert "nothing to compare" in page.by_section["verdict"]
    assert page.by_section["runs"].count("6 failed: ZeroDivisionError") == 1
    assert all(task.name in page.by_section["runs"] for task in comparison.work())


def test_the_verdict_stands_first_and_the_provenance_last(page):
    sections = [i for i in page.ids if i in page.by_section]
    assert sections[:2] == ["verdict", "ranking"]
    assert sections[-1] == "about"


def test_the_ranking_has_the_best_first_whatever_order_the_trackers_were_named_in(tmp_path):
    comparison = Comparison(("cut-in", "merge"), TRACKERS, (0, 1, 2, 3), reference="bad", out=str(tmp_path))
    made = make(comparison)
    turned = replace(made, study=replace(comparison, trackers=TRACKERS[::-1]))
    grid = ranking(turned, list(cells(turned, MAIN)))
    assert [line.name for line in grid.lines] == ["good", "fair", "bad"]
    assert [line.fields[0].text for line in grid.lines] == ["1", "2", "3"]
    behind = [float(line.fields[2].text) for line in grid.lines[1:]]
    means = made.runs.groupby("tracker")["gospa"].mean()
    assert behind == pytest.approx([means["fair"] - means["good"], means["bad"] - means["good"]], abs=0.006)


def test_rows_of_scenarios_are_marked_for_the_filter_and_the_page_is_whole_without_it(page):
    text = page.path.read_text()
    assert text.count('<tr data-scenario="merge">') == page.by_section["logs"].count("merge") + 1
    assert not re.search(r"<\w[^>]*\shidden", text.partition("<script>")[0])


def test_a_phase_that_no_run_reaches_is_said_with_its_count(tmp_path):
    found = make(Comparison(("cut-in",), TRACKERS, (0, 1, 2), out=str(tmp_path)))
    found.spans.loc[(found.spans["phase"] == "after"), "gospa"] = np.nan
    page = written(found, tmp_path)
    assert "after: 0 of 9 runs: no mean is of this phase" in page.text
    assert "during: 9 of 9 runs, after: 0 of 9 runs" in page.by_section["phases"]


def test_trackers_that_lack_as_many_runs_are_one_sentence(tmp_path):
    gone = (("cut-in", "fair", 1), ("cut-in", "bad", 2))
    page = written(make(Comparison(("cut-in",), TRACKERS, (0, 1, 2), out=str(tmp_path)), gone=gone), tmp_path)
    assert "fair and bad lack 1 of 3 runs each: their means" in page.text


def test_failures_are_grouped_by_their_reason_the_most_frequent_first():
    outcomes = [Outcome(f"run{k}", FAILED, f"Traceback {k}\n{why}\n") for k, why in enumerate(["A: 1", "B: 2", "B: 2"])]
    found = failures([*outcomes, Outcome("run3", FAILED, "")])
    assert [(f.reason, len(f.outcomes)) for f in found] == [("B: 2", 2), ("A: 1", 1), ("no reason was given", 1)]


def test_a_page_of_a_log_is_linked_where_it_was_written(tmp_path):
    log = tmp_path / "logs" / "a b.rrd"
    assert logs.found(log, tmp_path, "not here") == logs.LogFiles(note="not here")
    log.parent.mkdir()
    log.touch()
    assert logs.found(log, tmp_path, "").page == ""
    log.with_suffix(".html").touch()
    assert logs.found(log, tmp_path, "")[:2] == ("logs/a%20b.rrd", "logs/a%20b.html")


def test_missing_runs_are_named(tmp_path):
    comparison = Comparison(("cut-in", "merge"), TRACKERS, (0, 1, 2), out=str(tmp_path))
    gone = (("merge", "bad", 1), *((c, "fair", s) for c in ("cut-in", "merge") for s in (0, 1, 2)))
    page = written(make(comparison, gone=gone), tmp_path)
    assert "bad lacks 1 of 6 runs" in page.text
    assert "fair has no finished run" in page.text
    assert "merge_bad_seed1" in page.by_section["runs"]


def test_the_same_results_give_the_same_page_and_figures_wherever_they_go(results, page, tmp_path):
    shown, folder = [], tmp_path / "elsewhere"
    again = page_of(results, Tally(done=18, wall=12.5), lambda *step: shown.append((*step, "tables")))
    some = [plot for plot in again.plots if plot.name in ("cost", "time_nis")]
    again = again._replace(plots=some, links=lambda step: links_of(results, folder))
    path = write_page(again, folder, lambda *step: shown.append(step))
    check_links(Page(path))
    assert path == folder / "report.html"
    before = page.path.read_text().partition('<section id="figures">')[0]
    assert path.read_text().partition('<section id="figures">')[0] == before
    for name in ("cost.png", "time_nis.png"):
        assert (folder / "figures" / name).read_bytes() == (page.path.parent / "figures" / name).read_bytes(), name
    assert shown == [(k, 2, "tables") for k in range(3)] + [(0, 1, "figures"), (1, 2, "figures"), (2, 2, "figures")]


def gospa_of(values: dict[tuple[str, str, int], float]) -> Results:
    """Results with nothing but the GOSPA of runs (scenario, tracker, seed)."""
    scenarios, trackers, seeds = (tuple(dict.fromkeys(key[k] for key in values)) for k in range(3))
    rows = [dict(zip(("scenario", "tracker", "seed"), key), phase="all", gospa=value) for key, value in values.items()]
    return Results(Comparison(scenarios, trackers, seeds), pd.DataFrame(rows))


def test_best_median_and_worst_are_those_computed_by_hand():
    # Means of the scenarios: easy 2, hard 20. Relative to them, a: 0.5, 1.0, 0.9, 1.1; b: 1.5, 1.0, 1.2, 0.8.
    results = gospa_of(
        {("easy", "a", 0): 1.0, ("easy", "a", 1): 2.0, ("hard", "a", 0): 18.0, ("hard", "a", 1): 22.0,
         ("easy", "b", 0): 3.0, ("easy", "b", 1): 2.0, ("hard", "b", 0): 24.0, ("hard", "b", 1): 16.0}
    )  # fmt: skip
    found = {(p.run.source, p.place): (p.run.case, p.run.seed, round(p.relative, 9)) for p in logs.picks(results)}
    assert found == {
        ("a", "best"): ("easy", 0, 0.5),
        ("a", "median"): ("hard", 0, 0.9),
        ("a", "worst"): ("hard", 1, 1.1),
        ("b", "best"): ("hard", 1, 0.8),
        ("b", "median"): ("easy", 1, 1.0),
        ("b", "worst"): ("easy", 0, 1.5),
    }


def test_no_run_is_picked_twice():
    one = logs.picks(gospa_of({("easy", "a", 0): 1.0}))
    two = logs.picks(gospa_of({("easy", "a", 0): 1.0, ("easy", "a", 1): 3.0}))
    assert [p.place for p in one] == ["best"]
    assert [(p.place, p.run.seed) for p in two] == [("best", 0), ("worst", 1)]


def test_runs_without_a_gospa_are_not_picked():
    picked = logs.picks(gospa_of({("easy", "a", 0): np.nan, ("easy", "a", 1): 0.0}))
    assert [(p.place, p.run.seed) for p in picked] == [("best", 1)]


def test_a_lead_that_is_chance_is_not_called_resolved():
    rng = np.random.default_rng(4)
    values = {("easy", t, s): float(5 + rng.normal()) for s in range(6) for t in ("a", "b")}
    results = gospa_of(values)
    verdict = " ".join(report_words.verdict(results, list(cells(results, MAIN))))
    assert "not resolved: about" in verdict


def test_the_verdict_gives_a_lead_the_interval_that_the_ranking_gives():
    rng = np.random.default_rng(3)
    values = {
        (where, t, s): float(5 + (t == "b") + rng.exponential())
        for where in ("easy", "hard")
        for s in range(10)
        for t in ("a", "b")
    }
    results = gospa_of(values)
    found = list(cells(results, MAIN))
    behind = ranking(results, found).lines[1].fields[2]
    verdict = " ".join(report_words.verdict(results, found))
    assert f"lead over the next, b, is {behind.text} m {behind.bounds} and resolved" in verdict
    better = np.mean([values[where, "a", s] < values[where, "b", s] for where in ("easy", "hard") for s in range(10)])
    assert f"it is the better one in {100 * better:.0f} % of the runs" in verdict


def test_seeds_are_written_as_people_do():
    assert seeds_text((0, 1, 2, 3)) == "0 to 3"
    assert seeds_text((4, 2)) == "4, 2"
    assert seeds_text((7,)) == "7"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    out = tmp_path_factory.mktemp("recorded")
    comparison = Comparison(
        ("cut-in",), ("rm-feldmann", "rm-koch"), (0,), Settings(duration=1.0), out=str(out / "a folder")
    )
    report = execute(comparison, Engine())
    assert not report.failed
    return comparison, report


def test_logs_are_written_from_the_recording_and_linked(recorded):
    comparison, report = recorded
    shown = []
    results = Results.read(comparison)
    folder = Path(comparison.out)
    alone = page_of(results, report)._replace(
        plots=(), links=lambda step: links_of(results, folder, logs.write(results, progress=step))
    )
    page = Page(write_page(alone, folder, lambda *step: shown.append(step)))
    check_links(page)
    linked = [unquote(link) for link in page.links if link.endswith(".rrd")]
    assert linked == [
        "logs/cut-in_rm-feldmann_surround_replay_seed0.rrd",
        "logs/cut-in_rm-koch+rm-feldmann_surround_replay_seed0.rrd",
    ]
    assert all(f"testbed review {page.path.parent / link}" in page.text.replace("'", "") for link in linked)
    assert (2, 2, "logs") in shown
    assert not list((page.path.parent / "logs").glob(".part*"))
    meta = json.loads((page.path.parent / linked[1]).with_suffix(".json").read_text())
    assert meta["run"]["trackers"] == ["rm-koch", "rm-feldmann"]


def test_logs_that_are_there_are_kept(recorded, tmp_path):
    copied = replace(recorded[0], out=str(shutil.copytree(recorded[0].out, tmp_path / "copy")))
    shutil.rmtree(tmp_path / "copy" / "logs", ignore_errors=True)
    results = Results.read(copied)
    found = logs.picks(results)
    kept = logs.log_path(found[0], tmp_path / "copy")
    kept.parent.mkdir()
    kept.write_text("mine")
    outcomes = logs.write(results)
    assert [o.status for o in outcomes] == ["found", "done"]
    assert kept.read_text() == "mine"


def test_a_reference_that_failed_is_in_no_log(recorded, tmp_path):
    copied = replace(recorded[0], out=str(shutil.copytree(recorded[0].out, tmp_path / "copy")))
    shutil.rmtree(tmp_path / "copy" / "logs", ignore_errors=True)
    run = next(run for run in copied.work() if run.source == copied.baseline)
    Store(copied).path(run).unlink()
    results = Results.read(copied)
    assert {outcome.status for outcome in logs.write(results)} == {"done"}
    assert [p.stem for p in (tmp_path / "copy" / "logs").glob("*.rrd")] == ["cut-in_rm-koch_surround_replay_seed0"]


def test_logs_of_closed_loops_are_driven_again(tmp_path):
    settings = Settings(duration=0.6, loop="closed")
    comparison = Comparison(("cut-in",), ("rm-feldmann",), (1,), settings, out=str(tmp_path))
    assert not execute(comparison, Engine()).failed
    results = Results.read(comparison)
    assert [o.status for o in logs.write(results)] == ["done"]
    assert (tmp_path / "logs" / "cut-in_rm-feldmann_surround_idm_seed1.rrd").is_file()

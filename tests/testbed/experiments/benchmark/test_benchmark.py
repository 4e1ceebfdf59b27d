"""Benchmarks: what is frozen, entries that are made again bit for bit, tracks of any origin, and ranks."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.experiments import store
from testbed.experiments.benchmark import definition, runs, table
from testbed.experiments.benchmark.definition import BENCHMARKS, find, frozen
from testbed.experiments.benchmark.entries import Entry, read
from testbed.experiments.rows import SCHEMA

V1 = BENCHMARKS["v1"]
TINY = replace(
    V1,
    name="tiny",
    development=(1000, 1001),
    tracks=(
        replace(V1.tracks[0], cases=("passed",)),
        replace(V1.tracks[1], cases=("passed",)),
        replace(V1.tracks[2], cases=("passed+drop:0.2",)),
    ),
)


def call(*arguments):
    return CliRunner().invoke(app, ["benchmark", *map(str, arguments)])


@pytest.fixture(scope="module")
def tiny():
    """A benchmark of two seconds and two seeds, under its name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(definition, "BENCHMARKS", MappingProxyType({"tiny": TINY}))
        for module in (definition, runs):
            patch.setattr(module, "LENGTH", {"duration": 2.0, "after": 3.0, "settle": 1.0})
        yield


@pytest.fixture(scope="module")
def made(tiny, tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmark")
    done = call("run", "tiny", "--tracker", "rm-koch", "--out", folder / "runs")
    assert done.exit_code == 0, done.output
    return folder


def entry_of(made):
    return made / "runs" / "tiny_rm-koch_development.json"


def test_v1_is_as_it_was_frozen():
    """Its results may have changed: until 1.0.0 run `testbed benchmark freeze v1` and commit the file."""
    assert V1.digests() == frozen(V1)


def test_what_a_version_consists_of_is_in_its_digest():
    for other in (
        replace(V1, development=(1, 2)),
        replace(V1, tracks=V1.tracks[:2]),
        replace(V1, tracks=(replace(V1.tracks[0], radars=("front",)), *V1.tracks[1:])),
    ):
        assert other.digests()["definition"] != V1.digests()["definition"]


def test_seeds_of_a_phrase_are_its_own_and_none_is_public():
    seeds = V1.seeds("rain on Tuesday")
    assert seeds == V1.seeds("rain on Tuesday") != V1.seeds("rain on Monday")
    assert len(set(seeds)) == len(V1.development)
    assert min(seeds) >= 10**6
    assert max(seeds) < 10**9
    with pytest.raises(ValueError, match="phrase must have words"):
        V1.seeds(" ")


def test_the_second_radar_scans_what_the_first_has_recorded():
    first, second = (run for _, run in list(V1.track("open").runs("rm-koch", 1))[:2])
    assert (first.radar, second.radar) == ("surround", "imaging")
    assert first.recording == second.recording


def test_an_entry_is_made_again_bit_for_bit(made):
    one = read(entry_of(made))
    assert {(run["track"], run["case"]) for run in one.runs} == {
        ("open", "passed"), ("open", "passed@imaging"), ("closed", "passed"), ("faults", "passed+drop:0.2"),
    }  # fmt: skip
    assert 0 < one.at["closed", "passed", 1000]["score"] <= 1
    ran = {store.read_meta(path, SCHEMA)["compiled"] for path in (made / "runs" / "rows").iterdir()}
    assert one.made["compiled"] == "; ".join(sorted(ran))
    done = call("check", entry_of(made), "--runs", 3, "--out", made / "again")
    assert done.exit_code == 0, done.output
    assert "3 of 8 runs" in done.output
    assert "bit for bit the same; 0 differ" in done.output


def test_an_entry_with_another_number_does_not_hold(made, tmp_path):
    found = json.loads(entry_of(made).read_text())
    for run in found["runs"]:
        run["gospa"] *= 0.99
    (tmp_path / "better.json").write_text(json.dumps(found))
    done = call("check", tmp_path / "better.json", "--runs", 1, "--out", tmp_path / "again")
    assert done.exit_code == 1
    assert "not the same; 1 differ" in done.output


def test_an_entry_of_other_seeds_or_code_is_refused(made, tmp_path):
    found = json.loads(entry_of(made).read_text())
    for change, said in (({"seeds": [5, 6]}, "other seeds than those"), ({"digests": {}}, "rests on other code")):
        (tmp_path / "other.json").write_text(json.dumps(found | change))
        done = call("check", tmp_path / "other.json", "--out", tmp_path / "again")
        assert done.exit_code == 2
        assert said in done.output
    (tmp_path / "other.json").write_text("{}")
    assert "is no entry of a benchmark" in call("table", tmp_path / "other.json").output


def test_tracks_of_any_origin_reach_what_the_tracker_reaches(made, tmp_path):
    """Those of our tracker, written to files and scored as files, have its measures to the last bit."""
    recordings, mine = tmp_path / "recordings", tmp_path / "mine"
    assert call("record", "tiny", "--out", recordings).exit_code == 0
    folders = [folder for folder in recordings.iterdir() if "seed" in folder.name]
    assert len(folders) == 6
    mine.mkdir()
    for folder in folders:
        arguments = [
            "replay",
            folder,
            "--tracker",
            "rm-koch",
            "--log",
            "off",
            "--format",
            "csv",
            "--out",
            tmp_path / "r",
        ]
        assert CliRunner().invoke(app, list(map(str, arguments))).exit_code == 0
        (written,) = (tmp_path / "r").glob(f"{folder.name}_*.csv")
        shutil.move(written, mine / f"{folder.name}.csv")
    scored = ["score", "tiny", mine, "--against", recordings, "--name", "mine", "--out"]
    done = call(*scored, tmp_path / "scored")
    assert done.exit_code == 0, done.output
    one, other = read(entry_of(made)), read(tmp_path / "scored" / "tiny_mine_development.json")
    assert other.kind == "tracks"
    assert len(other.runs) == 6
    assert all(run == one.at[run["track"], run["case"], run["seed"]] for run in other.runs)
    assert call(*scored, tmp_path / "again").exit_code == 0
    both = tmp_path / "scored" / "tiny_mine_development.json", tmp_path / "again" / "tiny_mine_development.json"
    assert "6 of 6 runs" in call("check", *both).output
    (mine / f"{folders[0].name}.csv").write_text((mine / f"{folders[1].name}.csv").read_text())
    assert call("score", "tiny", mine, "--against", tmp_path, "--name", "mine").exit_code == 2


def made_up(name, gospa, code="a", rng=None):
    """An entry whose runs of the first track have a mean and a spread that seeds share."""
    rng = rng or np.random.default_rng(1)
    cases = [case for case, _ in V1.track("open").runs("", 0)]
    every = tuple(
        {"track": "open", "case": case, "seed": seed, "gospa": gospa + 0.1 * k + 0.01 * rng.normal()}
        for k, seed in enumerate(V1.development)
        for case in cases
    )
    return Entry("v1", name, "tracker", None, V1.development, {"code": code}, every)


def test_ranks_say_what_is_not_resolved():
    rng = np.random.default_rng(0)
    entries = [made_up("far", 5.0, rng=rng), made_up("a", 2.0, rng=rng), made_up("b", 2.0001, rng=rng)]
    ranked = table.ranks(entries, V1.track("open"))
    assert [(r.entry.name, r.rank) for r in ranked] == [
        ("a", "1 to 2"), ("b", "1 to 2"), ("far", "3"),
    ]  # fmt: skip
    assert "not resolved from a neighbour: a, b" in " ".join(table.sentences(ranked, V1.track("open")))


def test_the_variance_is_where_it_was_put():
    found = table.spread([made_up("a", 2.0), made_up("b", 2.1)], V1.track("open"))
    assert found.seed > 0.95
    assert sum(found[:4]) == pytest.approx(1.0)
    assert found.needed == 3
    a, b = np.array([[1.0, 2.0, 3.0, 4.0]]), np.array([[1.0, 1.0, 4.0, 4.0]])  # differences 0, 1, -1, 0
    assert table.seeds_for(a, b, 0.1) == np.ceil((1.96 * np.std([0, 1, -1, 0], ddof=1) / 0.25) ** 2)


def test_entries_of_other_code_are_left_out_of_the_table():
    chosen, left = table.alike([made_up("a", 2.0), made_up("b", 2.0), made_up("old", 1.0, "b")])
    assert [one.name for one in chosen] == ["a", "b"]
    assert left == ["old is left out: it rests on other code, or on other seeds"]


def test_the_table_goes_into_a_page(made, tmp_path):
    done = call("table", made / "runs", "--out", tmp_path / "table.md")
    assert done.exit_code == 0, done.output
    page = Path(tmp_path / "table.md").read_text()
    assert "| `rm-koch` | 1 | 2 |" in page
    assert page.count("## ") == 3


def test_there_is_no_other_benchmark():
    with pytest.raises(LookupError, match="no benchmark 'v9'"):
        find("v9")
    assert call("list").exit_code == 0


def test_an_entry_without_a_whole_seed_is_named_and_has_no_rank():
    whole, part = made_up("whole", 2.0), made_up("part", 1.0)
    part = replace(part, runs=part.runs[:5])
    assert [ranked.entry.name for ranked in table.ranks([whole, part], V1.track("open"))] == ["whole"]
    assert list(table.incomplete([whole, part], V1.track("open"))) == [
        "open: part has 5 of 224 runs and no rank; the same command makes the rest"
    ]


def test_an_entry_of_fewer_seeds_is_held_against_others_on_these():
    whole, part = made_up("whole", 2.0), made_up("part", 2.1)
    part = replace(part, runs=part.runs[: 28 * 3 + 1])  # the run of the fourth seed counts nowhere
    ranked = table.ranks([whole, part], V1.track("open"))
    assert [(r.entry.name, r.rank) for r in ranked] == [("whole", "1"), ("part", "2")]
    grid = table.grid(ranked, V1.track("open"))
    assert [line.fields[1].text for line in grid.lines] == ["8", "3"]
    assert grid.lines[1].fields[2].text == f"{np.mean([run['gospa'] for run in part.runs[:-1]]):.2f}"
    assert "part has 85 of 224 runs and 3 whole seeds of 8" in " ".join(table.incomplete([part], V1.track("open")))
    assert np.isfinite(table.spread([whole, part], V1.track("open"))).all()


def test_the_first_seeds_alone_are_made_and_the_same_folder_goes_on(tiny, tmp_path):
    one = ["run", "tiny", "--tracker", "rm-koch", "--track", "faults", "--out", tmp_path]
    for count, more in ((1, ["--first", 1]), (2, [])):
        done = call(*one, *more)
        assert done.exit_code == 0, done.output
        assert len(read(tmp_path / "tiny_rm-koch_development.json").runs) == count
    assert "first must be at most 2" in call(*one, "--first", 3).output

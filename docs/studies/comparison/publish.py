"""The results of a complete comparison, made small enough to be committed: `make comparison`.

`RESULTS/comparison.json` says what was run, `runs.parquet` has the measures of every run and phase, `range.csv`,
`visible.csv` and `consistency.csv` are the tables of `testbed.experiments.series` that need all rows. Two
smaller comparisons stand beside it, `NAME.json` and `NAME.parquet` each: `closed`, trackers in closed loop, and
`layers`, the default tracker without each of its layers.
`studies.comparison.page` makes the page from them.
"""

import json
from collections.abc import Sequence
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import typer

from scenarios import SCENARIOS
from testbed.command_line.terminal import console, user_input
from testbed.evaluation.metric import COSTS, METRICS, old_names
from testbed.experiments.compare import Comparison, Settings
from testbed.experiments.report.comparison import page_of
from testbed.experiments.report.figures import draw
from testbed.experiments.rows import SCHEMA
from testbed.experiments.series import by_band, consistency
from testbed.experiments.statistics import DRIVE, MAIN
from testbed.experiments.store import ROWS, Results, Store, read_meta
from testbed.files import atomic_file, write_atomic, write_json
from testbed.frame import TRUTH
from trackers import DEFAULT, TRACKERS
from trackers.lookup import parse

ABOUT, RUNS = "comparison.json", "runs.parquet"
PARTS = {"closed": (*MAIN, *DRIVE), "layers": MAIN}  # smaller comparisons -> their measures
PUBLISHED = (  # of every run and phase
    "gospa", "missed_percent", "false_per_scan", "rmse_position", "rmse_velocity", "rmse_heading_deg", "rmse_length",
    "rmse_width", "gwd", "box_iou", "contour_iou", "nees_position", "nees_velocity", "nees_heading", "nees_length",
    "nees_width", "switches", "lost", "birth_delay", "unborn_percent", "never", "uncovered_gap", *COSTS, *DRIVE,
)  # fmt: skip
TABLES = ("range", "visible", "consistency")  # .csv
KEY = ["scenario", "tracker", "seed", "phase"]  # of a row of `runs.parquet`
PICTURES = ("time_nees_position",)  # of the report, shown on the page
DIGITS = 6  # significant, of the tables


def stored_comparison(folder: Path, reference: str | None = None) -> Comparison:
    """All runs that lie in a folder, as the comparison that made them.

    Raises ValueError where the folder holds none, or not all runs of a product of scenarios, trackers and seeds.
    """
    settings = settings_of(folder)
    made = {_named(read_meta(path, SCHEMA)["run"]) for path in sorted((folder / ROWS).glob("*.parquet"))}
    if not made:
        raise ValueError(f"out: {folder} holds no finished run; run `testbed compare --out {folder}` first")
    found = [_in_order([names[k] for names in made], what) for k, what in enumerate(KEY[:3])]
    comparison = Comparison(found[0], found[1], found[2], settings, reference, out=str(folder))
    missing = [run for run in comparison.work() if _named(run.key) not in made]
    if missing:
        raise ValueError(f"out: {folder} lacks {len(missing)} runs, {missing[0].name} among them; finish it first")
    return comparison


def settings_of(folder: Path) -> Settings:
    """The settings that a folder was made with; ValueError where it holds no comparison."""
    known = Store(Comparison((TRUTH,), (TRUTH,), (0,), out=str(folder))).about()
    if known.get("study") != Comparison.name:
        raise ValueError(f"out: {folder} holds no comparison; make one with `testbed compare --out {folder}`")
    return Settings(**{f.name: known[f.name] for f in fields(Settings)})


def _named(key: dict[str, Any]) -> tuple[str, str, int]:
    """Scenario with its faults, tracker and seed of a run."""
    return "+".join([key["scenario"], *key["faults"]]), key["source"], key["seed"]


def publish(folder: Path, target: Path, pictures: Path, reference: str | None = None) -> None:
    """Write the small results of all runs in a folder, and the figures of its report that the page shows."""
    results = Results.read(stored_comparison(folder, reference))
    target.mkdir(parents=True, exist_ok=True)
    _write(target, *_small(results), about(results))
    draw([plot for plot in page_of(results, None).plots if plot.name in PICTURES], pictures, "comparison-")


def publish_part(name: str, folder: Path, target: Path, reference: str | None = None) -> None:
    """Write the small results of one of `PARTS` beside the others: no phases, no tables of rows.

    Raises ValueError where the runs are of the other loop.
    """
    results = Results.read(stored_comparison(folder, reference))
    loop = "closed" if name == "closed" else "open"
    if results.study.settings.loop != loop:
        raise ValueError(f"{name}: {folder} does not hold runs of {loop} loop; make them with --loop {loop}")
    target.mkdir(parents=True, exist_ok=True)
    measures = list(PARTS[name])
    _write_spans(target / f"{name}.parquet", results.runs[[*KEY, *measures]].astype(dict.fromkeys(measures, "float32")))
    write_json(target / f"{name}.json", about(results))


def replace_trackers(folder: Path, target: Path) -> tuple[str, ...]:
    """Replace the results of some trackers by those of the runs in a folder; returns their names.

    Their wall times stay, which compare with those of the other trackers only if all are made together. The report
    page stays too: its figures need the rows of all trackers. The digest of the code that all share stays: `refresh`
    proves that it gives the same results, and writes it.

    Raises:
        ValueError: the folder has other settings, versions, scenarios or seeds, or a tracker that was not published.
    """
    results = Results.read(stored_comparison(folder))
    before, known, tables = read(target)
    new, trackers = about(results), results.study.trackers
    shared = [key for key in known["identity"] if not key.startswith("code")]
    pairs = [(key, new[key], known[key]) for key in ("scenarios", "seeds")]
    for what, mine, theirs in pairs + [(key, new["identity"].get(key), known["identity"][key]) for key in shared]:
        if mine != theirs:
            raise ValueError(f"folder: {folder} has {what} {mine!r}, published is {theirs!r}; make the runs with that")
    if strange := set(trackers) - set(known["trackers"]):
        raise ValueError(f"folder: {folder} has {', '.join(sorted(strange))}, not published yet; publish all runs")
    spans, found = _small(results)
    costs = [key for key in COSTS if key in before.spans]
    spans = spans.drop(columns=costs).merge(before.spans[[*KEY, *costs]], on=KEY, how="left")

    def put(old: pd.DataFrame, mine: pd.DataFrame, key: list[str]) -> pd.DataFrame:
        """The old table with the rows of these trackers replaced, in the order that it has."""
        where = pd.MultiIndex.from_frame(old[key])
        kept = old[~old["tracker"].isin(trackers)]
        joined = pd.concat([kept, mine[old.columns]]).set_index(key, drop=False)
        return joined.reindex(where).reset_index(drop=True)

    digests = {key: new["identity"][key] for key in (f"code of {tracker}" for tracker in trackers)}
    keys = (["tracker", "band"], ["tracker", "band"], ["tracker", "phase"])
    merged = [put(tables[name], frame, key) for name, frame, key in zip(TABLES, found, keys, strict=True)]
    _write(target, put(before.spans, spans, KEY), merged, known | {"identity": known["identity"] | digests})
    return trackers


def _small(results: Results) -> tuple[pd.DataFrame, list[pd.DataFrame]]:
    """The measures of every run and phase, and the tables in the order of `TABLES`."""
    measures = [key for key in PUBLISHED if key in results.spans]
    spans = results.spans[KEY + measures].astype(dict.fromkeys(measures, "float32"))
    return spans, [by_band(results, "range"), by_band(results, "visible"), consistency(results)]


def _write_spans(path: Path, spans: pd.DataFrame) -> None:
    table = pa.Table.from_pandas(spans, preserve_index=False)
    described = [f.with_metadata({"unit": METRICS[f.name].unit if f.name in METRICS else ""}) for f in table.schema]
    with atomic_file(path) as file:
        pq.write_table(table.cast(pa.schema(described, table.schema.metadata)), file, compression="zstd")


def _write(target: Path, spans: pd.DataFrame, tables: Sequence[pd.DataFrame], known: dict[str, Any]) -> None:
    _write_spans(target / RUNS, spans)
    for name, found in zip(TABLES, tables, strict=True):
        write_atomic(target / f"{name}.csv", found.to_csv(index=False, float_format=f"%.{DIGITS}g"))
    write_json(target / ABOUT, known)


def about(results: Results) -> dict[str, Any]:
    """What was run, when, with which versions, and where the time went."""
    comparison = results.study
    folder = Path(comparison.out)
    made = max(path.stat().st_mtime for path in (folder / ROWS).glob("*.parquet"))
    return {
        "date": f"{datetime.fromtimestamp(made, UTC):%Y-%m-%d}",
        "scenarios": list(comparison.scenarios),
        "trackers": list(comparison.trackers),
        "seeds": list(comparison.seeds),
        "reference": comparison.baseline,
        "identity": {key: value for key, value in results.store.about().items() if key != "study"},
        "seconds": {name: round(value, 1) for name, value in results.shares.items()},
    }


def read(target: Path) -> tuple[Results, dict[str, Any], dict[str, pd.DataFrame]]:
    """Read published results: measures, `ABOUT`, and the tables by name."""
    results, known = _read_runs(target, ABOUT, RUNS)
    return results, known, {name: pd.read_csv(target / f"{name}.csv") for name in TABLES}


def read_part(name: str, target: Path) -> Results | None:
    """Published results of one of `PARTS`; None where there are none."""
    return _read_runs(target, f"{name}.json", f"{name}.parquet")[0] if (target / f"{name}.json").exists() else None


def _read_runs(target: Path, facts: str, runs: str) -> tuple[Results, dict[str, Any]]:
    known = json.loads((target / facts).read_text())
    settings = Settings(**{f.name: known["identity"][f.name] for f in fields(Settings)})
    scenarios, trackers, seeds = (tuple(known[what]) for what in ("scenarios", "trackers", "seeds"))
    comparison = Comparison(scenarios, trackers, seeds, settings, known["reference"], out=str(target))
    spans = pd.read_parquet(target / runs).rename(columns=old_names("comparison"))
    return Results(comparison, spans), known


def _in_order(values: Sequence[Any], what: str) -> tuple[Any, ...]:
    """Distinct values; names in the order of the catalogues."""
    catalogue = {"scenario": list(SCENARIOS), "tracker": list(TRACKERS)}.get(what)
    distinct = sorted(set(values))
    if catalogue is None:
        return tuple(distinct)
    return tuple(sorted(distinct, key=lambda name: (catalogue.index(parse(name.split("+")[0])[0]), name)))


def main(
    folder: Annotated[Path, typer.Argument(help="What `testbed compare --out` left.")],
    target: Annotated[Path, typer.Argument(help="Directory for the small results.")] = Path("docs/results"),
    pictures: Annotated[Path, typer.Argument(help="Directory for the pictures.")] = Path("docs/pictures"),
    reference: Annotated[str | None, typer.Option(help="The tracker that the others are compared with.")] = None,
    closed: Annotated[Path | None, typer.Option(help="Also these runs of trackers in closed loop.")] = None,
    layers: Annotated[Path | None, typer.Option(help="Also these runs of the default tracker without layers.")] = None,
    replace: Annotated[
        bool,
        typer.Option("--replace", help="FOLDER has some trackers of TARGET: replace these only."),
    ] = False,
) -> None:
    """Make the results of a complete comparison small enough to be committed."""
    with user_input((OSError, ValueError)):
        if replace:
            console.print(f"replaced {', '.join(replace_trackers(folder, target))}", highlight=False)
        else:
            publish(folder, target, pictures, reference)
        for name, part in (("closed", closed), ("layers", layers)):
            if part is not None:
                publish_part(name, part, target, DEFAULT if name == "layers" else reference)
    console.print(f"results  {target}, {pictures}", soft_wrap=True)

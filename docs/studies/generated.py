"""What the documentation says about the code: catalogue.md, radars.md, tables in comparing, own-*, results.md.

`make generated` writes them in a second; tests/docs/test_generated.py holds them against the code.
"""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scenarios import CONTOURS, PROBES, SCENARIOS, Contour, Scenario
from sensors import RADARS
from studies.page import Docs, fill
from studies.recording_columns import input_tables, track_columns
from studies.rigs.page import text as radars
from testbed.command_line.terminal import console
from testbed.environment.registration import env_id
from testbed.evaluation.metric import DRIVE, METRICS, PAIR, PAIRS, RUN, SCAN, SPAN, Metric
from testbed.experiments.rows import COLUMNS, TEXT
from testbed.files import write_atomic
from testbed.log.text import markdown_table
from testbed.planners import PLANNERS
from trackers import DEFAULT, TRACKERS
from trackers.composed import place_of

OF_TRACKER = (SCAN, SPAN, PAIR, PAIRS, RUN)
WRITTEN = "<!-- {}: written by `make generated` -->", "<!-- end of {} -->"  # around a part of a page


def pages(docs: Path) -> dict[Path, str]:
    """Text of each generated page under `docs`, by file; of some pages only parts are generated, and the rest stays."""
    comparing, recordings, results, tracks = (
        docs / f"{name}.md" for name in ("comparing", "own-recordings", "results", "own-tracks")
    )
    return {
        docs / "catalogue.md": catalogue(),
        comparing: with_parts(comparing.read_text(), {"columns": columns()}),
        recordings: with_parts(recordings.read_text(), {"tables": input_tables()}),
        tracks: with_parts(tracks.read_text(), {"tracks": track_columns()}),
        docs / "radars.md": radars(docs),
        results: with_parts(results.read_text(), {"tracker": metrics(OF_TRACKER), "drive": metrics((DRIVE,))}),
    }


def with_parts(page: str, parts: Mapping[str, str]) -> str:
    """The page with new parts, by name, between their marks."""
    for name, text in parts.items():
        start, end = (mark.format(name) for mark in WRITTEN)
        before, _, rest = page.partition(start)
        page = f"{before}{start}\n\n{text}\n\n{end}{rest.partition(end)[2]}"
    return page


def catalogue() -> str:
    """The page docs/catalogue.md."""
    return fill(
        "catalogue.md.j2",
        example=env_id("cut-in"),
        default=DEFAULT,
        scenarios=markdown_table(
            ("name", "what", "vehicles", "s", "code"),
            [(f"`{s.name}`", s.purpose, str(s.vehicles), f"{s.duration:g}", builder(s)) for s in SCENARIOS.values()],
        ),
        probe=env_id("probe-brake"),
        probes=names(PROBES),
        trackers=markdown_table(
            ("name", "what", "code", "method"),
            [(f"`{t.name}`", t.source, source(t.filter), method(place_of(t.filter))) for t in TRACKERS.values()],
        ),
        radars=names(RADARS),
        planners=markdown_table(("name", "what"), [(f"`{p.name}`", p.note) for p in PLANNERS.values()]),
        contours=markdown_table(
            ("name", "what", "default [m]", "lengths [m]", "widths [m]"),
            [(f"`{c.name}`", c.note, f"{c.length:g} x {c.width:g}", *ranges(c)) for c in CONTOURS.values()],
        ),
    )


def ranges(contour: Contour) -> tuple[str, str]:
    """Lengths and widths of a class in words."""
    if contour.sizes is None:
        return f"{contour.length:g}", f"{contour.width:g}"
    sizes = contour.sizes
    low, high = sizes.box[:, 1]
    lengths = f"{sizes.length.low:g} to {sizes.length.high:g}"
    if sizes.long is not None:
        lengths += f", or {sizes.long[1]:g}"
    return lengths, f"{low:.2f} to {high:.2f}" if high > low else f"{low:g}"


def columns() -> str:
    """The table of columns of a comparison's rows."""
    return markdown_table(
        ("column", "type", "unit", "what"),
        [(f"`{c.name}`", "text" if c.type == TEXT else str(c.type), c.unit, c.note) for c in COLUMNS],
    )


def metrics(levels: Sequence[str]) -> str:
    """The table of the metrics of some levels that the rows of results have."""
    chosen = [m for m in METRICS.values() if m.of in levels and (m.averaged or m.of not in (PAIR, SCAN))]
    return markdown_table(
        ("key", "unit", "of a", "better", "meaning"),
        [(f"`{m.key}`", m.unit.replace("1", ""), m.of, m.sense, explained(m)) for m in chosen],
    )


def explained(metric: Metric) -> str:
    """What a metric is, and the library without which it is left out."""
    return f"{metric.words} (needs `{metric.needs}`)" if metric.needs else metric.words


def builder(scenario: Scenario) -> str:
    """Link to the file in which the world of a scenario is built."""
    module = scenario.builder if isinstance(scenario.builder, str) else scenario.builder.__module__
    return link(module.partition(":")[0])


def names(registry: Iterable[str]) -> str:
    """The names of a registry in a row."""
    return ", ".join(f"`{name}`" for name in registry)


def source(filter: Any) -> str:
    """Link to the file of a filter."""
    return link(type(filter).__module__)


def method(filter: Any) -> str:
    """Link to the first method page that the docstring of the filter's module or class names; a dash without one."""
    texts = sys.modules[type(filter).__module__].__doc__, type(filter).__doc__
    named = [name for text in texts for name in re.findall(r"docs/methods/([\w-]+)\.md", text or "")]
    return f"[{named[0]}](methods/{named[0]}.md)" if named else "–"


def link(module: str) -> str:
    """Link to the file of a module, for a page in docs/."""
    path = f"{module.replace('.', '/')}.py"
    return f"[{path}](../{path})"


def main(docs: Docs = Path("docs")) -> None:
    """Write what the documentation says about the registries: catalogue.md, radars.md, tables of columns in others."""
    for page, text in pages(docs).items():
        write_atomic(page, text)
        console.print(f"page     {page}", soft_wrap=True)

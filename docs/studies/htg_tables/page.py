"""The page docs/htg-tables.md: the shipped tables with their commands, and how the model stands on real detections.

The comparison takes some minutes.
"""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from studies.htg_tables.comparison import BLOCK, FOLDS, MOST, compare
from studies.page import DOCS, PYTHON, Docs, Page
from testbed.command_line.terminal import progress_bar, stages, user_input
from testbed.learn.detections import GROWN, KINDS
from testbed.log.text import markdown_table
from trackers.htg.bins import SHIPPED

PAGE = """# Learned tables of the hierarchical truncated Gaussian

FOLDER holds `objects.npz` of the real extract. [learning.md](learning.md) says how to learn a table of your own and
what the JSON holds.

Each table has eight bins of the aspect angle, 0 and 180 degrees in the middle of a bin, and learns each bin also from
the mirror image of its opposite. The tables of our rigs come from the training sampler: lone vehicles of many sizes at
all aspects, up to 80 m away. There the noise of the data sheet is known for each detection and is taken out of r, so a
tracker adds the noise of its own radar (`scan.noise`). In the tables of real vehicles the noise is not known and is
part of r: use them with sigma = 0.

The tables `*-cd25` keep c_D, the share of the source outside the box, at about 0.25 or more: for the filters with
pseudo-measurements (`htg-rm-learned`). Free learning gives a better likelihood, but c_D falls to {least:.0e}, and such
a filter would count {most_imaginary:.0e} imaginary detections for each real one.

The tables `astyx-*` are fitted to Meyer and Kuschk, "Automotive Radar Dataset for Deep Learning Based 3D Object
Detection", EuRAD 2019 (Astyx GmbH, CC BY-NC-SA 4.0). Only the fitted parameters are stored here; the data stay outside
this project.

## Tables

`log p` is the mean of a detection [nat] on the training data, in bins and with mirror images; numbers of different data
cannot be compared.

{tables}

## Held-out log-likelihood on real detections

Cross-validated by frame: {folds} blocks of consecutive frames, because neighbouring frames show the same vehicles in
nearly the same place. Each model learns each aspect bin from at most {most} detections of the other blocks and their
mirror images, evenly taken out, and is judged on all detections of its block. Numbers are nats a detection, means over
detections; after ± stands half of the 95 % interval, for which {block} consecutive frames count as one draw.

Only detections within {grown} times the box count, since only they are known to belong to the vehicle; "log p in the
box" is normalised to that box for every model, which is the fairer comparison with the uniform density. Means over
detections weigh near vehicles most, as they return most. The source of the HTG and the uniform density are centred on
the box; Gaussians are free to move, so one Gaussian with 5 parameters is no special case of the HTG with 8. The mixture
with one covariance for both Gaussians has as many parameters as the HTG. The trucks are few and seen again and again,
hence their wide intervals.

{sections}
"""


def shipped() -> str:
    """One row for each shipped table."""
    rows = []
    for file in sorted(SHIPPED.glob("*.json")):
        facts = json.loads(file.read_text())["provenance"]
        mean = np.average(facts["log_likelihood"], weights=facts["counts"])
        cells = (file.stem, f"`{facts['command']}`", facts["detections"], f"{mean:.3f}", f"{min(facts['mass']):.2g}")
        rows.append(tuple(map(str, cells)))
    return markdown_table(("table", "made by", "detections", "log p", "least c_D"), rows)


def render(sections: list[str]) -> str:
    """What the page says; sections are the comparisons, `compare` of each data source."""
    least = min(min(json.loads(file.read_text())["provenance"]["mass"]) for file in SHIPPED.glob("*.json"))
    return PAGE.format(
        least=least,
        most_imaginary=1 / least,
        tables=shipped(),
        folds=FOLDS,
        most=MOST,
        grown=GROWN,
        block=BLOCK,
        sections="\n\n".join(sections),
    )


def main(
    folder: Annotated[Path, typer.Argument(help="That of the real extract, the one with objects.npz.")],
    docs: Docs = DOCS,
) -> None:
    """Compare densities on real detections, and write htg-tables.md with the shipped tables."""
    with user_input():
        page = Page("htg-tables", docs)
        with progress_bar("{task.completed:.0f} of {task.total:.0f} folds") as bar:
            show = stages(bar)
            sections = [f"### {kind.capitalize()}s\n\n{compare(f'{folder}:{kind}', progress=show)}" for kind in KINDS]
    page.write(render(sections), " ".join((*PYTHON, "htg-tables", "FOLDER")))

"""`python -m testbed.studies NAME`: all pages of the documentation that commands write, and committed results."""

from collections.abc import Callable, Mapping

import typer

from testbed.studies import generated, ghosts_figure, layers_figure, size_by_radar, vehicle_figure
from testbed.studies.calibration import page as calibration
from testbed.studies.closed_loop import page as closed_loop
from testbed.studies.comparison import committed, publish, refresh
from testbed.studies.comparison import page as comparison
from testbed.studies.consistency import page as consistency
from testbed.studies.contours import page as contours
from testbed.studies.faults import page as faults
from testbed.studies.htg_tables import page as htg_tables
from testbed.studies.learned import page as learned
from testbed.studies.modes import page as modes
from testbed.studies.partial_view import page as partial_view
from testbed.studies.persistence import page as persistence
from testbed.studies.probes import page as probes
from testbed.studies.regret import page as regret
from testbed.studies.rigs import figure as rigs_figure
from testbed.studies.rigs import range_rates, sensitivity
from testbed.studies.standing import page as standing
from testbed.studies.traffic import page as traffic

STUDIES: Mapping[str, Callable[..., None]] = {
    "calibration": calibration.main,
    "closed-loop": closed_loop.main,
    "comparison": comparison.main,
    "consistency": consistency.main,
    "contours": contours.main,
    "faults": faults.main,
    "ghosts": ghosts_figure.main,  # a picture for docs/ghosts.md
    "htg-tables": htg_tables.main,
    "layers": layers_figure.main,  # pictures for docs/layers.md
    "learned-policies": learned.main,
    "modes": modes.main,
    "partial-view": partial_view.main,
    "persistence": persistence.main,
    "probes": probes.main,
    "regret": regret.main,
    "standing-returns": standing.main,
    "traffic": traffic.main,
    "radars": rigs_figure.main,  # a picture for docs/radars.md
    "vehicles": vehicle_figure.main,  # a picture for docs/methods
    # committed results that pages show
    "publish": publish.main,
    "refresh": refresh.main,
    "verdicts": committed.main,
    "surround": sensitivity.main,
    "size-by-radar": size_by_radar.main,
    "range-rates": range_rates.main,
    # what the documentation says about the registries
    "generated": generated.main,
}

app = typer.Typer(
    help="Pages of the documentation, docs/NAME.md each, and the results that they show.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
for name, study in STUDIES.items():
    app.command(name)(study)

if __name__ == "__main__":
    app()

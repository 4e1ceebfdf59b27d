"""The runs of a comparison by fault, with the measures that the page shows."""

import pandas as pd

from sensors.fault_text import split_faults
from studies.effects import Factor

NONE = "none"  # in place of a fault
FAULT = Factor("fault", NONE, lambda fault: fault if fault == NONE else f"`{fault}`")
MEASURES = ("gospa", "switches")
COLUMNS = ("scenario", "fault", "tracker", "seed", *MEASURES)


def by_fault(runs: pd.DataFrame) -> pd.DataFrame:
    """One row a run with `COLUMNS`, from the runs of a comparison, whose scenarios read NAME+FAULT+FAULT."""
    parts = [split_faults(case) for case in runs["scenario"]]
    split = {"scenario": [name for name, _ in parts], "fault": ["+".join(faults) or NONE for _, faults in parts]}
    return runs.assign(**split)[list(COLUMNS)].reset_index(drop=True)

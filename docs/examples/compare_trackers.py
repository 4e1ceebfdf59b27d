"""Compare two trackers: the same traffic and the same detections for both, three seeds, paired differences.

    python docs/examples/compare_trackers.py

For many seeds and scenarios, with 95 % intervals, figures and a report page, use the command line:

    testbed compare cut-in merge --tracker imm-spline --tracker rm-feldmann --seeds 0:20 --jobs 2
"""

import numpy as np

import testbed
from testbed.experiments.single import RunConfig, run

TRACKERS = ("imm-spline", "rm-feldmann")  # the first one's tracks go to the planner
MEASURES = ("gospa", "rmse_position", "rmse_length")  # keys of testbed.METRICS and of the results

rows = []
for seed in range(3):
    config = RunConfig("cut-in", TRACKERS, radar="surround", seed=seed, duration=3.0, out="runs", log="off")
    results = run(config).result["trackers"]  # the same as runs/*.json
    rows.append([[results[name][key] for key in MEASURES] for name in TRACKERS])

values = np.array(rows)  # (seed, tracker, measure)
difference = values[:, 0] - values[:, 1]  # on the same seed: what the seeds have in common drops out
spread = difference.std(0, ddof=1) / np.sqrt(len(rows))
for k, key in enumerate(MEASURES):
    means = "  ".join(f"{name} {values[:, j, k].mean():.2f}" for j, name in enumerate(TRACKERS))
    print(f"{testbed.METRICS[key].title:18} {means}  difference {difference[:, k].mean():+.2f} +- {spread[k]:.2f}")

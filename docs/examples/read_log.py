"""Read a review log back: what was run, curves of a metric, events, and the results beside it.

python docs/examples/read_log.py
"""

import json

from testbed.experiments.single import RunConfig, run
from testbed.log import reader

# A short run writes runs/RUN.rrd (the log) and runs/RUN.json (the results).
done = run(RunConfig("cut-in", ("imm-spline",), duration=3.0, seed=0, out="runs"))
path = done.rrd

properties = reader.properties(path)
print("run    ", {key: properties["run"][key] for key in ("scenario", "radar", "seed")})

# Entities are paths, listed in testbed/log/paths.py: geometry under world/, numbers under metrics/ and objects/.
print("paths  ", len(reader.entity_paths(path)), "entities, such as", min(reader.entity_paths(path)))

steps, gospa = reader.scalars(path, "metrics/gospa/**")["metrics/gospa/imm-spline"]  # one value a scan
print(f"GOSPA   {gospa[0]:.2f} m in step {steps[0]}, {gospa[-1]:.2f} m in step {steps[-1]}")

for event in reader.events(path)[:3]:  # births, deaths, switches, phases of the maneuver
    print(f"event   {event.time:.2f} s  {event.text}")

results = json.loads(done.json.read_text())  # docs/results.md says what it holds
print("results", {key: round(results["trackers"]["imm-spline"][key], 2) for key in ("gospa", "nees_position")})

# The same log in the viewer: testbed review runs/*.rrd

"""What the page docs/traffic.md says around its tables."""

TEXT = """# Our traffic beside real traffic

How long and wide vehicles are, how fast they drive and what gap they keep: in recordings of two American freeways, in
the catalogue of scenarios, and in `highway-v0` of highway-env.

- **I-80** and **US-101**: NGSIM (US Department of Transportation), congested traffic. I-80 are 200 vehicles over
  10 s, 16:00, as SMARTS has them; US-101 two CommonRoad scenarios, 8 of their 26 vehicles in both.
  Nothing recorded is part of this project.
- **catalogue**: the {scenes} scenarios with more than one vehicle besides the ego, as they start under {seeds} seeds
  ("start"), and over their course under {driven} of them ("all"), the ego driven by `truth`. The ego is a leader for
  those behind it, but has no rows of its own.
- **highway-v0**: as it comes, {seeds} seeds at the start, {native} over their course.

One row is a vehicle at one second; a size is counted once a vehicle. A gap is from the front bumper to the rear of
the next vehicle ahead in the same lane, up to {farthest:g} m; a time gap is the gap over the speed of the follower,
from 1 m/s on. {clock}

Quantiles, with {level} % intervals by the bootstrap in brackets at 5, 50 and 95 %. Drawn are the vehicles of
recordings and the seeds of simulations. Vehicles of one queue are not independent, so the intervals of US-101 are too
narrow. Groups of fewer than {fewest} vehicles are left out.

![Cumulative distributions of sizes, speeds and gaps](pictures/traffic.png)

## What is real, and what is not

- **Lengths of cars are in the middle of what was recorded.** The median of our cars is within .1 m of that of I-80.
  The recorded ones spread more, but NGSIM has one class for all up to 6 m, vans and pick-ups too; our cars and vans
  together reach farther up. The recordings are American, of 2005, and most of their lengths stand in steps of .15 m;
  one of 2.56 m is an error. They do not contradict our spread (a mean of 4.45 m, .42 m about it), so it stays.
- **Recorded widths are no measure of ours.** They are from 1.3 to 2.6 m, half of them above 2.1 m, as few cars are
  without their mirrors, and hardly go with the length. Ours are within 1.67 and 1.97 m at the mean length.
- **Trucks** of I-80 are 13, from 7.6 to 23 m. Ours end at 18.75 m, the limit in the European Union, and have buses
  among them.
- **Speeds differ by design.** The recordings are of queues, ours of free European traffic, but for `stop-and-go`,
  `dense-traffic`, country roads and junctions.
- **Our followers are right in the middle and too much alike.** At 10 to 20 m/s the median time gap is that of US-101,
  about 1.6 s. But a quarter of the recorded ones is below .9 s, and 5 % of ours are below 1.25 s: every driver of ours
  has the time headway of its platoon, mostly 1.2 s, and starts at a gap at which it need not brake. Tailgaters are
  missing; only `six-radar-highway`, whose places are published, has time gaps of .6 s. No scenario has gaps that no
  driver keeps. For a radar ours is the easier case: who follows closely is hidden more.
- **At standstill** our queues keep 4 m or more from bumper to bumper; a quarter of the recorded ones is below 2.8 m.
- **`highway-v0`** has vehicles of one size, 5 x 2 m, at nearly one speed, with the widest time gaps of all.
- **Seeds share their sizes.** Scenarios draw from the same numbers under one seed: a car that is placed first under
  seed 0 is as long in all of them. Of all sizes at the start under {seeds} seeds less than half are different ones,
  so the quantiles of our sizes are rougher than their number says, and results of two scenarios under one seed are
  not independent.

## Sizes

Length [m]:

{length}

Width [m]:

{width}

## Speeds

Speed [m/s]:

{speed}

## Gaps by the speed of the follower

Gap [m]:

{gap}

Time gap [s]:

{time_gap}

## Scenario by scenario

5, 50 and 95 %, over the course.

{scenarios}

## Limits

- 26 vehicles are few, and their stretch of road is about 100 m long, so wider gaps are cut off by the end of the
  record. Free European motorway traffic would be the fair comparison; recordings of it (highD, exiD) may be used on
  request and not be passed on.
- NGSIM positions are noisy (Thiemann, Treiber and Kesting 2008; Montanino and Punzo 2013). Speeds are derivatives of
  smoothed places ([real-traffic.md](real-traffic.md)). Nothing that comes with the recordings tells the errors of
  sizes.
- All vehicles of US-101 are called cars, also one of 10.5 m; below 6 m they are taken for cars, above for trucks.
"""

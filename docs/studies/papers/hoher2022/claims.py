"""What the report on hoher2022 claims, and our answers; docs/methods/virtual-measurements.md has the equations."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from studies.papers.answer import Answer, Claim, judge
from studies.papers.hoher2022.runs import SETTLED, ContourErrors, measure
from studies.papers.hoher2022.uturn import CAR, FIRST, SHAPES, lidar_hits, truth
from trackers.geometry import unit
from trackers.random_matrix.rays import root_of
from trackers.random_matrix.virtual_measurements import VirtualMeasurements

AllErrors = Mapping[tuple[str, str], ContourErrors]  # case and method
Pairs = Mapping[str, tuple[float, float]]  # by case
NOISES = ("0.0", "0.1", "0.5")  # [m]
LATE = 60  # steps after which the start-up is over
CLEAR = 0.1  # of IoU, a clear gain
SAME = 0.03  # of IoU, within the tolerance of 100 runs
FIRST_PATH = tuple(f"{shape}, sigma {s}" for shape in SHAPES for s in NOISES)
SECOND_PATH = tuple(f"second path, {shape}, sigma {s}" for shape in ("rectangle", "ellipse") for s in NOISES)
DRIFTING = tuple(f"drift, {shape}, sigma {s}" for shape in ("ellipse", "rectangle") for s in NOISES)


def answers(errors: AllErrors) -> tuple[Answer, ...]:
    """An answer to every claim; errors must hold every case and method of the experiment."""
    return (
        contour_gain(errors),
        printed_form(errors),
        one_side(errors),
        two_iterations(errors),
        stability(),
        learned_tilt(errors),
        no_virtual_detections(errors),
        naive_feedback(errors),
        offset_feedback(errors),
        sensor_noise(errors),
        radar_too(errors),
    )


def value(errors: AllErrors, case: str, method: str, name: str = "IoU", since: int = SETTLED) -> float:
    """One measure of one method in one case."""
    return measure(errors[case, method], since)[name]


def pairs_of(
    errors: AllErrors, cases: Iterable[str], methods: tuple[str, str], name: str = "IoU", since: int = SETTLED
) -> Pairs:
    """One measure of two methods by case."""
    first, second = methods
    return {case: (value(errors, case, first, name, since), value(errors, case, second, name, since)) for case in cases}


def compare(pairs: Pairs, digits: int = 2) -> str:
    """Pairs of figures as text."""
    return ", ".join(f"{case} {a:.{digits}f} / {b:.{digits}f}" for case, (a, b) in pairs.items())


def contour_gain(errors: AllErrors) -> Answer:
    """The main claim, for the corrected form."""
    claim = Claim("The adaptation gives a much better contour than the random matrix alone", "section IV")
    pairs = pairs_of(errors, FIRST_PATH, ("RM corrected, 1 sigma", "C33 I=2"))
    held = {case: b > a + CLEAR for case, (a, b) in pairs.items()}
    return judge(claim, held, f"corrected form, mean IoU without / with: {compare(pairs)}")


def printed_form(errors: AllErrors) -> Answer:
    """The same for the equations and parameters as printed, with either scale of the random matrix's ellipse."""
    claim = Claim("The algorithm as printed, with I = 2, gives a much better contour than the random matrix", "III, IV")
    pairs = {}
    for shape in ("rectangle", "ellipse"):
        for s in NOISES:
            case = f"{shape}, sigma {s}"
            alone = [m for c, m in errors if c == case and m.startswith("RM")]
            pairs[case] = max(value(errors, case, m) for m in alone), value(errors, case, "P I=2")
    held = {case: b > a + CLEAR for case, (a, b) in pairs.items()}
    return judge(claim, held, f"mean IoU of the best random matrix / of P I=2: {compare(pairs)}")


def longest_one_sided() -> slice:
    """The longest run of steps on the first path at which the lidar's rays meet one side of the rectangle only."""
    single = np.array([len(np.unique(sides)) == 1 for _, _, sides in lidar_hits(truth(FIRST, "rectangle"))])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], single.astype(int), [0]])))
    start, end = edges.reshape(-1, 2)[np.diff(edges.reshape(-1, 2), axis=1).argmax()]
    return slice(int(start), int(end))


def one_side(errors: AllErrors) -> Answer:
    """Width of the ellipses at the end of the one-sided steps."""
    claim = Claim("Seen from one side, the random matrix collapses on to the detections; the adaptation does not", "IV")
    steps = longest_one_sided()
    pairs = {
        f"sigma {s}": tuple(
            float(CAR[1] + errors[f"rectangle, sigma {s}", m].width[:, steps.stop - 1].mean())
            for m in ("RM corrected, 1 sigma", "C I=2")
        )
        for s in NOISES
    }
    held = {case: a < 0.3 and b > 1.2 for case, (a, b) in pairs.items()}
    text = f"width [m] after {steps.stop - steps.start} one-sided steps, truth {CAR[1]}, without / with: "
    return judge(claim, held, text + compare(pairs))  # type: ignore[arg-type]


def two_iterations(errors: AllErrors) -> Answer:
    """I = 2 against I = 10 once the start-up is over, body moments."""
    claim = Claim("I = 2 iterations are quite enough", "section IV")
    pairs = pairs_of(errors, FIRST_PATH + SECOND_PATH, ("C I=2", "C I=10"), since=LATE)
    held = {case: a > b - SAME for case, (a, b) in pairs.items()}
    return judge(claim, held, f"mean IoU after {LATE} steps with I = 2 / 10: {compare(pairs)}")


def jacobian(distance: float, aspect: float, eigenvalues: bool) -> NDArray:
    """Jacobian dy~/du (4, 4) of a car-sized ellipse at `distance` [m] under `aspect` [rad]; central differences."""
    f = VirtualMeasurements(rays=2001)

    def statistics(u: NDArray) -> NDArray:
        points, _ = f.virtual(np.zeros(2), u[:2], root_of(u[2:], np.array(aspect)))
        C = np.cov(points.T, bias=True)
        h, g = unit(aspect), unit(aspect + np.pi / 2)
        spread = np.linalg.eigvalsh(C)[::-1] if eigenvalues else np.array([h @ C @ h, g @ C @ g])
        return np.concatenate([points.mean(0), 2 * np.sqrt(spread)])

    u, d = np.array([distance, 0.0, *CAR]), 1e-3
    return np.stack([(statistics(u + d * e) - statistics(u - d * e)) / (2 * d) for e in np.eye(4)], -1)


def stability() -> Answer:
    """Error dynamics I - K J of the step rule, linearised at the solution."""
    claim = Claim("The step rule is stable for 0 < K < 2", "section II.C")
    held, texts = {}, []
    for name, eigenvalues in (("eigenvalues as printed", True), ("body moments", False)):
        modes = np.concatenate(
            [np.linalg.eigvals(jacobian(r, np.radians(a), eigenvalues)) for r in (8.0, 20.0) for a in range(0, 91, 5)]
        )
        held[name] = bool(max(np.abs(1 - K * modes).max() for K in (0.1, 1.0, 1.9)) < 1)
        texts.append(f"{name}: real parts of dy~/du from {modes.real.min():.2f} to {modes.real.max():.2f}")
    return judge(claim, held, "; ".join(texts) + " (ranges 8 and 20 m, aspects 0 to 90 deg)")


def learned_tilt(errors: AllErrors) -> Answer:
    """Tilt error with the learned matrix and with the heading from the velocity, target that drifts by 20 deg."""
    claim = Claim("Learning the matrix of the ellipse expresses a drifting target", "IV, improvement 1")
    pairs = pairs_of(errors, DRIFTING, ("C I=10", "square root I=10"), "tilt [deg]")
    held = {case: b < 0.6 * a for case, (a, b) in pairs.items()}
    return judge(claim, held, f"tilt RMSE [deg] from the velocity / learned: {compare(pairs, 1)}")


def no_virtual_detections(errors: AllErrors) -> Answer:
    """IoU of the direct form against that of C33."""
    claim = Claim("Virtual detections can be discarded and the real ones used directly", "IV, improvement 2")
    pairs = pairs_of(errors, FIRST_PATH, ("C33 I=2", "direct I=2"))
    held = {case: b > a - SAME for case, (a, b) in pairs.items()}
    return judge(claim, held, f"mean IoU of C33 I=2 / of the direct form with tangent rows: {compare(pairs)}")


def naive_feedback(errors: AllErrors) -> Answer:
    """Tilt error when the contour overwrites the filter's state."""
    claim = Claim("Overwriting the filter's state with the contour causes significant errors of the tilt", "IV, 4")
    pairs = pairs_of(errors, [c for c, m in errors if m == "C naive"], ("C I=2", "C naive"), "tilt [deg]")
    held = {case: b > 2 * a for case, (a, b) in pairs.items()}
    return judge(claim, held, f"tilt RMSE [deg] without / with: {compare(pairs, 1)}")


def offset_feedback(errors: AllErrors) -> Answer:
    """Position error of a filter that gets the offset of the mean from the contour."""
    claim = Claim("Fed back correctly, the contour improves the filter's own state", "IV, improvement 4")
    names, methods = [c for c, m in errors if m == "G offset"], ("G I=1", "G offset")
    pairs = pairs_of(errors, names, methods, "position [m]")
    held = {case: b < 0.8 * a for case, (a, b) in pairs.items()}
    tilt = compare(pairs_of(errors, names, methods, "tilt [deg]"), 1)
    text = (
        f"filter position RMSE [m] without / with the offset: {compare(pairs)}; at the price of the tilt [deg]: {tilt}"
    )
    return judge(claim, held, text)


def sensor_noise(errors: AllErrors) -> Answer:
    """Width bias without sensor noise in the virtual spread, which the report does not mention."""
    claim = Claim("The virtual spread needs no sensor noise (it has none as printed)", "Algorithm 1, lines 20 to 28")
    names = [c for c, m in errors if m == "B without sigma^2" and "0.0" not in c]
    pairs = pairs_of(errors, names, ("B I=2", "B without sigma^2"), "width bias [m]")
    held = {case: b < a + 0.5 for case, (a, b) in pairs.items()}
    return judge(claim, held, f"width bias [m] with / without it: {compare(pairs)}")


def radar_too(errors: AllErrors) -> Answer:
    """The same course seen by our ray-cast radars, whose detections also come from inside the body."""
    claim = Claim("What holds for a lidar holds for a radar", "our question, not the report's")
    names = list(dict.fromkeys(c for c, _ in errors if c.startswith("our radar")))
    pairs = pairs_of(errors, names, ("RM corrected, 2 sigma", "C33 I=2"))
    held = {case: b > a + CLEAR for case, (a, b) in pairs.items()}
    box = ", ".join(f"{n} {value(errors, n, 'box, Bayes (ours)'):.2f}" for n in names)
    text = f"mean IoU of the random matrix at 2 sigma / of C33: {compare(pairs)}; box with Bayesian gain: {box}"
    return judge(claim, held, text)

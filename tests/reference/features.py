"""The 321 laser features of one scan, straight from their definitions, one at a time."""

import cmath
import math
from collections.abc import Sequence

TINY = 1e-9


def features(rho: Sequence[float]) -> dict[str, float]:
    """Value of every feature, by name, for clean ranges in metres."""
    lengths = [float(r) for r in rho]
    return {**beam_features(lengths), **polygon_features(lengths)}


def mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)


def std(values: Sequence[float]) -> float:
    centre = mean(values)
    return math.sqrt(math.fsum((v - centre) ** 2 for v in values) / len(values))


def beam_features(rho: list[float]) -> dict[str, float]:
    n_beams = len(rho)
    after = rho[1:] + rho[:1]
    jumps = [abs(a - b) for a, b in zip(rho, after, strict=True)]
    ratios = [(min(a, b) + 1e-4) / (max(a, b) + 1e-4) for a, b in zip(rho, after, strict=True)]
    values = {"f2": mean(jumps), "f2_sd": std(jumps)}
    for cut in range(5, 51, 5):
        shorter = [min(r, cut) for r in rho]
        values[f"f3[{cut}]"] = mean(
            [abs(a - b) for a, b in zip(shorter, shorter[1:] + shorter[:1], strict=True)]
        )
    values |= {"f8": mean(rho), "f8_sd": std(rho)}
    for k in range(1, 21):
        count = sum(jump > k / 2 for jump in jumps)
        values |= {f"f14[{k / 2}]": count, f"f33[{k / 2}]": count / (n_beams - 1)}
    for k in range(1, 11):
        count = sum(ratio < k / 10 for ratio in ratios)
        values |= {f"f30[{k / 10}]": count, f"f34[{k / 10}]": count / (n_beams - 1)}
    values |= {"f27": mean(ratios), "f27_sd": std(ratios)}
    longest = max(rho)
    shares = [r / longest if longest > TINY else 0.0 for r in rho]
    values |= {"f28": mean(shares), "f28_sd": std(shares)}
    spread = std(rho)
    fourth = mean([(r - mean(rho)) ** 4 for r in rho])
    values["f32"] = fourth / spread**4 if spread > 1e-6 else 0.0
    barriers = barriers_from_minimum(rho)
    for k in range(1, 11):
        distance, angle = two_minima(rho, barriers, k / 10)
        values |= {f"f25[{k / 10}]": distance, f"f26[{k / 10}]": angle}
    return values


def barriers_from_minimum(rho: list[float]) -> list[float]:
    """How far one must rise on the way from the lowest beam to each beam, on the lower side."""
    n_beams = len(rho)
    start = rho.index(min(rho))
    barriers = []
    for j in range(n_beams):
        steps = (j - start) % n_beams
        on_one_side = max(rho[(start + s) % n_beams] for s in range(steps + 1))
        on_the_other = max(rho[(start + s) % n_beams] for s in range(steps, n_beams + 1))
        barriers.append(min(on_one_side, on_the_other) - rho[j])
    return barriers


def two_minima(rho: list[float], barriers: list[float], prominence: float) -> tuple[float, float]:
    """Distance and angle between the lowest minimum and the lowest other one that stands out."""
    n_beams = len(rho)
    lowest = min(rho)
    start = rho.index(lowest)
    low = high = start  # the run of equal beams around it
    while high + 1 < start + n_beams and rho[(high + 1) % n_beams] == lowest:
        high += 1
    while low - 1 > high - n_beams and rho[(low - 1) % n_beams] == lowest:
        low -= 1
    middle = (low + high) / 2
    others = []
    for j in range(n_beams):
        if barriers[j] >= prominence:
            turn = abs(j - middle) % n_beams
            others.append((rho[j], min(turn, n_beams - turn)))
    if not others:
        return 0.0, 0.0
    second, turn = min(others)  # of equally low ones the nearest
    angle = turn * 2 * math.pi / n_beams
    return abs(second * cmath.exp(1j * angle) - lowest), angle


def polygon_features(rho: list[float]) -> dict[str, float]:
    n_beams = len(rho)
    corners = [r * cmath.exp(2j * math.pi * i / n_beams) for i, r in enumerate(rho)]
    sides = list(zip(corners, corners[1:] + corners[:1], strict=True))
    area = math.fsum((a.conjugate() * b).imag for a, b in sides) / 2
    length = math.fsum(abs(b - a) for a, b in sides)
    solid = area > TINY
    centre = sum(corners) / n_beams
    if solid:
        centre = sum((a + b) * (a.conjugate() * b).imag for a, b in sides) / (6 * area)
    distances = [abs(z - centre) for z in corners]
    farthest = max(distances)
    shares = [d / farthest if farthest > TINY else 0.0 for d in distances]
    return {
        "f5": area,
        "f6": length,
        "f7": length / area if solid else 0.0,
        "f9": mean(distances),
        "f9_sd": std(distances),
        "f29": mean(shares),
        "f29_sd": std(shares),
        "f31": 4 * math.pi * area / length**2 if length > TINY else 0.0,
        **fourier_features(sides, length),
        **moment_features([z - centre for z in corners], area, solid),
    }


def fourier_coefficient(sides: list[tuple[complex, complex]], length: float, n: int) -> complex:
    """c_n of the outline as a function of arc length, from the turns at its corners."""
    directions = [(b - a) / abs(b - a) if abs(b - a) > 1e-12 else 0j for a, b in sides]
    total, place = 0j, 0.0
    for k, (a, b) in enumerate(sides):
        turn = directions[k - 1] - directions[k]
        total += turn * cmath.exp(-2j * math.pi * n * place / length)
        place += abs(b - a)
    return total * length / (2 * math.pi * n) ** 2


def fourier_features(sides: list[tuple[complex, complex]], length: float) -> dict[str, float]:
    orders = [n for n in range(-100, 101) if n != 0]
    if length > TINY:
        sizes = {n: abs(fourier_coefficient(sides, length, n)) for n in orders}
    else:
        sizes = dict.fromkeys(orders, 0.0)
    first = sizes[1]
    usable = first > TINY
    values = {f"f16[{n}]": sizes[n] / first if usable else 0.0 for n in orders if n != 1}
    major, minor = first + sizes[-1], abs(first - sizes[-1])
    values |= {"f17": major, "f18": minor, "f19": minor / major if usable else 0.0}
    values |= {"f17_2": major / first if usable else 0.0, "f18_2": minor / first if usable else 0.0}
    return values | {"f19_2": values["f19"]}


def moment(corners: list[complex], p: int, q: int) -> float:
    """The area moment mu_pq of a polygon about the origin (general formula for polygons)."""
    total = []
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        inner = math.fsum(
            math.comb(i + j, j)
            * math.comb(p + q - i - j, q - j)
            * b.real**i
            * a.real ** (p - i)
            * b.imag**j
            * a.imag ** (q - j)
            for i in range(p + 1)
            for j in range(q + 1)
        )
        total.append((a.conjugate() * b).imag * inner)
    return math.fsum(total) / ((p + q + 2) * (p + q + 1) * math.comb(p + q, p))


def moment_features(corners: list[complex], area: float, solid: bool) -> dict[str, float]:
    """``corners`` are relative to the centroid."""
    if not solid:
        return dict.fromkeys([*(f"f21[{k}]" for k in range(1, 8)), "f22", "f23"], 0.0)

    def eta(p: int, q: int) -> float:
        return moment(corners, p, q) / area ** (1 + (p + q) / 2)

    e20, e02, e11 = eta(2, 0), eta(0, 2), eta(1, 1)
    e30, e03, e21, e12 = eta(3, 0), eta(0, 3), eta(2, 1), eta(1, 2)
    hu = [
        e20 + e02,
        (e20 - e02) ** 2 + 4 * e11**2,
        (e30 - 3 * e12) ** 2 + (3 * e21 - e03) ** 2,
        (e30 + e12) ** 2 + (e21 + e03) ** 2,
        (e30 - 3 * e12) * (e30 + e12) * ((e30 + e12) ** 2 - 3 * (e21 + e03) ** 2)
        + (3 * e21 - e03) * (e21 + e03) * (3 * (e30 + e12) ** 2 - (e21 + e03) ** 2),
        (e20 - e02) * ((e30 + e12) ** 2 - (e21 + e03) ** 2) + 4 * e11 * (e30 + e12) * (e21 + e03),
        (3 * e21 - e03) * (e30 + e12) * ((e30 + e12) ** 2 - 3 * (e21 + e03) ** 2)
        - (e30 - 3 * e12) * (e21 + e03) * (3 * (e30 + e12) ** 2 - (e21 + e03) ** 2),
    ]
    values = {
        f"f21[{k + 1}]": math.copysign(math.log10(1 + abs(h) / 1e-12), h) for k, h in enumerate(hu)
    }
    trace = moment(corners, 2, 0) + moment(corners, 0, 2)
    difference = moment(corners, 2, 0) - moment(corners, 0, 2)
    values["f22"] = area**2 / (2 * math.pi * trace)
    values["f23"] = math.hypot(difference, 2 * moment(corners, 1, 1)) / trace
    return values

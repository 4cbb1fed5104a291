"""Exact discrete state of the damped harmonic oscillator ``x'' = -omega^2 x - gamma x'`` under each scheme.

One step is one matrix, derived here from what is known of the scheme on linear systems (stability functions of
Runge-Kutta methods, backward Euler and the trapezoidal rule) and not from a program of the scheme. The state after
n steps is the n-th power of it, in decimals of 60 digits, so that the reference has no rounding.
"""

from decimal import Decimal, getcontext, localcontext

Matrix = list[list[Decimal]]

DIGITS = 60


def _identity(n: int) -> Matrix:
    return [[Decimal(int(i == j)) for j in range(n)] for i in range(n)]


def _product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum((x * y for x, y in zip(row, c, strict=True)), Decimal(0)) for c in columns] for row in a]


def _combine(a: Matrix, factor: Decimal, b: Matrix) -> Matrix:
    return [[x + factor * y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)]


def _inverse(a: Matrix) -> Matrix:
    (p, q), (r, s) = a
    det = p * s - q * r
    return [[s / det, -q / det], [-r / det, p / det]]


def _power(a: Matrix, n: int) -> Matrix:
    out = _identity(len(a))
    for _ in range(n):
        out = _product(a, out)
    return out


def _taylor(generator: Matrix, h: Decimal, order: int) -> Matrix:
    """I + hL + ... + (hL)^order / order!: every explicit Runge-Kutta method with as many stages as its order."""
    out, term = _identity(2), _identity(2)
    for j in range(1, order + 1):
        term = [[value * h / j for value in row] for row in _product(term, generator)]
        out = _combine(out, Decimal(1), term)
    return out


def _two_by_two(scheme: str, h: Decimal, w2: Decimal, g: Decimal) -> Matrix:
    one = Decimal(1)
    generator = [[Decimal(0), one], [-w2, -g]]
    eye = _identity(2)
    if scheme == "explicit_euler":
        return _taylor(generator, h, 1)
    if scheme in ("midpoint", "rk2"):
        return _taylor(generator, h, 2)
    if scheme == "rk4":
        return _taylor(generator, h, 4)
    if scheme == "implicit_euler":
        return _inverse(_combine(eye, -h, generator))
    if scheme == "newmark":  # beta = 1/4, gamma = 1/2 is the trapezoidal rule
        return _product(_inverse(_combine(eye, -h / 2, generator)), _combine(eye, h / 2, generator))
    if scheme == "euler_cromer":  # kick, then drift
        return _product([[one, h], [Decimal(0), one]], [[one, Decimal(0)], [-h * w2, one - h * g]])
    if scheme == "velocity_verlet":
        # x+ = (1 - h^2 w2 / 2) x + (h - h^2 g / 2) v;  a(x+, v + h a) = -w2 x+ - g (v + h a)
        xx, xv = 1 - h * h * w2 / 2, h - h * h * g / 2
        vx = h / 2 * (-w2 - w2 * xx + g * h * w2)
        vv = 1 + h / 2 * (-g - w2 * xv - g * (1 - h * g))
        return [[xx, xv], [vx, vv]]
    raise KeyError(scheme)


def _verlet(h: Decimal, w2: Decimal, g: Decimal) -> Matrix:
    """State (x, w, v): w = (x - x_prev) / h, and v, the central difference that lags by one step."""
    one = Decimal(1)
    w = [-h * w2, one, -h * g]
    x = [one + h * w[0], h * w[1], h * w[2]]
    v = [w[0] / 2, (one + w[1]) / 2, w[2] / 2]
    return [x, w, v]


def _beeman(h: Decimal, w2: Decimal, g: Decimal) -> Matrix:
    """State (x, v, a_prev)."""
    a = [-w2, -g, Decimal(0)]
    x = [1 + h * h / 6 * 4 * a[0], h + h * h / 6 * 4 * a[1], -h * h / 6]
    guess = [h * 3 * a[0] / 2, 1 + h * 3 * a[1] / 2, -h / 2]
    new = [-w2 * x[i] - g * guess[i] for i in range(3)]
    v = [h / 6 * (2 * new[0] + 5 * a[0]), 1 + h / 6 * (2 * new[1] + 5 * a[1]), h / 6 * (2 * new[2] - 1)]
    return [x, v, a]


def states(
    scheme: str, x0: float, v0: float, omega2: float, gamma: float, steps: list[tuple[float, int]]
) -> tuple[float, float]:
    """(x, v) after ``steps``, a list of (h [s], number of steps); a multi-step scheme restarts where h changes.

    ``omega2`` [1/s^2], ``gamma`` [1/s]; floats are taken at their exact binary value.
    """
    with localcontext() as context:
        context.prec = DIGITS
        assert getcontext().prec == DIGITS
        x, v, w2, g = Decimal(x0), Decimal(v0), Decimal(omega2), Decimal(gamma)
        speed = v  # the velocity at the time of x, of second order: what a restarted Verlet scheme starts from
        for h_float, count in steps:
            h = Decimal(h_float)
            if scheme == "verlet":
                w = speed - h / 2 * (-w2 * x - g * v)
                matrix = _power(_verlet(h, w2, g), count)
                x, w, v = [sum(m * s for m, s in zip(row, (x, w, v), strict=True)) for row in matrix]
                speed = w + h / 2 * (-w2 * x - g * v)
            elif scheme == "beeman":
                matrix = _power(_beeman(h, w2, g), count)
                x, v, _ = [sum(m * s for m, s in zip(row, (x, v, -w2 * x - g * v), strict=True)) for row in matrix]
            else:
                matrix = _power(_two_by_two(scheme, h, w2, g), count)
                x, v = [sum(m * s for m, s in zip(row, (x, v), strict=True)) for row in matrix]
        return float(x), float(v)

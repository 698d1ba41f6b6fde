"""Thermals: updrafts in a convective mixing layer [Allen 2006, NASA NTRS 20060004052].

With `zeta = h / zi`, the height over the depth of the mixing layer:

    r2 = max(10 m, 0.102 zeta^(1/3) (1 - 0.25 zeta) zi)          outer radius
    w_mean = w* zeta^(1/3) (1 - 1.1 zeta)                        mean over the disc of radius r2
    w_peak = 3 w_mean (r2 - r1) r2^2 / (r2^3 - r1^3)             core of a trapezoid of revolution with that mean
    w / w_peak = 1 / (1 + |k1 r/r2 + k3|^k2) + k4 r/r2           bell fitted to the trapezoid

Allen tabulates (k1, k2, k3, k4) for seven ratios r1/r2 and jumps from row to row as r2 grows with height; a jump has no
derivative, so one row serves here at all heights: r1/r2 = 0.36, which his rule r1/r2 = 0.0011 r2 + 0.14 reaches at
r2 = 200 m. Lower down his rule gives smaller ratios (0.2 at r2 = 55 m) and up to a quarter more in the core, with the
same mean. Smooth maxima bound h and r2 from below; the weak linear tail, which would grow without end, is faded out.
"""

from airrace.environment.air import Thermal
from airrace.environment.elementary import exp, power, smooth_maximum, sqrt
from airrace.frames import Scalar
from airrace.quantities import T, Vector, quantity, vector

R1_OVER_R2 = 0.36
"""The ratio of the core's radius to the outer radius; one of Allen's seven rows, for the reason given above."""
K1, K2, K3, K4 = 1.4866, 4.8354, -0.0320, 0.0001
"""Allen's shape constants for r1/r2 = 0.36."""
PEAK_OVER_MEAN = 3.0 / (1.0 + R1_OVER_R2 + R1_OVER_R2**2)
"""The ratio `w_peak / w_mean = 3 (r2 - r1) r2^2 / (r2^3 - r1^3)`, with the common factor cancelled."""

RADIUS_FLOOR = 10.0
"""The smallest outer radius, m [Allen]."""
RADIUS_BLEND = 1.0
"""The width of the smooth transition to the smallest outer radius, m."""
HEIGHT_FLOOR = 1.0
"""The height below which a thermal no longer weakens, m: the cube root has no derivative at the ground."""
HEIGHT_BLEND = 1.0
"""The width of the smooth transition to that height, m."""
STRENGTH_BLEND = 0.02
"""The width within which `1 - 1.1 zeta` is rounded off at zero, at the top of the mixing layer; without unit."""
CENTRE_BLEND = 1.0
"""The radius within which the distance from the centre is rounded off, m."""
BELL_BLEND = 1e-3
"""The width within which the bell's `|k1 r/r2 + k3|` is rounded off at zero; without unit."""
FADE = 4.0
"""The distance from the centre at which the updraft has faded to 1/e of the bell, in outer radii."""


@vector
class ThermalParameters(Vector[T]):
    """The place and strength of one thermal."""

    north: T = quantity("m", scale=100.0, text="thermal's centre, north of the origin")
    east: T = quantity("m", scale=100.0, text="thermal's centre, east of the origin")
    w_star: T = quantity("m/s", text="thermal's convective velocity scale")
    mixing_height: T = quantity("m", scale=1000.0, text="depth of the convective mixing layer")


def thermal_parameters(thermal: Thermal) -> ThermalParameters[float]:
    """Return the numbers of a thermal."""
    return ThermalParameters(
        north=thermal.north, east=thermal.east, w_star=thermal.w_star, mixing_height=thermal.mixing_height
    )


def outer_radius(h: Scalar, mixing_height: Scalar) -> Scalar:
    """Return the outer radius `r2` (m) at the height `h` (m) above ground."""
    zeta, root = _relative_height(h, mixing_height)
    return smooth_maximum(0.102 * root * (1.0 - 0.25 * zeta) * mixing_height, RADIUS_FLOOR, RADIUS_BLEND)


def mean_updraft(h: Scalar, w_star: Scalar, mixing_height: Scalar) -> Scalar:
    """Return `w_mean` (m/s, up) at the height `h` (m) above ground.

    It fades to nothing at the top of the mixing layer.
    """
    zeta, root = _relative_height(h, mixing_height)
    return w_star * root * smooth_maximum(1.0 - 1.1 * zeta, 0.0, STRENGTH_BLEND)


def shape(r_over_r2: Scalar) -> Scalar:
    """Return `w / w_peak` at a distance from the centre given in outer radii."""
    distance = K1 * r_over_r2 + K3
    # |d|^k2 as a power of d^2 + tiny: the derivatives exist where d = 0
    steepness = power(distance * distance + BELL_BLEND**2, 0.5 * K2)
    square = r_over_r2 * r_over_r2 / FADE**2
    return (1.0 / (1.0 + steepness) + K4 * r_over_r2) * exp(-square * square * square)


def updraft(x: Scalar, y: Scalar, h: Scalar, thermal: ThermalParameters[Scalar]) -> Scalar:
    """Return the vertical wind (m/s, positive up) of one thermal at `x` north, `y` east and `h` above ground (m)."""
    north, east = x - thermal.north, y - thermal.east
    r = sqrt(north * north + east * east + CENTRE_BLEND**2)
    w_peak = PEAK_OVER_MEAN * mean_updraft(h, thermal.w_star, thermal.mixing_height)
    return w_peak * shape(r / outer_radius(h, thermal.mixing_height))


def _relative_height(h: Scalar, mixing_height: Scalar) -> tuple[Scalar, Scalar]:
    """Return `zeta` and its cube root, with the height bounded from below."""
    zeta = smooth_maximum(h, HEIGHT_FLOOR, HEIGHT_BLEND) / mixing_height
    return zeta, power(zeta, 1.0 / 3.0)

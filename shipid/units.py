"""Factors from common units to SI: value in SI = value * factor; and the acceleration of gravity."""

import math

RPM = 1.0 / 60.0
"""Revolutions per second in one revolution per minute."""
DEGREE = math.pi / 180.0
"""Radians in one degree; also rad/s in one deg/s."""
KNOT = 1852.0 / 3600.0
"""Metres per second in one knot (the international nautical mile is 1,852 m)."""
MINUTE = 60.0
"""Seconds in one minute."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s^2], where a vessel gives no other one; 9.80665 (BIPM, SI Brochure) to three digits."""

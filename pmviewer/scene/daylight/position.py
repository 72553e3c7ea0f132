"""Where the sun stands: Blanco-Muriel et al., "Computing the Solar Vector" (Solar Energy 70, 2001)."""

from __future__ import annotations

import math
from dataclasses import dataclass

EARTH_RADIUS_PER_AU = 6371.01 / 149597890


@dataclass(frozen=True)
class Moment:
    """Local time at a place: degrees north and east, hours ahead of Greenwich. Mitsuba's defaults: Tokyo, 10 July 2010,
    15 h."""

    year: int = 2010
    month: int = 7
    day: int = 10
    hours: float = 15.0
    latitude: float = 35.6894
    longitude: float = 139.6917
    timezone: float = 9.0


def sun_angles(at: Moment) -> tuple[float, float]:
    """Angle of the sun to the zenith, and its azimuth from north over east, in radians."""
    hours = at.hours - at.timezone
    days = _days_since_2000(at) + hours / 24
    omega = 2.1429 - 0.0010394594 * days
    mean_longitude = 4.8950630 + 0.017202791698 * days
    anomaly = 6.2400600 + 0.0172019699 * days
    longitude = (
        mean_longitude
        + 0.03341607 * math.sin(anomaly)
        + 0.00034894 * math.sin(2 * anomaly)
        - 0.0001134
        - 0.0000203 * math.sin(omega)
    )
    obliquity = 0.4090928 - 6.2140e-9 * days + 0.0000396 * math.cos(omega)
    ascension = math.atan2(math.cos(obliquity) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(obliquity) * math.sin(longitude))
    sidereal = 6.6974243242 + 0.0657098283 * days + hours
    angle = math.radians(sidereal * 15 + at.longitude) - ascension
    latitude = math.radians(at.latitude)
    cosine = math.cos(latitude) * math.cos(angle) * math.cos(declination) + math.sin(declination) * math.sin(latitude)
    zenith = math.acos(min(max(cosine, -1.0), 1.0))
    azimuth = math.atan2(
        -math.sin(angle), math.tan(declination) * math.cos(latitude) - math.sin(latitude) * math.cos(angle)
    )
    return zenith + EARTH_RADIUS_PER_AU * math.sin(zenith), azimuth % (2 * math.pi)


def _days_since_2000(at: Moment) -> float:
    """Days from noon of 1 January 2000 (UT) to the midnight that begins the date; integer division towards zero."""
    shift = int((at.month - 14) / 12)
    day = (
        int(1461 * (at.year + 4800 + shift) / 4)
        + int(367 * (at.month - 2 - 12 * shift) / 12)
        - int(3 * int((at.year + 4900 + shift) / 100) / 4)
        + at.day
        - 32075
    )
    return day - 0.5 - 2451545.0

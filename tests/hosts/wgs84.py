# SPDX-License-Identifier: Apache-2.0
"""Places on the WGS-84 ellipsoid, written for the tests from the published formulas alone."""
import math

RADIUS_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)


def ecef(lat_deg, lon_deg, height_m):
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    normal_m = RADIUS_M / math.sqrt(1.0 - ECCENTRICITY2 * math.sin(lat) ** 2)
    return ((normal_m + height_m) * math.cos(lat) * math.cos(lon), (normal_m + height_m) * math.cos(lat) * math.sin(lon),
            (normal_m * (1.0 - ECCENTRICITY2) + height_m) * math.sin(lat))


def axes(lat_deg, lon_deg):
    """Returns east, north and up at a place as vectors in ECEF."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    return ((-math.sin(lon), math.cos(lon), 0.0),
            (-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)),
            (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


class World:
    """The east-north-up frame at an origin."""

    def __init__(self, lat_deg, lon_deg, height_m):
        self.origin = ecef(lat_deg, lon_deg, height_m)
        self.axes = axes(lat_deg, lon_deg)

    def from_ecef(self, point):
        return tuple(dot(axis, [p - o for p, o in zip(point, self.origin)]) for axis in self.axes)

    def direction(self, vector_ecef):
        return tuple(dot(axis, vector_ecef) for axis in self.axes)

    def point(self, lat_deg, lon_deg, height_m):
        return self.from_ecef(ecef(lat_deg, lon_deg, height_m))

    def place(self, enu):
        """Returns latitude, longitude and height of a point, by Newton's method on ecef()."""
        target = [o + sum(enu[k] * self.axes[k][i] for k in range(3)) for i, o in enumerate(self.origin)]
        lon = math.degrees(math.atan2(target[1], target[0]))
        lat = math.degrees(math.atan2(target[2], math.hypot(target[0], target[1]) * (1.0 - ECCENTRICITY2)))
        height = 0.0
        for _ in range(20):
            off = [t - p for t, p in zip(target, ecef(lat, lon, height))]
            _, north, up = axes(lat, lon)
            height += dot(off, up)
            lat += math.degrees(dot(off, north) / RADIUS_M)
        return lat, lon, height

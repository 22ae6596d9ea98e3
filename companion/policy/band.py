"""How does a straight path lead through the middle of a gap? An elastic band between remembered hits; pure; local NED.

A heading says which gap; where its middle is, to the centimetre, the map knows better than forty-one headings can say.
"""

import numpy as np

from companion.core import geometry
from companion.core.types import F64
from companion.policy.centring import centred
from companion.policy.chords import chords
from companion.policy.interface import Query

ROOM_M = 0.15  # clearance up to which hits push,
PUSH_M, SWEEPS = 0.006, 40  # by so much in each of so many sweeps: the figures of the expert's paths in tight places
NODE_M, TAIL_M = 0.06, 0.42  # places of the band, and how far it goes on beyond the path, that the path's end gives
CHORD_M = 0.01  # how far the band may leave the waypoints' chords
FITS_M = 0.005  # the least margin worth flying


def between(way_ne_m: F64, hits_ne_m: F64, query: Query) -> F64:
    """At most five waypoints (k, 2) from the anchor on, along a way (n, 2) but pushed off the hits (h, 2)."""
    way = np.concatenate([query.prefix_ne_m[-1:], way_ne_m])
    whole_m = geometry.length(way)
    if not whole_m > 0.0:
        return way_ne_m
    band = geometry.resample(geometry.extended(way, TAIL_M), NODE_M)
    band = centred(band, hits_ne_m, query.radius_m + ROOM_M, PUSH_M, SWEEPS)
    return chords(geometry.part(band, 0.0, whole_m), CHORD_M, whole_m)


def fits(path_ne_m: F64, hits_ne_m: F64, query: Query) -> bool:
    """Does the vehicle pass the hits (h, 2) on a proposed path (k, 2), if only just?"""
    whole = np.concatenate([query.prefix_ne_m[:1], path_ne_m])
    return geometry.swept_free_length(whole, hits_ne_m, query.radius_m + FITS_M) >= geometry.length(whole) - 1e-9

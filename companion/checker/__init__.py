"""May this polyline be flown? Keep, modify or refuse; depends on nothing learned."""

"""Who can fly a benchmark: the navigator and the classical planners that it is compared with, behind one interface."""

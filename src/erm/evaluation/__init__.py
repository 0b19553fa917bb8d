"""How good a map is: against an outline, against measurements, and what it lacks."""

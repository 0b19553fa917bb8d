"""What blocks the lines between points: the flat faces of an environment and its arcs."""

from typing import NamedTuple

import numpy as np

from erm.maps.environment import Environment
from erm.tracing.cylinders import Cylinders, cylinders_of
from erm.tracing.faces import Faces, faces_of, is_unobstructed


class Obstacles(NamedTuple):
    """Flat faces and arcs."""

    faces: Faces
    arcs: Cylinders

    def leave_free(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Whether (...) nothing blocks the lines between points (..., 3)."""
        return is_unobstructed(self.faces, first, second) & self.arcs.leave_free(first, second)


def obstacles_of(environment: Environment) -> Obstacles:
    """Walls, ground, ceiling and arcs; poles block nothing."""
    return Obstacles(faces_of(environment), cylinders_of(environment, ("arc",)))

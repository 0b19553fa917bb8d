"""From a map to paths: the image method, Fresnel reflection, cylinders."""

"""Point scatterers and cylinders."""

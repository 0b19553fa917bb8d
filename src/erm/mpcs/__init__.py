"""Tables of multipath components: reading, selection, clusters and standard errors."""

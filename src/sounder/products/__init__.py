"""Products in xarray: an engine of ``xarray.open_dataset``, and an accessor with the usual views."""

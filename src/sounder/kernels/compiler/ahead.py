"""What takes longest to compile, compiled by a process of its own: ``python -m sounder.kernels.compiler.ahead``."""

from sounder.kernels.compiler.startup import start_compiling


def main() -> None:
    """Compile the fit of a path, for the types of arguments that it always has."""
    start_compiling()
    import numpy as np

    from sounder.kernels.extraction import columns
    from sounder.kernels.extraction.fit_path import fit
    from sounder.kernels.extraction.scan_view import OVER, View

    view = View(
        beam=np.empty((1, 7)),
        azimuth_cut=np.empty((2, 1)),
        elevation_cut=np.empty((2, 1)),
        pulse=np.empty(2 * OVER, complex),
        matched=np.empty(2 * OVER, complex),
        limits=np.empty(6),
        grid=np.array([1, 1, 0, OVER]),
    )
    beams = np.empty((1, 1), np.complex64)
    fit.given(beams, view, 1.0, columns.work_of(view), np.empty(columns.COLUMNS), beams, 0, True).compile()


if __name__ == "__main__":
    main()

"""Fixtures shared by all tests."""

from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("Agg")

SLOW_EXAMPLES = (
    "src/sounder/__init__.py",
    "src/sounder/campaign/run.py",
    "src/sounder/campaign/worth.py",
    "src/sounder/cir/power_spectrum.py",
    "src/sounder/processing/channel_parameters.py",
    "src/sounder/products/engine.py",
    "src/sounder/processing/pipeline.py",
    "src/erm/evaluation/leave_one_out.py",
    "src/erm/survey/calibration.py",
    "src/erm/survey/conventions.py",
    "src/erm/reconstruction/make_map.py",
)
"""Files whose docstrings have examples that process captures."""
SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"
LONG_TESTS = (
    "tests/erm/reconstruction/model/test_errors.py::test_errors_of_walls_follow",
    "tests/erm/reconstruction/search/test_bent_facades.py::test_a_straight_facade_is_one_wall[10.0]",
    "tests/erm/reconstruction/search/test_bent_facades.py::test_without_splitting",
    "tests/erm/reconstruction/search/test_density.py::test_four_links",
    "tests/erm/reconstruction/search/test_density.py::test_paths_through_a_wall_refute_it",
    "tests/erm/reconstruction/test_bundle_walls.py::test_chains",
    "tests/erm/reconstruction/test_invariance.py::test_a_campaign_that_was_copied",
    "tests/erm/reconstruction/test_invariance.py::test_the_frame_of_a_place",
    "tests/erm/reconstruction/test_invariance.py::test_the_order_of_components",
    "tests/erm/reconstruction/test_raytraced.py::test_all_specular_paths_with_noise_give_walls_to_centimetres[lroom]",
    "tests/erm/reconstruction/test_rx_std.py",
    "tests/erm/reconstruction/test_without_direct_paths.py::test_heading_is_found_and_the_clock_is_said_to_be_unknown_unless_chains_show_it[0.0]",
    "tests/erm/reconstruction/test_without_direct_paths.py::test_walls_are_found_to_their_covariances[0.0",
    "tests/erm/tracing/test_trace_reference.py::test_an_independent_ray_tracer_finds_the_same_paths[lroom]",
    "tests/soak/test_soak.py::test_damaged_files_and_flipped_bits",
    "tests/sounder/campaign/test_demo.py",
    "tests/sounder/campaign/test_letter_study.py",
    "tests/sounder/campaign/test_study.py",
    "tests/sounder/cir/test_phase_alignment.py::test_gain_is_true",
    "tests/sounder/cli/test_compiled.py",
    "tests/sounder/cli/test_figures.py::test_several_processes_draw_the_same",
    "tests/sounder/cli/test_process.py::test_a_run_has_no_kernel_compiled_twice",
    "tests/sounder/cli/test_process.py::test_nothing_is_imported",
    "tests/sounder/cli/test_run.py::test_an_option_that_changed",
    "tests/sounder/cli/test_run.py::test_formats_of_map_and_figures",
    "tests/sounder/cli/test_run.py::test_products_that_are_not_of_the_campaign",
    "tests/sounder/kernels/compiler/test_cache.py::test_processes_that_start_together",
    "tests/sounder/kernels/correlation/test_m_sequence.py::test_any_order_in_registers[11",
    "tests/sounder/kernels/correlation/test_m_sequence.py::test_any_order_in_registers[15",
    "tests/sounder/kernels/correlation/test_targets.py",
    "tests/sounder/mpc/test_extract.py::test_a_full_table_says_so",
    "tests/sounder/mpc/test_extract.py::test_a_horn_that_differs",
    "tests/sounder/mpc/test_extract.py::test_beyond_the_fan",
    "tests/sounder/mpc/test_extract.py::test_errors_are_what_the_standard_deviations_say[35.0]",
    "tests/sounder/mpc/test_extract.py::test_paths_outside_the_fan",
    "tests/sounder/mpc/test_fan.py",
    "tests/sounder/mpc/test_stated.py::test_errors_of_the_pattern_are_those_of_random_horns",
    "tests/sounder/mpc/test_table.py::test_methods_differ",
    "tests/sounder/mpc/test_table.py::test_misfit_tells",
    "tests/sounder/mpc/test_uncertainty.py::test_errors_among_scattered_rays",
    "tests/sounder/processing/test_cluster.py",
    "tests/sounder/processing/test_pipeline.py::test_a_position_that_failed_leaves_its_name_to_the_next_recording_of_it[2]",
    "tests/sounder/processing/test_pipeline.py::test_the_same_failure_of_many_positions_is_reported_once[2]",
    "tests/sounder/processing/test_raytraced.py",
    "tests/sounder/processing/test_survival.py::test_positions_that_vanish_while_others_are_processed",
    "tests/sounder/report/test_browser",
    "tests/test_packaging.py::test_the_letters_study",
)
"""Tests that take four to ten seconds of a processor or more; `make long` runs them."""


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of independent captures and path tables, beside the project; tests that need it skip without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip("independent data (../shared/data) are not beside this clone")
    return SHARED_DATA


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark examples of docstrings that take more than half a second, and long tests."""
    for item in items:
        if item.nodeid.startswith(SLOW_EXAMPLES):
            item.add_marker(pytest.mark.slow)
        if item.nodeid.startswith(LONG_TESTS):
            item.add_marker(pytest.mark.long)

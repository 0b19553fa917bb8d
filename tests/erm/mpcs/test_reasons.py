"""Why an MPC is on a map or is not."""

import numpy as np

from erm.mpcs.reasons import Reason, count_reasons


def test_a_column_of_strings_compares_with_members():
    column = np.array([Reason.ACCEPTED, Reason.LOSS], dtype=object).astype(np.str_)
    assert (column == Reason.LOSS).tolist() == [False, True]
    assert np.isin(column, (Reason.ACCEPTED, Reason.TOO_SHORT)).tolist() == [True, False]
    assert [Reason(value) for value in column.tolist()] == [Reason.ACCEPTED, Reason.LOSS]


def test_no_two_reasons_read_alike():
    assert len({reason.text for reason in Reason}) == len(Reason)


def test_reasons_are_counted_the_most_frequent_first():
    counts = count_reasons(["loss", "accepted", "loss", "false_alarm"])
    assert list(counts.items()) == [(Reason.LOSS, 2), (Reason.ACCEPTED, 1), (Reason.FALSE_ALARM, 1)]
    assert count_reasons([]) == {}

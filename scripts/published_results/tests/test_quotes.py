import pytest

from published_results.quotes import in_tables, not_in_tables

KNOWN = in_tables("| ν | η |\n| 0.3 | 7.77 ± 0.27 |\n| 1 | -1.6 ± 0.7 % | +14 % |\nno table: 5 ± 1\n")


@pytest.mark.parametrize(
    "sentence",
    ["It is 7.77 ± 0.27.", "Lower by 1.6 ± 0.7 %, or -1.6 ± 0.7 %.", "It grows by +14 % from 12 to 13.", "```text\n9 ± 1\n```", "| 9 ± 1 |"],
)
def test_quotations_are_found(sentence):
    assert not_in_tables(sentence, KNOWN) == []


@pytest.mark.parametrize(
    ("sentence", "number"),
    [("It is 7.8 ± 0.3.", "7.8 ± 0.3"), ("By 1.6 ± 0.7.", "1.6 ± 0.7"), ("By -14 %.", "-14 %"), ("It is 5 ± 1.", "5 ± 1"), ("+1.6 ± 0.7 %", "+1.6 ± 0.7 %")],
)
def test_numbers_of_no_table_are_named(sentence, number):
    assert not_in_tables(sentence, KNOWN) == [number]

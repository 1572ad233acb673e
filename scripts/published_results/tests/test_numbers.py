import pytest

from published_results.numbers import interval, short, significant


@pytest.mark.parametrize(
    ("number", "digits", "text"),
    [(1.436e-7, 4, "1.436e-7"), (7.7829, 4, "7.783"), (0.0024, 3, "0.00240"), (123456.0, 4, "1.235e5"), (0.0, 4, "0")],
)
def test_numbers_have_the_digits_asked_for(number, digits, text):
    assert significant(number, digits) == text


@pytest.mark.parametrize(("number", "text"), [(10000.0, "10000"), (1e5, "1e5"), (0.7, "0.7"), (1 / 3, "0.3333"), (1.0, "1")])
def test_short_numbers_have_no_more_digits_than_they_need(number, text):
    assert short(number, 4) == text


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [
        (9.86, 0.789, "9.86 ± 0.79"),
        (1044.2, 3300.1, "1044 ± 3300"),
        # Rounding makes two digits of 0.0996 three.
        (1.0, 0.0996, "1.00 ± 0.10"),
        (123456.0, 2345.0, "(1.235 ± 0.023)e5"),
        (5.0, 0.0, "5.000"),
    ],
)
def test_intervals_have_two_digits(value, half, text):
    assert interval(value, half) == text
